"""Where the traffic can be: whatever a dense look finds lies within what was offered."""

import math
from random import Random

import numpy as np
import pytest

from components.flights.bounds import attitude_extremes_rad, traffic_envelope
from components.flights.legs import Climb, Straight, Turn
from components.flights.sampled_flight import SampledFleet, SampledTrajectory
from components.flights.scripted_flights import ScriptedFleet, ScriptedTrajectory
from components.geometry.ellipsoid import line_of_sight
from components.messages.reach import FarthestLook, Reach, combined_farthest_look
from components.sensor.mounting import SensorAxes


def flight(draw: Random, name: str) -> ScriptedTrajectory:
    legs = draw.choice(
        [
            (),
            (Turn(rate_deg_s=draw.choice([-4.0, 2.0])),),
            (
                Straight(duration_s=20),
                Climb(climb_mps=draw.uniform(-9, 9), duration_s=30),
                Straight(),
            ),
        ]
    )
    return ScriptedTrajectory(
        name,
        lat_deg=draw.uniform(59.9, 60.1),
        lon_deg=179.9 + draw.uniform(0.0, 0.3),
        alt_m=draw.uniform(500, 3000),
        heading_deg=draw.uniform(0, 360),
        speed_mps=draw.uniform(1, 200),
        legs=legs,
    )


@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize("count", [3, 3000])
def test_a_dense_look_stays_inside(seed: int, count: int) -> None:
    """With 3,000 targets samples are coarse, so most of the envelope comes from the speeds."""
    draw = Random(seed)
    own = flight(draw, "own")
    few = [flight(draw, f"t{i}") for i in range(3)]
    targets = few * (count // 3)
    reach_m, duration_s = 6000.0, 90.0
    found = traffic_envelope(own, ScriptedFleet(targets), duration_s, reach_m)
    times = np.linspace(0.0, duration_s, 4001)
    me, them = own.at(times), ScriptedFleet(few).at(times)
    _, elevation, range_m = line_of_sight(
        me.lat_deg[:, None], me.lon_deg[:, None], me.alt_m[:, None],
        them.lat_deg, them.lon_deg, them.alt_m,
    )  # fmt: skip
    assert found.own_lat_deg[0] <= me.lat_deg.min() and me.lat_deg.max() <= found.own_lat_deg[1]
    assert found.own_alt_m[0] <= me.alt_m.min() and me.alt_m.max() <= found.own_alt_m[1]
    near = range_m <= reach_m
    if near.any():
        assert found.target_alt_m[0] <= them.alt_m[near].min()
        assert them.alt_m[near].max() <= found.target_alt_m[1]
        assert np.abs(elevation[near]).max() <= found.elevation_rad
        assert range_m[near].max() <= found.range_m <= reach_m
    assert np.abs(me.pitch_rad).max() <= found.pitch_rad
    assert np.abs(me.roll_rad).max() <= found.roll_rad


def test_nobody_in_reach_leaves_nothing_to_judge() -> None:
    own = ScriptedTrajectory("own", lat_deg=0, lon_deg=0, alt_m=500)
    far = [ScriptedTrajectory("far", lat_deg=1, lon_deg=0, alt_m=500)]
    assert traffic_envelope(own, ScriptedFleet(far), 60.0, 1000.0).range_m == 0.0
    seen = traffic_envelope(own, ScriptedFleet(far), 60.0, math.inf)
    # A degree of latitude at the equator: WGS 84's radius there, 500 m up.
    assert seen.range_m == pytest.approx(math.radians(1.0) * (6335439.0 + 500.0), rel=1e-3)


def test_rolling_through_upside_down_counts_as_the_angle_it_passes() -> None:
    recorded = SampledTrajectory(
        "r", [0, 1, 2], [0, 0, 0], [0, 0.001, 0.002], [0, 0, 0],
        pitch_rad=[0.1, -0.3, 0.0], roll_rad=[0.0, 3.0, -3.0],
    )  # fmt: skip
    pitch, roll = attitude_extremes_rad(recorded)
    states = SampledFleet([recorded]).at(np.linspace(0, 2, 2001))
    assert pitch == pytest.approx(np.abs(states.pitch_rad).max())
    assert roll == pytest.approx(2 * math.pi - 3.0)
    assert np.abs(states.roll_rad).max() <= roll


def test_an_unknown_flight_may_have_any_attitude() -> None:
    assert attitude_extremes_rad(object()) == (0.5 * math.pi, math.pi)


def test_requests_add_up_and_the_silent_want_everything() -> None:
    near = Reach((-1, 1), (-0.2, 0.3), 5000.0, range_slack=0.01)
    wide = Reach((-1, 1), (-0.9, 0.1), 2000.0, exact_because="rates")
    off = Reach((-1, 1), (-1.5, 1.5), 9e9, enabled=False)
    assert combined_farthest_look([near, wide, off]) == FarthestLook(
        5000.0, ((2000.0, 0.9), (5000.0, 0.3)), 0.01, "rates"
    )
    assert combined_farthest_look([near, None]).views[-1] == (math.inf, 0.5 * math.pi)


def test_a_tilted_sensor_sees_steeper_body_elevations() -> None:
    level = Reach((-1, 1), (-0.2, 0.3), 5000.0)
    turned = SensorAxes((1.0, 0.0, 0.0), (1.0, 0.0, 0.0)).reach_in_body_axes(level)
    assert turned.steepest_elevation_rad == pytest.approx(0.3)
    tilted = SensorAxes((0.0, 0.4, 0.0), (0.0, 0.4, 0.0))
    _, elevation = tilted.believed_direction_in_body(np.linspace(-1, 1, 201), np.full(201, 0.3))
    steepest_rad = tilted.reach_in_body_axes(level).steepest_elevation_rad
    assert np.abs(elevation).max() <= steepest_rad + 1e-15 and steepest_rad == pytest.approx(0.7)


def test_the_lowest_and_the_highest_target_in_reach_bound_the_altitudes() -> None:
    """And one out of reach does not; with no speed they are known to a margin of a metre."""
    heights_m = {"low": (0.001, 300.0), "middle": (0.002, 500.0), "high": (-0.001, 900.0)}
    heights_m |= {"far and low": (1.0, 20.0), "far and high": (-1.0, 9000.0)}
    own = ScriptedTrajectory("own", lat_deg=0, lon_deg=0, alt_m=500, speed_mps=0.001)
    targets = [
        ScriptedTrajectory(name, lat_deg=lat, lon_deg=0, alt_m=alt, speed_mps=0.001)
        for name, (lat, alt) in heights_m.items()
    ]
    low, high = traffic_envelope(own, ScriptedFleet(targets), 10.0, 5000.0).target_alt_m
    assert 298.9 < low <= 300.0 and 900.0 <= high < 901.1
