"""Turning away from what comes near: which way, how far, how fast, from whom and how often."""

import math

import numpy as np
import pytest
from covering import covers
from wired import chain, rows, run, sensor

TRACKER = {"type": "tracking.stub"}


def turned(azimuth_deg: float, *, range_m: float = 3000.0, duration_s: float = 8, **avoidance):
    """Manoeuvres and the final heading with a hovering target at a body azimuth."""
    bearing = math.radians(217.0 + azimuth_deg)
    target = {
        "name": "near", "east_m": range_m * math.sin(bearing),
        "north_m": range_m * math.cos(bearing), "up_m": 50.0,
    }  # fmt: skip
    own = {
        "lat_deg": -41.3, "lon_deg": -179.9997, "alt_m": 2400, "heading_deg": 217,
        "speed_mps": 40.0,
    }  # fmt: skip
    scene = chain(
        {"radar": sensor("radar.range_boundary", scan_rate_hz=2)}, ownship=own, targets=[target],
        duration_s=duration_s, fusion={"type": "fusion.pick_best"}, tracker=TRACKER,
    )  # fmt: skip
    scene["blocks"]["avoidance"] = {"type": "avoidance.turn_away", **avoidance}
    scene["wires"] += [
        "tracker -> avoidance",
        {"from": "avoidance", "to": "traffic", "delay_s": 0.1, "holds": "nothing"},
    ]
    found = run(scene)
    manoeuvres = rows(found, "manoeuvres")
    azimuths = np.degrees([row["azimuth_rad"] for row in rows(found)])
    return manoeuvres, azimuths


@covers("turn_deg", "rate_deg_s", "range_km", "pause_s", of=("avoidance.turn_away",))
@pytest.mark.parametrize("azimuth_deg", [20.0, -20.0])
def test_the_ownship_turns_away_as_far_and_as_fast_as_told(azimuth_deg):
    """Away from a target on the right is to the left; its body azimuth grows by the turn."""
    side = -1.0 if azimuth_deg > 0 else 1.0
    manoeuvres, azimuths = turned(azimuth_deg, turn_deg=24.0, rate_deg_s=8.0)
    assert [row["time_s"] for row in manoeuvres] == [0.0]
    assert manoeuvres[0]["turn_rad"] == pytest.approx(side * math.radians(24.0))
    assert manoeuvres[0]["rate_rad_s"] == pytest.approx(math.radians(8.0))
    # Turning to the left moves what is seen to the right; flying on moves it by 3 deg at most.
    assert azimuths[-1] - azimuths[0] == pytest.approx(-side * 24.0, abs=5.0)
    assert azimuths[2] - azimuths[0] == pytest.approx(-side * 0.9 * 8.0, abs=1.5)


def test_the_ownship_turns_for_what_is_near_and_not_all_the_time():
    assert turned(20.0, range_km=2.5)[0] == []
    near, _ = turned(20.0, range_km=2.9)
    assert 2.0 < near[0]["time_s"] < 3.5  # 100 m at 40 m/s, nearly straight on
    paused, _ = turned(20.0, turn_deg=5.0, pause_s=2.5)
    assert [row["time_s"] for row in paused] == [0.0, 2.5, 5.0, 7.5]
    assert len(turned(20.0, turn_deg=5.0, pause_s=30)[0]) == 1


@pytest.mark.parametrize("nearer", ["left", "right"])
def test_it_is_the_nearest_track_that_is_turned_away_from(nearer):
    """Two hovering targets on both sides, and names that sort the other way round."""
    targets = []
    for name, azimuth_deg in (("left", -20.0), ("right", 20.0)):
        bearing = math.radians(217.0 + azimuth_deg)
        range_m = 1500.0 if name == nearer else 2500.0
        targets.append(
            {
                "name": name,
                "east_m": range_m * math.sin(bearing),
                "north_m": range_m * math.cos(bearing),
                "up_m": 900.0 if name == nearer else -40.0,
            }
        )
    own = {"lat_deg": -41.3, "lon_deg": -179.9997, "alt_m": 2400, "heading_deg": 217}
    scene = chain(
        {"radar": sensor("radar.range_boundary")}, ownship={**own, "speed_mps": 40.0},
        targets=targets, fusion={"type": "fusion.pick_best"}, tracker=TRACKER,
    )  # fmt: skip
    scene["blocks"]["avoidance"] = {"type": "avoidance.turn_away"}
    scene["wires"] += [
        "tracker -> avoidance",
        {"from": "avoidance", "to": "traffic", "delay_s": 0.1, "holds": "nothing"},
    ]
    (told,) = rows(run(scene), "manoeuvres")
    assert (told["turn_rad"] > 0) is (nearer == "left")
