"""Makers of the tables of docs/sensors.md."""
