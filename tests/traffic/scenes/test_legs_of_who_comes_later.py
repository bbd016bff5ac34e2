"""Legs are flown from the time at which a target appears."""

import crooked
import numpy as np
import pytest
from wired import chain, rows, run, sensor

LEGS = [
    {"kind": "straight", "heading_deg": 90.0, "speed_mps": 50.0, "duration_s": 1.0},
    {"kind": "straight", "heading_deg": 180.0, "speed_mps": 40.0, "climb_mps": 6.0},
]


@pytest.mark.parametrize("start_s", [0.0, 1.5])
def test_the_first_leg_begins_when_the_target_appears(start_s):
    level = {"lat_deg": -41.3, "lon_deg": -179.9997, "alt_m": 2400.0}
    late = {
        "name": "late", "east_m": 300.0, "north_m": 200.0, "up_m": 0.0, "legs": LEGS,
        "start_time_s": start_s,
    }  # fmt: skip
    radar = sensor("radar.range_boundary", scan_rate_hz=2)
    found = {}
    for row in rows(run(chain({"radar": radar}, ownship=level, targets=[late], duration_s=5))):
        north, east, down = row["true_range_m"] * crooked.direction(
            row["true_azimuth_rad"], row["true_elevation_rad"]
        )
        found[row["time_s"] - start_s] = (east - 300.0, north - 200.0, -down)
    assert min(found) == 0.0
    for flown_s, place in found.items():
        later_s = max(0.0, flown_s - 1.0)
        expected = (50.0 * min(flown_s, 1.0), -40.0 * later_s, 6.0 * later_s)
        assert np.array(place) == pytest.approx(expected, abs=0.05)
