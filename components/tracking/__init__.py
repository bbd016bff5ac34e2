"""Tracks: the memory of a target between detections."""
