"""Radars: the radar equation, detection probability, clutter and RCS."""
