"""Makers of the pages of the docs; they may import everything, nothing imports them."""
