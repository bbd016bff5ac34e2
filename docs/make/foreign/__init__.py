"""Makers of docs/foreign.md."""
