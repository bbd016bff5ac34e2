"""Interpolation between samples: exact at them, seamless, never outside."""

from types import SimpleNamespace

import numpy as np
import pytest
from geographiclib.geodesic import Geodesic
from hypothesis import given, settings
from hypothesis import strategies as st

from components.flights.legs import Turn
from components.flights.sampled_flight import SampledTrajectory
from components.flights.scripted_flights import ScriptedTrajectory
from components.geometry.ellipsoid import line_of_sight
from components.traffic.recorded import implausible_motion_sentences


def distance(a, b):
    return line_of_sight(a.lat_deg, a.lon_deg, a.alt_m, b.lat_deg, b.lon_deg, b.alt_m)[2]


def angle_between(a, b):
    return np.abs((a - b + np.pi) % (2 * np.pi) - np.pi)


@st.composite
def paths(draw):
    n = draw(st.integers(1, 12))
    gaps = draw(st.lists(st.floats(0.01, 50), min_size=n, max_size=n))
    time = np.cumsum(gaps) + draw(st.floats(-100, 1e5))
    column = lambda low, high: draw(  # noqa: E731
        st.lists(st.floats(low, high), min_size=n, max_size=n)
    )
    velocity = None
    if draw(st.booleans()):
        velocity = (column(-300, 300), column(-300, 300), column(-30, 30))
    return SampledTrajectory(
        "x",
        time,
        column(-90, 90),
        column(-400, 400),
        column(-400, 20000),
        velocity_enu_mps=velocity,
    )


@settings(derandomize=True, deadline=None, max_examples=100)
@given(paths(), st.lists(st.floats(-200, 2e5), min_size=1, max_size=30))
def test_exact_at_samples_present_only_within_and_finite_everywhere(trajectory, extra):
    samples = trajectory.sample_times_s
    state = trajectory.at(samples)
    assert (state.lat_deg == trajectory.lat_deg).all()
    assert (state.lon_deg == trajectory.lon_deg).all()
    assert (state.alt_m == trajectory.alt_m).all()
    assert state.present.all()
    first, last = trajectory.interval_present()
    times = np.array([*extra, np.nextafter(first, -np.inf), np.nextafter(last, np.inf)])
    state = trajectory.at(times)
    assert (state.present == ((times >= first) & (times <= last))).all()
    assert not state.present[-2:].any()
    for values in state.arrays()[:-1]:
        assert np.isfinite(values).all()
    assert (np.abs(state.lat_deg) <= 90).all()
    assert ((state.lon_deg >= -180) & (state.lon_deg < 180)).all()
    assert ((state.yaw_rad >= 0) & (state.yaw_rad < 2 * np.pi)).all()


@settings(derandomize=True, deadline=None, max_examples=50)
@given(paths(), st.integers(1, 4000))
def test_same_bits_in_any_batch(trajectory, seed):
    low, high = trajectory.interval_present()
    times = np.random.default_rng(seed).uniform(low - 1, high + 1, 1000)
    whole = trajectory.at(times).arrays()
    parts = [
        trajectory.at(times[5]).arrays(),
        trajectory.at(times[:7]).arrays(),
        trajectory.at(np.repeat(times, 3)[::3]).arrays(),
        trajectory.at(times.reshape(10, 100)).arrays(),
    ]
    for k, column in enumerate(whole):
        assert parts[0][k] == column[5]
        assert (parts[1][k] == column[:7]).all()
        assert (parts[2][k] == column).all()
        assert (parts[3][k].reshape(-1) == column).all()


# Errors in the docstring, measured on an exact 3 deg/s turn at 60 m/s.
@pytest.mark.parametrize(
    "rate_hz, with_velocity, limit_m, limit_yaw_deg",
    [
        (1, False, 0.40, 0.005),
        (1, True, 3e-5, 1e-5),
        (10, False, 0.0041, 0.005),
        (10, True, 1e-6, 1e-6),
    ],
)
def test_error_in_a_turn(rate_hz, with_velocity, limit_m, limit_yaw_deg):
    truth = ScriptedTrajectory(
        "t", lat_deg=45, lon_deg=-75, alt_m=1000, speed_mps=60, legs=[Turn(rate_deg_s=3)]
    )
    time = np.arange(60 * rate_hz + 1) / rate_hz
    s = truth.at(time)
    velocity = (60 * np.sin(s.yaw_rad), 60 * np.cos(s.yaw_rad), 0 * time)
    sampled = SampledTrajectory(
        "s",
        time,
        s.lat_deg,
        s.lon_deg,
        s.alt_m,
        velocity_enu_mps=velocity if with_velocity else None,
    )
    query = np.linspace(0, 60, 4001)
    a, b = truth.at(query), sampled.at(query)
    assert distance(a, b).max() < limit_m
    assert np.degrees(angle_between(a.yaw_rad, b.yaw_rad)).max() < limit_yaw_deg
    assert np.degrees(np.abs(a.roll_rad - b.roll_rad)).max() < 0.05
    assert np.abs(b.pitch_rad).max() < 1e-3


@pytest.mark.parametrize(
    "lat, lon, azimuth",
    [(0.0, 179.999, 90.0), (10.0, -179.999, 270.0), (89.99, 20.0, 0.0), (-89.995, 0.0, 180.1)],
    ids=["antimeridian east", "antimeridian west", "over the pole", "past the south pole"],
)
def test_seams_leave_no_trace(lat, lon, azimuth):
    """A straight flight sampled at 1 Hz across a seam stays on its geodesic, at its speed."""
    points = [Geodesic.WGS84.Direct(lat, lon, azimuth, 100.0 * t) for t in range(41)]
    sampled = SampledTrajectory(
        "s", range(41), [p["lat2"] for p in points], [p["lon2"] for p in points], [0.0] * 41
    )
    query = np.arange(0, 40, 0.25)
    got = sampled.at(query)
    truth = [Geodesic.WGS84.Direct(lat, lon, azimuth, 100.0 * t) for t in query]
    error = line_of_sight(
        [p["lat2"] for p in truth], [p["lon2"] for p in truth], 0.0, got.lat_deg, got.lon_deg, 0.0
    )[2]
    assert error.max() < 1e-5
    off_pole = 90 - np.abs(got.lat_deg) > 1e-6
    azimuths = np.radians([p["azi2"] for p in truth])
    assert angle_between(got.yaw_rad, azimuths)[off_pole].max() < 2e-3
    assert np.abs(got.roll_rad).max() < 1e-3


def test_velocity_that_contradicts_the_path_is_ignored():
    time = np.arange(20.0)
    lat = 45 + time * 60 / 111132.0
    wrong = SampledTrajectory(
        "w", time, lat, 0 * time, 0 * time, velocity_enu_mps=(0 * time, 0 * time + 117, 0 * time)
    )
    assert wrong.velocity_was_ignored
    assert wrong.velocity_enu_mps is None


def test_given_attitude_is_kept():
    time = np.arange(3.0)
    s = SampledTrajectory(
        "a", time, [1, 2, 3], [0, 0, 0], [0, 0, 0], yaw_rad=[6.2, 0.1, 0.2], roll_rad=[0, 0.2, 0]
    )
    middle = s.at(0.5)
    half_way = (6.2 + 0.1 + 2 * np.pi) / 2 % (2 * np.pi)
    assert angle_between(middle.yaw_rad, half_way) < 1e-12
    assert middle.roll_rad == pytest.approx(0.1)


@pytest.mark.parametrize(
    "change, message",
    [
        (
            {"time_s": [0, 1, 1]},
            "time_s is 1.0 at sample 2, after 1.0: times must strictly increase",
        ),
        ({"time_s": [0, 2, 1]}, "must strictly increase"),
        ({"lat_deg": [0, 91, 0]}, r"lat_deg is 91.0 \(sample 1\): it must lie in \[-90, 90\]"),
        ({"alt_m": [0, np.nan, 0]}, "alt_m is nan"),
        ({"lon_deg": [0, 1]}, "lon_deg has 2 samples: time_s has 3"),
        ({"time_s": []}, "at least one sample"),
    ],
)
def test_bad_samples_are_named(change, message):
    good = {"time_s": [0, 1, 2], "lat_deg": [0, 0, 0], "lon_deg": [0, 0, 0], "alt_m": [0, 0, 0]}
    with pytest.raises(ValueError, match=message):
        SampledTrajectory("x", **(good | change))


@pytest.mark.parametrize(
    ("east_deg", "up_m", "said"),
    [
        (0.0005, 0.0, None),
        (0.02, 0.0, "b: its positions imply 1,374 m/s; "),
        (0.0005, 300.0, "b: it climbs or sinks at 300 m/s; "),
        (0.0005, 199.0, None),
        (0.0005, 1201.0, "b: its positions imply 1,201 m/s; "),
    ],
)
def test_flights_that_no_aircraft_flies_are_said_with_their_speed(east_deg, up_m, said):
    """A thousandth of a degree of the parallel of 52.01 degrees is 68.7 m at that height."""
    seconds = np.arange(5.0)
    craft = SimpleNamespace(
        name="b", lat_deg=np.full(5, 52.01), lon_deg=4.0 + east_deg * seconds,
        alt_m=1200.0 + up_m * seconds, sample_times_s=seconds, velocity_was_ignored=False,
    )  # fmt: skip
    found = implausible_motion_sentences([craft])
    assert len(found) == (said is not None) and (said is None or found[0].startswith(said))
