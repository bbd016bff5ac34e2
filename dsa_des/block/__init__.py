"""Blocks: their ports, parameters, messages, effects and ladders."""
