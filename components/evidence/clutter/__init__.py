"""What clutter, thresholds and moving-target filters do to detection range: docs/clutter.md."""
