"""Fusion: detections of several sensors that belong together, and what they say."""
