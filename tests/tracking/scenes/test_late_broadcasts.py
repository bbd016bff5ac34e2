"""Broadcasts and replies that come late, when a track has been born since."""

import numpy as np
import pytest
from wired import chain, rows, run

RADAR = {"type": "radar.range_boundary", "range_km": 8, "scan_rate_hz": 1, "errors": "stated",
         "quantised": False, "azimuth_error_deg": 0.5, "elevation_error_deg": 0.6,
         "range_error_m": 15.0, "latency_s": "0.3"}  # fmt: skip
ADS_B = {"type": "surveillance.ads_b", "scan_rate_hz": 1, "offset_s": "0.7", "latency_s": "0.8"}
ACTIVE = {"type": "surveillance.active", "scan_rate_hz": 1, "offset_s": "0.5", "latency_s": "0.9",
          "far_every": 1, "elevation_deg": [-60, 60]}  # fmt: skip
#: Comes within the radar's 8 km of the ownship after 4.5 s.
GLIDER = {"name": "glider", "north_m": -8400.0, "east_m": 0.0, "up_m": 100.0, "heading_deg": 0.0,
          "speed_mps": 30.0}  # fmt: skip
KEA = {
    "name": "kea",
    "north_m": -5000.0,
    "east_m": -3000.0,
    "up_m": 200.0,
    "heading_deg": 80.0,
    "speed_mps": 90.0,
    "climb_mps": 3.0,
    "mode_s": True,
    "ads_b": {"nacp": 9, "nacv": 3},
}


@pytest.mark.parametrize("kind", ["ekf", "ukf", "imm"])
@pytest.mark.parametrize("late_one", [ADS_B, ACTIVE], ids=["broadcasts", "replies"])
def test_a_track_born_since_is_taken_back_with_the_errors_it_carries(kind, late_one):
    """Of errors that are new at each look nothing is known before a first one, but how large."""
    last = {}
    for late in ("one_step", "rerun"):
        scene = chain(
            {"radar": RADAR, "late": late_one}, targets=[KEA, GLIDER], duration_s=12,
            fusion={"type": "fusion.pass_through"},
            tracker={"type": f"tracking.{kind}", "late": late},
        )  # fmt: skip
        found = rows(run(scene), "state_tracks")
        born = {row["track"]: row["time_s"] - row["age_s"] for row in found}
        assert sum(time_s > 3.0 for time_s in born.values()) == 1  # the glider's
        last[late] = {row["track"]: row for row in found if row["time_s"] == found[-1]["time_s"]}
    exact, near = last["rerun"], last["one_step"]
    assert near.keys() == exact.keys() and len(near) == 2
    for track, row in exact.items():
        for i, name in enumerate(("north_m", "east_m", "down_m")):
            deviation = np.sqrt(row[f"covariance_{i}{i}_m2"])
            assert abs(near[track][name] - row[name]) < 0.3 * deviation
            assert near[track][f"covariance_{i}{i}_m2"] == pytest.approx(deviation**2, rel=0.1)
