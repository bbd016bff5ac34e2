"""Volumes that aircraft must keep out of, and when straight flights meet them; pure arrays."""
