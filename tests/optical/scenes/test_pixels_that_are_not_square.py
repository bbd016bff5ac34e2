"""Cameras whose pixels are wider than high, or higher than wide."""

import math

import crooked
import numpy as np
import pytest
from wired import SEES_ALL, chain, first_look

AREAS = {"front_m2": 9.0, "side_m2": 0.0, "horizontal_m2": 0.0}
TARGETS = [{**t, "eo": AREAS, "ir": {**AREAS, "back_m2": 9.0}} for t in crooked.TARGETS]


@pytest.mark.parametrize(("across", "upward"), [(36000, 9000), (9000, 18000), (12000, 20000)])
@pytest.mark.parametrize("kind", ["optical.eo", "optical.ir", "optical.projection"])
def test_an_area_counts_both_sides_of_a_pixel_and_a_line_its_width(kind, across, upward):
    eye = {**SEES_ALL, "type": kind, "azimuth_pixels": across, "elevation_pixels": upward}
    seen = first_look(chain({"eye": eye}, targets=TARGETS), "eye")
    wide_rad, high_rad = 2.0 * math.pi / across, math.pi / upward
    for target in TARGETS:
        range_m = float(np.linalg.norm(crooked.ned(target)))
        if kind == "optical.projection":  # a ball is as long as wide, whatever the height of a line
            expected = 2.0 * math.sqrt(9.0 / math.pi) / (range_m * wide_rad)
        else:
            expected = 9.0 / (range_m**2 * wide_rad * high_rad)
        assert seen[target["name"]]["pixels"] == pytest.approx(expected, rel=1e-6)
