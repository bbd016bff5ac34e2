"""Cameras: how large and how bright a target is on the image, by day and in infrared."""
