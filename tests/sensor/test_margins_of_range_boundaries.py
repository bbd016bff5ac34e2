"""The margin of a sensor that detects within a range: that of an echo, or of an area."""

import math

import crooked
import numpy as np
import pytest
from wired import alone, rows


@pytest.mark.parametrize("range_km", [5.0, 20.0])
def test_a_radar_has_the_decibels_and_a_camera_the_pixels_to_spare(range_km):
    """An echo falls with the fourth power of range, an area with the second."""
    for target in crooked.TARGETS:
        ratio = 1000.0 * range_km / float(np.linalg.norm(crooked.ned(target)))
        for kind, expected in (
            ("radar.range_boundary", 40.0 * math.log10(ratio)),
            ("optical.range_boundary", ratio**2 - 1.0),
        ):
            (row,) = rows(alone(kind, range_km=range_km), target=target["name"])
            assert row["confidence"] == pytest.approx(expected, rel=1e-6)
