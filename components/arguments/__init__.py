"""Checks of the arguments of physics functions, and their way into arrays."""
