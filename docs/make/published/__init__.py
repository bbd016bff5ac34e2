"""Makers of docs/published.md: one module per section, each with its rows."""
