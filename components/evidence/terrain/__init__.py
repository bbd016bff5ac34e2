"""The elevation raster that is shipped."""
