"""Observers who look out: models of visual acquisition, and the block."""
