"""Scripted flights: geodesics, circles, waypoints, and what happens at the end."""

import math

import numpy as np
import pymap3d
import pytest
from geographiclib.geodesic import Geodesic
from hypothesis import given, settings
from hypothesis import strategies as st

from components.flights.attitude import Wind
from components.flights.legs import Climb, Stationary, Straight, Turn, Waypoint, Waypoints
from components.flights.scripted_flights import ScriptedTrajectory
from components.geometry.ellipsoid import line_of_sight
from components.traffic.scripted import Intruder, _intruder_fleet

WGS84 = Geodesic.WGS84
START = {"lat_deg": 45.0, "lon_deg": -75.0, "alt_m": 1000.0}


def separation(a, b):
    return line_of_sight(a.lat_deg, a.lon_deg, a.alt_m, b.lat_deg, b.lon_deg, b.alt_m)[2]


def speeds(trajectory, times):
    """Three-dimensional speed from consecutive positions."""
    s = trajectory.at(times)
    p = (s.lat_deg, s.lon_deg, s.alt_m)
    chord = line_of_sight(*(c[:-1] for c in p), *(c[1:] for c in p))[2]
    return chord / np.diff(times)


STARTS = [-90.0, -89.9999999, -60.0, 0.0, 1e-7, 45.0, 89.9999, 90.0]


@pytest.mark.parametrize("lat", STARTS)
@pytest.mark.parametrize("azimuth", [0.0, 1e-8, 30.0, 90.0, 135.0, 180.0, 359.0])
def test_straight_leg_is_the_geodesic(lat, azimuth):
    flight = ScriptedTrajectory(
        "g", lat_deg=lat, lon_deg=179.9, alt_m=0, heading_deg=azimuth, speed_mps=100.0
    )
    time = np.array([0.0, 1e-5, 1.0, 1e3, 1e5])
    s = flight.at(time)
    for i, t in enumerate(time):
        truth = WGS84.Direct(lat, 179.9, azimuth, 100.0 * t)
        assert (
            line_of_sight(truth["lat2"], truth["lon2"], 0, s.lat_deg[i], s.lon_deg[i], 0)[2] < 2e-8
        )
        colatitude = 90 - abs(truth["lat2"])
        if colatitude > 1e-6:
            error = (np.degrees(s.yaw_rad[i]) - truth["azi2"] + 180) % 360 - 180
            assert abs(error) * colatitude < 1e-10
    assert (s.alt_m == 0).all()


@settings(derandomize=True, deadline=None, max_examples=60)
@given(
    st.floats(-89, 89),
    st.floats(-180, 180),
    st.floats(0, 360),
    st.floats(1, 300),
    st.floats(-300, 12000),
)
def test_speed_is_that_at_flight_altitude(lat, lon, azimuth, speed, alt):
    flight = ScriptedTrajectory(
        "s", lat_deg=lat, lon_deg=lon, alt_m=alt, heading_deg=azimuth, speed_mps=speed
    )
    # The path's radius is taken once: over 600 km at 12 km that is 2.3e-6 (worst of 4,000).
    assert speeds(flight, np.arange(0, 2000, 100.0)) == pytest.approx(speed, rel=3e-6)


@pytest.mark.parametrize("rate", [3.0, -3.0, 0.5])
@pytest.mark.parametrize("lat", [0.0, 45.0, -80.0])
def test_turn_is_a_closed_circle_at_constant_speed(lat, rate):
    flight = ScriptedTrajectory(
        "t", lat_deg=lat, lon_deg=180.0, alt_m=1500, speed_mps=60, legs=[Turn(rate_deg_s=rate)]
    )
    period = 360 / abs(rate)
    time = np.linspace(0, period, 721)
    s = flight.at(time)
    assert separation(flight.at(0.0), flight.at(period)) < 1e-7
    chord = 2 * 60 / np.radians(abs(rate)) * np.sin(np.radians(abs(rate)) * time[1] / 2)
    assert speeds(flight, time) * time[1] == pytest.approx(chord, rel=1e-5)
    # The opposite point lies a diameter away, abeam.
    azimuth, _, across = line_of_sight(
        s.lat_deg[0], s.lon_deg[0], 1500, s.lat_deg[360], s.lon_deg[360], 1500
    )
    assert across == pytest.approx(2 * 60 / np.radians(abs(rate)), rel=1e-5)
    assert np.degrees(azimuth) == pytest.approx(90 if rate > 0 else 270, abs=2e-2)
    bank = np.arctan(60 * np.radians(rate) / 9.80665)
    assert (s.roll_rad == pytest.approx(bank, rel=1e-12)) and (s.pitch_rad == 0).all()
    # True track after a quarter: the heading turned so far and the convergence of the meridians.
    convergence = (s.lon_deg[180] - s.lon_deg[0] + 180) % 360 - 180
    convergence *= np.sin(np.radians(s.lat_deg[[0, 180]].mean()))
    turned = (np.degrees(s.yaw_rad[180]) - rate * time[180] - convergence + 180) % 360 - 180
    assert abs(turned) < 2e-3


def test_turn_by_radius_and_angle():
    by_rate = ScriptedTrajectory(
        "a", **START, speed_mps=50, legs=[Turn(rate_deg_s=-2.5, duration_s=36), Straight()]
    )
    by_radius = ScriptedTrajectory(
        "b",
        **START,
        speed_mps=50,
        legs=[Turn(radius_m=-50 / np.radians(2.5), angle_deg=90), Straight()],
    )
    time = np.arange(0, 100, 1.0)
    assert separation(by_rate.at(time), by_radius.at(time)).max() < 1e-6
    assert np.degrees(by_rate.at(60.0).yaw_rad) == pytest.approx(270, abs=0.05)


def test_legs_join_without_a_gap_and_the_last_is_held():
    flight = ScriptedTrajectory(
        "m",
        **START,
        heading_deg=90,
        speed_mps=60,
        legs=[
            Straight(duration_s=30.0),
            Turn(rate_deg_s=3, angle_deg=90),
            Climb(climb_mps=5, to_alt_m=1500),
            Stationary(duration_s=10.0),
            Turn(rate_deg_s=-3),
        ],
    )
    starts = [segment.start_s for segment in flight.segments]
    assert starts == pytest.approx([0, 30, 60, 160, 170])
    for t in starts[1:]:
        before, after = flight.at(np.nextafter(t, 0)), flight.at(t)
        assert separation(before, after) < 1e-7
    fastest = speeds(flight, np.linspace(0, 400, 4001)).max()
    assert fastest == pytest.approx(np.hypot(60, 5), rel=1e-5)
    assert flight.at(165.0).alt_m == pytest.approx(1500, abs=1e-9)
    # Held: 100 turns later it is still on the same circle.
    assert separation(flight.at(200.0), flight.at(200.0 + 100 * 120.0)) < 1e-6


def test_climb_to_altitude_as_last_leg_levels_off():
    flight = ScriptedTrajectory(
        "c", **START, speed_mps=60, legs=[Climb(climb_mps=-4, to_alt_m=600)]
    )
    assert flight.at(100.0).alt_m == pytest.approx(600)
    assert flight.at(3600.0).alt_m == pytest.approx(600)
    assert flight.at(50.0).pitch_rad == pytest.approx(np.arctan2(-4, 60))
    assert flight.at(200.0).pitch_rad == 0


def test_stationary_stays_for_ever_and_keeps_its_heading():
    still = ScriptedTrajectory("s", **START, heading_deg=217, legs=[Stationary()])
    s = still.at(np.array([0.0, 1.0, 36000.0]))
    assert (s.lat_deg == 45).all() and (s.lon_deg == -75).all() and (s.alt_m == 1000).all()
    assert s.yaw_rad == pytest.approx(np.radians(217))


@settings(derandomize=True, deadline=None, max_examples=60)
@given(
    st.lists(
        # As in scenes, no number is smaller than 1e-30 and not 0.
        st.tuples(
            st.floats(-60, 60).map(lambda lat: round(lat, 20)),
            st.floats(-180, 180).map(lambda lon: round(lon, 20)),
            st.floats(0, 10000).map(lambda alt: round(alt, 20)),
            st.floats(5, 300),
        ),
        min_size=1,
        max_size=5,
        # Two waypoints in one place are refused when one is above the other (tested elsewhere).
        unique_by=lambda point: (round(point[0], 3), round(point[1], 3) % 360.0),
    )
)
def test_waypoints_are_met_in_order_at_the_asked_speed(points):
    flight = ScriptedTrajectory(
        "w",
        lat_deg=70.0,
        lon_deg=0.0,
        alt_m=0.0,
        legs=[
            Waypoints(
                points=[
                    Waypoint(lat_deg=a, lon_deg=o, alt_m=h, speed_mps=v) for a, o, h, v in points
                ]
            )
        ],
    )
    arrivals = [segment.start_s for segment in flight.segments[1:]]
    assert (np.diff(arrivals) > 0).all()
    assert len(arrivals) == len(points)
    s = flight.at(np.array(arrivals))
    for i, (lat, lon, alt, _) in enumerate(points):
        # Nearly antipodal legs amplify the azimuth's last bit.
        assert line_of_sight(lat, lon, alt, s.lat_deg[i], s.lon_deg[i], s.alt_m[i])[2] < 1e-4
    assert all(np.isfinite(c).all() for c in flight.at(np.linspace(0, 1e6, 50)).arrays())
    assert flight.at(1e7).alt_m == pytest.approx(points[-1][2])


def test_waypoints_as_offsets_from_the_ownships_start():
    own = (45.0, -75.0, 1000.0)
    flight = ScriptedTrajectory.from_offset(
        "o",
        east_m=3000,
        north_m=4000,
        up_m=0,
        reference=own,
        speed_mps=50,
        legs=[Waypoints(points=[Waypoint(east_m=0, north_m=0, up_m=100)])],
    )
    start = flight.at(0.0)
    assert line_of_sight(*own, start.lat_deg, start.lon_deg, start.alt_m)[2] == pytest.approx(
        5000, abs=1e-8
    )
    end = flight.at(flight.segments[1].start_s)
    _, elevation, slant = line_of_sight(*own, end.lat_deg, end.lon_deg, end.alt_m)
    assert (slant, elevation) == pytest.approx((100, np.pi / 2), abs=1e-4)


def test_present_only_between_start_and_end():
    flight = ScriptedTrajectory("p", **START, speed_mps=50, start_time_s=10, end_time_s=20)
    times = np.array([-5.0, np.nextafter(10, 0), 10.0, 15.0, 20.0, np.nextafter(20, 30), 1e9])
    s = flight.at(times)
    assert s.present.tolist() == [False, False, True, True, True, False, False]
    assert all(np.isfinite(c).all() for c in s.arrays())
    assert (s.lat_deg[0], s.lat_deg[-1]) == (flight.at(10.0).lat_deg, flight.at(20.0).lat_deg)


@pytest.mark.parametrize("time", [1e15, 1e308, -1e308])
def test_absurd_times_raise_no_warning(time):
    for legs in ((), (Turn(rate_deg_s=3),), (Stationary(),), (Climb(climb_mps=-9),)):
        flight = ScriptedTrajectory("h", **START, speed_mps=300, legs=legs)
        assert all(np.isfinite(c).all() for c in flight.at(time).arrays())


def test_given_attitude_overrides():
    flight = ScriptedTrajectory(
        "a", **START, speed_mps=50, legs=[Turn(rate_deg_s=3)], yaw_deg=-90, pitch_deg=2, roll_deg=-5
    )
    s = flight.at(np.arange(5.0))
    assert np.degrees(s.yaw_rad) == pytest.approx(270)
    assert np.degrees(s.pitch_rad) == pytest.approx(2)
    assert np.degrees(s.roll_rad) == pytest.approx(-5)


@pytest.mark.parametrize(
    "make, message",
    [
        (lambda: ScriptedTrajectory("x", lat_deg=91, lon_deg=0, alt_m=0), "lat_deg is 91"),
        (
            lambda: ScriptedTrajectory("x", **START, speed_mps=-1),
            "speed_mps is -1: it must be 0 or",
        ),
        (lambda: ScriptedTrajectory("x", **START, heading_deg=np.nan), "heading_deg is nan"),
        (lambda: Straight(duration_s=-1.0), "(?s)duration_s.*greater than 0"),
        (lambda: Turn(), "give one of the two"),
        (lambda: Turn(rate_deg_s=0.0), "rate_deg_s is 0.0"),
        (lambda: Climb(duration_s=3.0), "(?s)climb_mps.*required"),
        (lambda: Waypoint(lat_deg=1.0, lon_deg=1.0, up_m=3.0), "lat_deg and lon_deg, or"),
        (lambda: Waypoints(points=[]), "at least 1 item"),
        (
            lambda: ScriptedTrajectory("x", **START, speed_mps=5, legs=[Straight(), Straight()]),
            r"x: legs\[0\] \(straight\): duration_s is None",
        ),
        (
            lambda: ScriptedTrajectory("x", **START, speed_mps=90, legs=[Turn(rate_deg_s=0.001)]),
            "turn radius is .* must not exceed",
        ),
        (
            lambda: ScriptedTrajectory("x", **START, legs=[Climb(climb_mps=-1, to_alt_m=2e3)]),
            "climb_mps is -1: it must lead from 1000 m to 2000 m",
        ),
        (
            lambda: ScriptedTrajectory(
                "x", **START, legs=[Waypoints(points=[Waypoint(lat_deg=1.0, lon_deg=1.0)])]
            ),
            "speed_mps is 0: it must be positive",
        ),
    ],
)
def test_bad_scripts_are_named(make, message):
    with pytest.raises(ValueError, match=message):
        make()


def test_an_intruder_s_waypoints_count_from_the_ownship_s_start():
    """From 2 km east of it to 5 km north of it, at 60 m/s over the ground, whatever the wind."""
    reference = (-41.3, -179.9997, 2400.0)
    legs = [{"kind": "waypoints", "points": [{"east_m": 0.0, "north_m": 5000.0, "up_m": 0.0}]}]
    craft = Intruder(
        name="to", east_m=2000.0, north_m=0.0, up_m=0.0, heading_deg=90.0, speed_mps=60.0, legs=legs
    )
    fleet = _intruder_fleet([craft], reference, Wind.from_direction(10.0, 270.0))
    state = fleet.each(np.array([0]), np.array([30.0]))
    east, north, _ = pymap3d.geodetic2enu(
        state.lat_deg[0], state.lon_deg[0], state.alt_m[0], *reference
    )
    part = 1800.0 / math.hypot(2000.0, 5000.0)
    assert (east, north) == pytest.approx((2000.0 * (1.0 - part), 5000.0 * part), abs=3.0)
