"""Silhouette models compared over rotation with a reference."""
