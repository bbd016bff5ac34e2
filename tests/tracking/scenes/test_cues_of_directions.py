"""Cones of tracks without a range, high over a banked ownship, and the end of all cones."""

import math

import crooked
import numpy as np
import pytest
from test_cue_keys import DELAY_S, cued
from wired import SEES_ALL, rows, run

#: It leaves the camera's range after two seconds, at an elevation of some 55 deg.
STEEP = {"name": "steep", "east_m": -420.0, "north_m": -330.0, "up_m": 800.0, "heading_deg": 236.0,
         "speed_mps": 160.0, "climb_mps": 60.0}  # fmt: skip
CAMERA = {**SEES_ALL, "azimuth_pixels": 720, "elevation_pixels": 3600, "scan_rate_hz": 2,
          "range_km": 1.2}  # fmt: skip
TRACKER = {"delete_misses": 3, "assumed_range_m": 1000.0, "start_speed_m_s": 150.0}


@pytest.fixture(scope="module", params=[0.01, 7.0])
def found(request):
    """The narrowest cone, deg, and what was recorded."""
    cues = {"least_half_angle_deg": request.param, "most_half_angle_deg": 90.0, "sigmas": 2.5,
            "lasts_s": 30.0}  # fmt: skip
    scene = cued(cues=cues, targets=(STEEP,), duration_s=6, tracker=TRACKER, scan_rate_hz=4)
    scene["blocks"]["spotter"] = CAMERA
    return request.param, run(scene)


def key(row):
    return row["time_s"], row["track"]


def apart(one, other):
    """The angle between two directions, rad."""
    return 2.0 * math.asin(0.5 * float(np.linalg.norm(one - other)))


def test_a_cone_without_a_range_is_as_wide_as_its_direction_is_unsure(found):
    least_deg, result = found
    tracks = {key(r): r for r in rows(result, "state_tracks")}
    for cone in rows(result, "cues"):
        track = tracks[key(cone)]
        at = track["azimuth_rad"], track["elevation_rad"]
        assert not track["has_range"] and math.degrees(at[1]) > 45.0
        spread = math.sqrt(track["azimuth_variance_rad2"]), 0.0
        sideways = apart(crooked.direction(*at), crooked.direction(*np.add(at, spread)))
        upward = math.sqrt(track["elevation_variance_rad2"])
        wanted = max(2.5 * sideways, 2.5 * upward, math.radians(least_deg))
        assert cone["half_angle_rad"] == pytest.approx(wanted, rel=1e-3)


def test_a_track_that_is_deleted_cues_no_more(found):
    """Nothing is told in place of its cone, which would count for half a minute."""
    least_deg, result = found
    tracks = rows(result, "state_tracks")
    live = [key(r) for r in tracks if r["track_status"] != "deleted"]
    assert [key(r) for r in rows(result, "cues")] == live
    gone_s = tracks[-1]["time_s"]
    assert tracks[-1]["track_status"] == "deleted" and gone_s < 4.0
    for row in rows(result, block="sensor") if least_deg > 1.0 else ():
        # Cued from when the first cone has come, up to when that there is none has come.
        assert row["cued"] is (DELAY_S <= row["time_s"] < gone_s + DELAY_S), row
