"""What the Earth and its mountains hide: rays, horizon, elevation rasters."""
