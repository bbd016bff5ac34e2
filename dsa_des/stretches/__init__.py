"""Blocks of a scene that changes while it runs: each stretch of time has an instance of its own."""
