"""Exact clocks, the timeline of a run, and draws that are functions of their keys."""
