"""Makers of pages about other people's parts."""
