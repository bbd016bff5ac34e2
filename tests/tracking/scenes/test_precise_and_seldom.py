"""A radar that looks seldom and is far more precise than what a second look is expected within."""

import numpy as np
import pytest
from wired import chain, rows, run

from dsa_des import load_scene
from dsa_des.running.reports import notes_of_scene
from dsa_des.running.simulation import Simulation

OWN = {"lat_deg": 52.0, "lon_deg": 4.4, "alt_m": 2000, "heading_deg": 0, "speed_mps": 0}
TARGET = {"name": "across", "north_m": 6000, "east_m": -5000, "up_m": 0, "heading_deg": 90,
          "speed_mps": 200}  # fmt: skip
RADAR = {"type": "radar.range_boundary", "scan_rate_hz": "0.2", "range_km": 30, "range_error_m": 1,
         "errors": "stated", "quantised": False, "azimuth_error_deg": 0.02,
         "elevation_error_deg": 0.02}  # fmt: skip


@pytest.mark.parametrize("tracker", [
    {"type": "tracking.ekf"}, {"type": "tracking.imm"},
    {"type": "tracking.ekf", "association": "jpda"},
])  # fmt: skip
def test_one_aircraft_across_is_one_track_where_it_is(tracker):
    """It is 1 km on at the second look: along the tangent 84 m off, outside the third's gate."""
    for seed in (1, 2):
        scene = chain({"radar": RADAR}, ownship=OWN, targets=[TARGET], duration_s=30,
                      fusion={"type": "fusion.pass_through"}, tracker=tracker)  # fmt: skip
        found = rows(run(scene | {"seed": seed}), "state_tracks")
        assert {row["track"] for row in found} == {1}
        assert found[-1]["track_status"] == "confirmed"
        for row in found[1:]:
            east_m = -5000.0 + 200.0 * row["state_s"]
            # Its level flight follows the Earth, 0.2 m of the range here.
            away = np.hypot(row["north_m"], row["east_m"]) - np.hypot(6000.0, east_m)
            assert abs(away) < 6.0


@pytest.mark.parametrize(("azimuth_deg", "says"), [(9.0, True), (4.0, False)])
def test_a_tracker_says_that_bearings_are_too_coarse_for_it(azimuth_deg, says):
    scene = chain({"radar": {**RADAR, "azimuth_error_deg": azimuth_deg, "range_error_m": 20}},
                  ownship=OWN, targets=[TARGET], tracker={"type": "tracking.ekf"},
                  fusion={"type": "fusion.pass_through"})  # fmt: skip
    notes = notes_of_scene(Simulation(load_scene(scene)))
    assert any("azimuths of radar have an error of 9°" in note for note in notes) == says
