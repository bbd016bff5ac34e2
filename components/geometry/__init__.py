"""Directions, rotations and the ellipsoid, as pure functions over arrays."""
