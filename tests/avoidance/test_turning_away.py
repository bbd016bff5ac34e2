"""Turning away from what comes near: which way, how far, how fast, from whom and how often."""

import math

import numpy as np
import pytest
from covering import covers
from wired import chain, rows, run, sensor

from components.turning_away import TurnAwayParameters

TRACKER = {"type": "tracking.stub"}


def turned(
    azimuth_deg: float, *, range_m: float = 3000.0, duration_s: float = 8,
    kind: str = "radar.range_boundary", **avoidance,
):  # fmt: skip
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
        {"sensor": sensor(kind, scan_rate_hz=2)}, ownship=own, targets=[target],
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


def in_body_deg(azimuth_deg: float, bank_deg: float) -> float:
    """Body azimuth of the target, 50 m higher and 3 km away, from an ownship that banks."""
    azimuth, bank, rise = math.radians(azimuth_deg), math.radians(bank_deg), 50.0 / 3000.0
    across = math.sin(azimuth) * math.cos(bank) - rise * math.sin(bank)
    return math.degrees(math.atan2(across, math.cos(azimuth)))


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
    bank_deg = side * math.degrees(math.atan(40.0 * math.radians(8.0) / 9.80665))
    expected = in_body_deg(azimuth_deg - side * 0.9 * 8.0, bank_deg)
    assert azimuths[2] == pytest.approx(expected, abs=0.5)


@covers("bank_deg", "roll_rate_deg_s", of=("avoidance.turn_away",))
def test_a_bank_turns_as_fast_as_the_speed_lets_it_and_takes_time_to_roll():
    banked = {"turn_deg": 60.0, "bank_deg": 40.0}
    (at_once,), azimuths = turned(-20.0, **banked)
    (rolled,), later = turned(-20.0, **banked, roll_rate_deg_s=10.0)
    assert at_once["bank_rad"] == rolled["bank_rad"] == pytest.approx(math.radians(40.0))
    assert (at_once["rate_rad_s"], at_once["roll_rate_rad_s"]) == (0.0, 0.0)
    # By hand, at 40 m/s: 9.80665 tan 40° / 40 = 11.79 deg/s; 3.9 s of roll turn by 20.3 deg. What
    # is seen moves by 0.3 to 0.6 deg/s beside.
    assert azimuths[2] == pytest.approx(in_body_deg(-20.0 - 0.9 * 11.79, 40.0), abs=0.5)
    rolled_rad = 9.80665 / 40.0 / math.radians(10.0) * -math.log(math.cos(math.radians(39.0)))
    expected = in_body_deg(-20.0 - math.degrees(rolled_rad), 39.0)
    assert later[8] == pytest.approx(expected, abs=2.0)
    assert azimuths[8] - azimuths[0] < -40.0


@covers("without_range", of=("avoidance.turn_away",))
@pytest.mark.parametrize("side", [20.0, -20.0])
def test_a_camera_s_track_has_no_range_and_is_turned_from_where_told(side):
    camera = {"kind": "optical.range_boundary", "duration_s": 1, "range_km": 0.1}
    assert turned(side, **camera)[0] == []
    ((row,), _) = turned(side, **camera, without_range=True)
    assert row["turn_rad"] == pytest.approx(-math.copysign(math.radians(30.0), side))
    # Who is known to be far is not turned from.
    assert turned(side, range_km=0.1, duration_s=1, without_range=True)[0] == []


@covers("direction", of=("avoidance.turn_away",))
@pytest.mark.parametrize(
    ("direction", "signs"),
    [("away", (-1, 1)), ("towards", (1, -1)), ("left", (-1, -1)), ("right", (1, 1))],
)
def test_it_turns_to_the_side_that_the_scene_says(direction, signs):
    found = [turned(side, duration_s=1, direction=direction)[0] for side in (20.0, -20.0)]
    assert [math.copysign(1.0, row["turn_rad"]) for (row,) in found] == list(signs)


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


def test_a_rate_is_said_to_be_idle_where_a_bank_is_given():
    rate, bank = {"rate_deg_s": 2.0}, {"bank_deg": 20.0}
    assert TurnAwayParameters(**rate).ineffective_key_notes() == []
    assert TurnAwayParameters(**bank).ineffective_key_notes() == []
    (said,) = TurnAwayParameters(**rate, **bank).ineffective_key_notes()
    assert "rate_deg_s" in said and "bank_deg is given" in said
