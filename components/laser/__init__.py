"""Scanning lasers: the range equation, the pattern of a scan, and the block."""
