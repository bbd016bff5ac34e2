"""docs/clutter.md: the encounters behind its numbers run, and its table of rain is computed."""

import math
from pathlib import Path

from docs.make.clutter import detections, half_range_m, rain_table

PAGE = (Path(__file__).parents[3] / "docs" / "clutter.md").read_text(encoding="utf-8")


def test_the_table_of_rain_is_the_one_that_is_computed():
    assert "\n".join(rain_table()) in PAGE


def test_ground_takes_range_and_detections_from_a_radar_that_has_half_its_looks_at_5_km():
    clear, covered = (half_range_m({}, gamma_db) for gamma_db in (None, -20.0))
    # One look, of 110 m closing, at 20 Hz.
    assert math.isclose(clear, 5000.0, abs_tol=6.0)
    assert covered < 0.5 * clear
    counts = [detections({}, gamma_db, 1) for gamma_db in (None, -20.0)]
    assert counts[0] > 1.5 * counts[1] > 0
