"""Blocks and their physics."""
