"""Bands of manoeuvres that lead to a violation, and of those that lead out of one; pure arrays."""
