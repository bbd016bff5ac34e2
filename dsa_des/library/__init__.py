"""Scenes, runs and studies in Python: what the command line does, as functions."""
