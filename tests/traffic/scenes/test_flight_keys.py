"""Each kind of leg as flown by intruders and by ownships, against small steps summed by hand."""

import math
from typing import Any

import crooked
import numpy as np
import pymap3d
import pytest
from covering import covers
from wired import chain, rows, run, sensor

import dsa_des

START = {"lat_deg": -41.3, "lon_deg": -179.9997, "alt_m": 2400.0}
REFERENCE = START["lat_deg"], START["lon_deg"], START["alt_m"]
RADAR = sensor("radar.range_boundary", scan_rate_hz=2, range_km=100.0)
#: Of so small an error the ownship's reports say where it is.
TOLD = {"position_bias_m": [0, 0, 1e-6]}
Path = dict[float, np.ndarray]


def as_intruder(flight: dict, duration_s: float) -> Path:
    """Positions from the start (east, north, up, m) as a level radar at the start sees them."""
    place = {"east_m": 0.0, "north_m": 0.0, "up_m": 0.0}
    scene = chain(
        {"radar": RADAR}, ownship=START, targets=[{"name": "one", **place, **flight}],
        duration_s=duration_s,
    )  # fmt: skip
    found = {}
    for row in rows(run(scene)):
        north, east, down = row["true_range_m"] * crooked.direction(
            row["true_azimuth_rad"], row["true_elevation_rad"]
        )
        found[row["time_s"]] = np.array([east, north, -down])
    return found


def of_ownship(traffic: dict, duration_s: float) -> Path:
    """Positions from the start as the ownship's reports tell them."""
    scene = chain({"radar": RADAR}, duration_s=duration_s, navigation=TOLD)
    scene["blocks"]["traffic"] = traffic
    found = {}
    for row in rows(run(scene)):
        place = row["own_lat_deg"], row["own_lon_deg"], row["own_alt_m"]
        found[row["time_s"]] = np.array(pymap3d.geodetic2enu(*place, *REFERENCE))
    return found


def as_ownship(flight: dict, duration_s: float) -> Path:
    one = {"name": "one", "east_m": 3000.0, "north_m": 100.0}
    traffic = {"type": "traffic.scripted", "ownship": {**START, **flight}, "intruders": [one]}
    return of_ownship(traffic, duration_s)


def as_random_ownship(flight: dict, duration_s: float) -> Path:
    traffic = {
        "type": "traffic.random", "ownship": {**START, **flight}, "intruders": 1, "radius_km": 5,
    }  # fmt: skip
    return of_ownship(traffic, duration_s)


FLOWN = {
    "traffic.scripted.intruders": as_intruder,
    "traffic.scripted.ownship": as_ownship,
    "traffic.random.ownship": as_random_ownship,
}


def stepped(pieces: list[dict[str, Any]], end_s: float) -> Path:
    """Sum small steps of (seconds, heading in deg, deg/s, m/s, climb in m/s)."""
    found, at, time, step = {}, np.zeros(3), 0.0, 0.001
    heading = 0.0
    for piece in pieces:
        heading = piece.get("heading", heading)
        for _ in range(round(min(piece["s"], end_s - time) / step)):
            if abs(time / 0.5 - round(time / 0.5)) < 1e-6:
                found[round(2 * time) / 2] = at.copy()
            middle = math.radians(heading + 0.5 * piece.get("turn", 0.0) * step)
            level = piece["speed"] * step
            at += [level * math.sin(middle), level * math.cos(middle), piece["climb"] * step]
            heading += piece.get("turn", 0.0) * step
            time += step
    return found


BASE = {"heading_deg": 217.0, "speed_mps": 50.0, "climb_mps": 0.0}
GIVEN = {"heading": 217.0, "speed": 50.0, "climb": 0.0}

CASES: dict[str, tuple[dict[str, Any], list[dict[str, Any]]]] = {
    "no legs": (
        {**BASE, "climb_mps": 4.0},
        [{**GIVEN, "s": 9, "climb": 4.0}],
    ),
    "straight": (
        {**BASE, "legs": [
            {"kind": "straight", "duration_s": 2, "heading_deg": 300, "speed_mps": 80,
             "climb_mps": 5},
            {"kind": "straight", "heading_deg": 30},
        ]},
        [{"s": 2, "heading": 300, "speed": 80, "climb": 5},
         {"s": 9, "heading": 30, "speed": 80, "climb": 0}],
    ),
    "turn by rate": (
        {**BASE, "legs": [
            {"kind": "turn", "rate_deg_s": 30, "duration_s": 3, "climb_mps": -3},
            {"kind": "straight", "speed_mps": 20},
        ]},
        [{**GIVEN, "s": 3, "turn": 30, "climb": -3}, {"s": 9, "speed": 20, "climb": 0}],
    ),
    "turn by radius": (
        {**BASE, "legs": [
            {"kind": "turn", "radius_m": -100, "angle_deg": 90, "speed_mps": 40},
            {"kind": "straight"},
        ]},
        # 90 deg of a circle of 100 m at 40 m/s, to the left.
        [{**GIVEN, "s": 2.5 * math.pi / 2, "turn": -math.degrees(0.4), "speed": 40},
         {"s": 9, "speed": 40, "climb": 0}],
    ),
    "climb for a time": (
        {**BASE, "legs": [
            {"kind": "climb", "climb_mps": 6, "duration_s": 2, "speed_mps": 70},
            {"kind": "straight"},
        ]},
        [{**GIVEN, "s": 2, "speed": 70, "climb": 6}, {"s": 9, "speed": 70, "climb": 0}],
    ),
    "climb to an altitude": (
        {**BASE, "legs": [{"kind": "climb", "climb_mps": -10, "to_alt_m": 2385}]},
        [{**GIVEN, "s": 1.5, "climb": -10}, {**GIVEN, "s": 9}],
    ),
    "stationary": (
        {**BASE, "legs": [
            {"kind": "straight", "duration_s": 1}, {"kind": "stationary", "duration_s": 2},
            {"kind": "straight"},
        ]},
        [{**GIVEN, "s": 1}, {**GIVEN, "s": 2, "speed": 0}, {**GIVEN, "s": 9}],
    ),
    "waypoints": (
        {**BASE, "legs": [{"kind": "waypoints", "speed_mps": 60, "points": [
            {"east_m": 120, "north_m": 0, "up_m": 8},
            {"east_m": 120, "north_m": -90, "up_m": -4, "speed_mps": 30},
        ]}]},
        [{"s": 2, "heading": 90, "speed": 60, "climb": 4},
         {"s": 3, "heading": 180, "speed": 30, "climb": -4},
         {"s": 9, "heading": 180, "speed": 30, "climb": 0}],
    ),
    "waypoints on Earth": (
        {**BASE, "legs": [{"kind": "waypoints", "points": [
            # 100 m to the south, 20 m up, by the meridian's radius there plus the height.
            {"lat_deg": -41.3 - math.degrees(100 / 6366628.0), "lon_deg": 180.0003,
             "alt_m": 2420.0},
        ]}]},
        [{"s": 2, "heading": 180, "speed": 50, "climb": 10}, {**GIVEN, "heading": 180, "s": 9}],
    ),
}  # fmt: skip


@covers(
    *(f"legs.{kind}.{key}" for kind, keys in {
        "straight": ("duration_s", "kind", "heading_deg", "speed_mps", "climb_mps"),
        "turn": ("duration_s", "kind", "rate_deg_s", "radius_m", "angle_deg", "speed_mps",
                 "climb_mps"),
        "climb": ("duration_s", "kind", "climb_mps", "to_alt_m", "speed_mps"),
        "stationary": ("duration_s", "kind"),
        "waypoints": ("kind", "speed_mps", *(f"points.{key}" for key in (
            "lat_deg", "lon_deg", "alt_m", "east_m", "north_m", "up_m", "speed_mps"))),
    }.items() for key in keys),
    "heading_deg", "speed_mps", "climb_mps",
    of=tuple(FLOWN),
)  # fmt: skip
@pytest.mark.parametrize("case", list(CASES))
@pytest.mark.parametrize("source", list(FLOWN))
def test_legs_are_flown(source, case):
    flight, pieces = CASES[case]
    expected = stepped(pieces, 6.0)
    found = FLOWN[source](flight, 6.0)
    assert len(found) == 12
    for time, place in found.items():
        np.testing.assert_allclose(place, expected[time], atol=0.15, err_msg=f"at {time} s")


@covers("ownship.speed_mps", of=("traffic.random",))
@covers("speed_mps", "legs.turn.speed_mps", of=("traffic.scripted.ownship",))
def test_a_turn_by_rate_may_change_the_speed():
    legs = [{"kind": "turn", "rate_deg_s": -20, "duration_s": 3, "speed_mps": 25}]
    expected = stepped([{**GIVEN, "s": 9, "turn": -20, "speed": 25}], 4.0)
    for fly in FLOWN.values():
        for time, place in fly({**BASE, "legs": legs}, 4.0).items():
            if time <= 3:
                np.testing.assert_allclose(place, expected[time], atol=0.15)


@covers("ownship.lat_deg", "ownship.lon_deg", "ownship.alt_m", "ownship.yaw_deg",
        "ownship.pitch_deg", "ownship.roll_deg", of=("traffic.random",))  # fmt: skip
def test_a_random_scene_s_ownship_stands_and_points_as_told():
    """Position and attitude are found back from what is reported of two intruders."""
    own = {**crooked.OWNSHIP, "speed_mps": 0.0, "climb_mps": 0.0}
    traffic = {"type": "traffic.random", "ownship": own, "intruders": 2, "radius_km": 5}
    scene = chain({"radar": RADAR}, navigation=TOLD)
    scene["blocks"]["traffic"] = traffic
    pair = rows(run(scene), scan=0)
    for row in pair:
        place = row["own_lat_deg"], row["own_lon_deg"], row["own_alt_m"]
        expected = own["lat_deg"], own["lon_deg"], own["alt_m"]
        np.testing.assert_allclose(pymap3d.geodetic2enu(*place, *expected), 0.0, atol=1e-3)
        body = crooked.direction(row["azimuth_rad"], row["elevation_rad"])
        level = crooked.direction(row["ned_azimuth_rad"], row["ned_elevation_rad"])
        np.testing.assert_allclose(crooked.attitude(own) @ level, body, atol=1e-9)


@pytest.mark.parametrize("traffic", ["scripted", "random"])
def test_attitudes_follow_from_the_path_unless_given(traffic):
    """Yaw is the track, pitch the path's slope, roll the bank of a coordinated turn."""
    flight = {**BASE, "climb_mps": 5.0, "legs": [{"kind": "turn", "rate_deg_s": 12}]}
    table: dict[str, Any] = {"type": f"traffic.{traffic}", "ownship": {**START, **flight}}
    if traffic == "random":
        table |= {"intruders": 1, "radius_km": 5}
    else:
        table["intruders"] = [{"name": "one", "east_m": 3000.0, "north_m": 100.0}]
    scene = chain({"radar": RADAR}, navigation=TOLD, duration_s=3)
    scene["blocks"]["traffic"] = table
    bank = math.degrees(math.atan(50.0 * math.radians(12.0) / 9.80665))
    pitch = math.degrees(math.atan2(5.0, 50.0))
    for row in rows(run(scene)):
        body = crooked.direction(row["azimuth_rad"], row["elevation_rad"])
        level = crooked.direction(row["ned_azimuth_rad"], row["ned_elevation_rad"])
        turned = crooked.rotation(217.0 + 12.0 * row["time_s"], pitch, bank)
        np.testing.assert_allclose(turned @ level, body, atol=2e-4)


@pytest.mark.parametrize(
    ("leg", "place", "said"),
    [
        ({"kind": "turn"}, "", "rate_deg_s is None and radius_m is None: give one of the two"),
        ({"kind": "turn", "rate_deg_s": 0}, "", "rate_deg_s is 0.0: it must not be 0"),
        ({"kind": "climb", "climb_mps": 3, "duration_s": 3, "to_alt_m": 9}, "", "give one of the"),
        ({"kind": "waypoints", "points": [{"lat_deg": 3}]}, ".points[0]", "must have lat_deg and"),
        ({"kind": "waypoints", "points": []}, ".points", "at least 1"),
        ({"kind": "straight", "duration_s": -3}, ".duration_s", "must be greater than 0"),
        ({"rate_deg_s": 3}, ".kind", "missing"),
    ],
)
def test_a_leg_that_cannot_be_flown_is_named_with_its_place(leg, place, said):
    straight = {"kind": "straight", "duration_s": 3}
    scene = chain({"radar": RADAR}, ownship={**START, "legs": [straight, leg]}, targets=[])
    with pytest.raises(dsa_des.SceneError) as caught:
        dsa_des.load_scene(scene)
    (problem,) = caught.value.problems
    assert problem.key == f"blocks.traffic.ownship.legs[1]{place}"
    assert said in problem.message
