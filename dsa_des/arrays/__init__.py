"""Kinds of arrays, and sets of integers kept as arrays in order."""
