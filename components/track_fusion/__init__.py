"""Tracks of several trackers made one."""
