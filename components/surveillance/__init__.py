"""Cooperative surveillance: what transponders broadcast, and what they answer."""
