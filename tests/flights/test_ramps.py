"""What a multirotor flies that is told a velocity: closed forms of a velocity that grows."""

import math

import numpy as np
import pymap3d
import pytest
from geographiclib.geodesic import Geodesic

from components.flights.leg_motion import RAMP_ROWS, Ramps
from components.flights.many_flights import SteeredFlight
from components.flights.scripted_flights import ScriptedTrajectory
from components.messages.steering import Manoeuvre

START = (52.0, 4.0, 100.0)


def told(east, north, acceleration=5.0):
    return Manoeuvre(
        velocity_east_mps=east, velocity_north_mps=north, acceleration_mps2=acceleration
    )


def flight(heading_deg=0.0, speed_mps=10.0, **more):
    lat, lon, alt = START
    return SteeredFlight(
        ScriptedTrajectory(
            "own", lat_deg=lat, lon_deg=lon, alt_m=alt, heading_deg=heading_deg,
            speed_mps=speed_mps, **more,
        )
    )  # fmt: skip


def enu(state, start=START):
    return np.array(pymap3d.geodetic2enu(state.lat_deg, state.lon_deg, state.alt_m, *start))


def test_velocity_moves_straight_to_the_commanded_one_and_stays():
    """From (0, 10) to (16, -2) m/s: 20 m/s at 5 m/s² take 4 s; the way is v t + a t² / 2."""
    flown = flight().add_manoeuvre(20.0, told(16.0, -2.0))
    times = np.array([20.0, 21.0, 24.0, 30.0])
    gone = np.minimum(times - 20.0, 4.0)
    left = times - 20.0 - gone
    east = 0.5 * 4.0 * gone**2 + 16.0 * left
    north = 200.0 + 10.0 * gone - 0.5 * 3.0 * gone**2 - 2.0 * left
    found = enu(flown.at(times))
    np.testing.assert_allclose(found[0], east, atol=2e-3)
    np.testing.assert_allclose(found[1], north, atol=2e-3)
    np.testing.assert_allclose(flown.at(times).alt_m, 100.0)
    tracks = np.arctan2(4.0 * gone, 10.0 - 3.0 * gone) % (2 * math.pi)
    np.testing.assert_allclose(flown.at(times).yaw_rad, tracks, atol=1e-4)


def test_commands_follow_each_other_from_the_velocity_of_the_moment():
    """After 2 s of the first ramp (8, 4) m/s; from there back to rest in 4 / √5 s."""
    flown = flight().add_manoeuvre(0.0, told(16.0, -2.0)).add_manoeuvre(2.0, told(0.0, 0.0))
    speed = math.hypot(8.0, 4.0)
    stops_m = np.array([8.0, 4.0]) * (0.5 * speed / 5.0)
    before = np.array([0.5 * 4.0 * 4.0, 20.0 - 0.5 * 3.0 * 4.0])
    found = enu(flown.at(np.array([2.0, 2.0 + speed / 5.0, 100.0])))
    np.testing.assert_allclose(found[:2, 0], before, atol=1e-3)
    np.testing.assert_allclose(found[:2, 1], before + stops_m, atol=1e-3)
    np.testing.assert_array_equal(found[:2, 1], found[:2, 2])
    assert flown.at(100.0).yaw_rad == pytest.approx(math.atan2(8.0, 4.0), abs=1e-4)
    assert flown.max_speed_mps == pytest.approx(math.hypot(16.0, 2.0))


def test_a_turn_after_a_velocity_begins_with_its_track_and_speed():
    turned = (
        flight()
        .add_manoeuvre(0.0, told(12.0, 0.0))
        .add_manoeuvre(30.0, Manoeuvre(math.pi / 2, 0.1))
    )
    state = turned.at(np.array([29.9, 30.1, 60.0, 70.0]))
    np.testing.assert_allclose(state.yaw_rad[:2], [math.pi / 2, math.pi / 2 + 0.01], atol=1e-3)
    assert state.yaw_rad[2] == pytest.approx(math.pi, abs=1e-3)
    moved = enu(state)[:, 3] - enu(state)[:, 2]
    np.testing.assert_allclose(moved[:2], [0.0, -120.0], atol=0.1)


def test_it_levels_off_and_follows_the_geodesic():
    flown = flight(speed_mps=10.0, climb_mps=2.0).add_manoeuvre(10.0, told(12.0, 16.0, 100.0))
    assert flown.at(np.array([10.0, 500.0])).alt_m == pytest.approx(120.0)
    begin, end = flown.at(10.2), flown.at(510.2)
    way = Geodesic.WGS84.Inverse(
        float(begin.lat_deg), float(begin.lon_deg), float(end.lat_deg), float(end.lon_deg)
    )
    # Aloft it is longer by the height over the radius.
    assert way["s12"] * (1 + 120.0 / 6.38e6) == pytest.approx(10_000.0, abs=0.5)
    assert way["azi1"] == pytest.approx(math.degrees(math.atan2(12.0, 16.0)), abs=1e-3)


def test_a_ramp_s_rows_lie_together_however_often_the_fleet_grew():
    """Some ramps are taken at once at every scan: apart in memory each command copies them all."""
    grown = Ramps(np.empty(0), np.empty((RAMP_ROWS, 0)), np.empty(0))
    for k in range(5):
        new = Ramps(np.full(3, float(k)), np.full((RAMP_ROWS, 3), float(k)), np.ones(3))
        grown = grown.with_flights(new)
    table = grown._tables.values
    assert table.shape == (RAMP_ROWS, 15) and table[0, ::3].tolist() == [0.0, 1.0, 2.0, 3.0, 4.0]
    assert table.strides[0] == table.itemsize
