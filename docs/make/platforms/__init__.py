"""The tables of docs/platforms.md."""
