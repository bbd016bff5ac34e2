"""Yaw, pitch and roll derived from noisy, slow, sparse and standing paths."""

import numpy as np
import pytest

from components.flights.attitude import attitude_from_path, fit_velocity_and_acceleration
from components.flights.legs import Climb, Turn
from components.flights.scripted_flights import ScriptedTrajectory

STANDARD_BANK = np.degrees(np.arctan(60 * np.radians(3) / 9.80665))  # 17.76 degrees


def turn(rate_hz, seconds=60, rate_deg_s=3.0):
    flight = ScriptedTrajectory(
        "t", lat_deg=45, lon_deg=-75, alt_m=1000, speed_mps=60, legs=[Turn(rate_deg_s=rate_deg_s)]
    )
    time = np.arange(seconds * rate_hz + 1) / rate_hz
    return time, flight.at(time)


@pytest.mark.parametrize("rate_hz", [1, 4, 10, 50])
@pytest.mark.parametrize("rate_deg_s", [3.0, -3.0])
def test_bank_of_a_coordinated_turn(rate_hz, rate_deg_s):
    time, s = turn(rate_hz, rate_deg_s=rate_deg_s)
    _, pitch, roll = attitude_from_path(time, s.lat_deg, s.lon_deg, s.alt_m)
    assert np.degrees(roll) == pytest.approx(np.sign(rate_deg_s) * STANDARD_BANK, abs=0.06)
    assert np.abs(pitch).max() < 1e-3


def test_positions_rounded_to_a_millionth_of_a_degree_at_10_hz():
    """Real recordings are rounded to 1e-6 degrees (0.11 m), noise of 1 m/s between two samples."""
    time, s = turn(10)
    yaw, _, roll = attitude_from_path(
        time, np.round(s.lat_deg, 6), np.round(s.lon_deg, 6), np.round(s.alt_m, 1)
    )
    inner = slice(20, -20)
    error = np.abs((yaw - s.yaw_rad + np.pi) % (2 * np.pi) - np.pi)
    assert np.degrees(error[inner]).max() < 0.15
    assert np.abs(np.degrees(roll[inner]) - STANDARD_BANK).max() < 1.0


def test_pitch_is_the_flight_path_angle():
    flight = ScriptedTrajectory(
        "c", lat_deg=0, lon_deg=0, alt_m=0, speed_mps=60, legs=[Climb(climb_mps=5)]
    )
    time = np.arange(20.0)
    s = flight.at(time)
    _, pitch, roll = attitude_from_path(time, s.lat_deg, s.lon_deg, s.alt_m)
    assert pitch == pytest.approx(np.arctan2(5, 60), abs=1e-5)
    assert roll == pytest.approx(0, abs=1e-6)


def test_standing_still_keeps_the_last_yaw_and_is_level():
    time = np.arange(30.0)
    # Ten seconds north-east, ten standing, ten standing with a millimetre of noise.
    along = np.minimum(time, 10) * 20e-5
    noise = np.where(time > 20, 1e-8 * (-1) ** time, 0)
    yaw, pitch, roll = attitude_from_path(time, along + noise, along, 0 * time)
    assert yaw[15:] == pytest.approx(yaw[12], abs=1e-12)
    assert np.degrees(yaw[15]) == pytest.approx(45, abs=1)
    assert (pitch[15:] == 0).all()
    assert (roll[15:] == 0).all()


def test_before_it_first_moves_the_first_yaw_is_used():
    time = np.arange(20.0)
    lon = np.maximum(time - 10, 0) * 1e-3
    yaw, _, _ = attitude_from_path(time, 0 * time, lon, 0 * time)
    assert yaw[:5] == pytest.approx(np.pi / 2, abs=1e-3)


@pytest.mark.parametrize("count", [1, 2, 5])
def test_never_moving_is_all_zero(count):
    same = np.ones(count)
    for values in attitude_from_path(np.arange(count) * 1.0, same, same, same):
        assert (values == 0).all()


def test_clumped_times_do_not_make_up_a_turn():
    """Two noisy samples a millisecond apart, then ten seconds: no curve can be told from that."""
    time = np.array([0.0, 0.001, 10.0, 20.0])
    _, acceleration = fit_velocity_and_acceleration(
        time, np.array([0.0, 1e-6, 5e-3, 1e-2]), 0 * time, 0 * time
    )
    assert np.abs(acceleration).max() < 0.5
