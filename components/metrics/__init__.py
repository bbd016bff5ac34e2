"""Metrics of an encounter: detection, declaration, fusion, tracks."""
