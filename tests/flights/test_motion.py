"""Flights from commands: closed forms for straight flight, climbs and turns, and the limits."""

import numpy as np
import pytest

from components.flights.geodesic_motion import _distance_series, _longitude_series
from components.flights.leg_motion import position_and_yaw_held
from components.flights.point_mass import FT_S_PER_KT, cumulative_sums, fly_euler, fly_point_mass


def commands(seconds: int, a: float, climb: float, turn_deg: float, tracks: int = 1):
    shape = seconds + 1, tracks
    return np.full(shape, a), np.full(shape, climb), np.radians(np.full(shape, turn_deg))


def test_a_knot_is_what_the_format_says() -> None:
    assert abs(FT_S_PER_KT - 1.68781) < 5e-6


def test_straight_and_level_is_exact_in_both() -> None:
    start = np.array([1000.0, 3000.0]), np.array([100.0, 180.0])
    for fly in (fly_euler, fly_point_mass):
        flown = fly(*start, *commands(50, 0.0, 0.0, 0.0, 2))
        assert flown.north_ft[-1] == pytest.approx([5000.0, 9000.0])
        assert flown.up_ft[-1] == pytest.approx([1000.0, 3000.0])
        assert np.abs(flown.east_ft).max() == 0.0


def test_euler_takes_the_old_values_on_the_right() -> None:
    a, climb, turn = (np.array([[row] for row in rows], dtype=float) for rows in (
        [2, 2, 0, 0], [10, -5, 0, 0], np.radians([90, 0, 0, 0])
    ))  # fmt: skip
    flown = fly_euler(np.array([500.0]), np.array([100.0]), a, climb, turn)
    assert flown.speed_ft_s[:, 0].tolist() == [100, 102, 104, 104]
    assert flown.up_ft[:, 0].tolist() == [500, 510, 505, 505]
    assert flown.north_ft[:, 0] == pytest.approx([0, 100, 100, 100])
    assert flown.east_ft[:, 0] == pytest.approx([0, 0, 102, 206])


def test_a_steady_turn_is_a_circle_of_its_radius() -> None:
    flown = fly_point_mass(np.array([2000.0]), np.array([200.0]), *commands(120, 0.0, 0.0, 3.0))
    radius = 200.0 / np.radians(3.0)
    assert np.degrees(flown.heading_rad[-1, 0]) == pytest.approx(360.0, abs=2.0)
    assert np.ptp(flown.east_ft) == pytest.approx(2 * radius, rel=0.02)
    assert np.ptp(flown.up_ft) < 20.0
    bank = np.arctan(200.0 * np.radians(3.0) / 32.2)
    assert flown.bank_rad[-1, 0] == pytest.approx(bank, rel=0.02)


def test_a_climb_is_reached_and_held() -> None:
    a, climb, turn = commands(60, 0.0, 25.0, 0.0)
    flown = fly_point_mass(np.array([2000.0]), np.array([150.0]), a, climb, turn)
    assert flown.up_ft[-1, 0] == pytest.approx(2000 + 60 * 25, rel=1e-3)
    climb[:] = 0.0
    climb[5:] = 40.0
    flown = fly_point_mass(np.array([2000.0]), np.array([150.0]), a, climb, turn)
    assert flown.climb_ft_s[-1, 0] == pytest.approx(40.0, rel=1e-3)
    pitching = np.diff(flown.pitch_rad[:, 0]) / 0.1
    assert np.degrees(np.abs(pitching).max()) == pytest.approx(3.0, abs=1e-6)


def test_limits_are_reached_on_both_sides_and_never_passed() -> None:
    """Two tracks, commanded as much to either side: rates of the first step, then the limits."""
    a, climb, turn = commands(20, 0.0, 0.0, 0.0, 2)
    start = np.full(2, 3000.0), np.full(2, 300.0)
    side = np.array([1.0, -1.0])
    turn[1:] = 3.0 * side
    flown = fly_point_mass(*start, a, climb, turn)
    assert np.diff(flown.bank_rad, axis=0)[10] == pytest.approx(0.0524 * side)
    assert np.degrees(np.abs(flown.bank_rad)).max(axis=0) == pytest.approx([75.0, 75.0])
    assert np.sign(flown.heading_rad[-1]).tolist() == side.tolist()
    flown = fly_point_mass(*start, a, climb + 200.0 * side, turn * 0.0)
    assert np.degrees(flown.pitch_rad[0]) == pytest.approx(np.degrees(np.arcsin(side * 2 / 3)))
    climb[1:] = 200.0 * side
    flown = fly_point_mass(*start, a, climb, turn * 0.0)
    assert np.degrees(np.diff(flown.pitch_rad, axis=0)[10]) == pytest.approx(0.3 * side)
    flown = fly_point_mass(*start, a + 100.0 * side, climb * 0.0, turn * 0.0)
    assert flown.speed_ft_s[-1].tolist() == [1116.0, 1.7]
    # What is commanded at time 0 is limited there too.
    flown = fly_point_mass(*start, a, climb * 0.0 + 400.0 * side, turn * 0.0 + 3.0 * side)
    assert np.sin(flown.pitch_rad[0]) == pytest.approx(0.999 * side)
    assert np.degrees(flown.bank_rad[0]) == pytest.approx(75.0 * side)


def test_a_coordinated_turn_has_its_bank_and_keeps_its_height() -> None:
    """tan bank = v psi' / g, with g = 32.2 ft/s^2, at the start and after a minute."""
    for rate_deg in (3.0, -2.0):
        flown = fly_point_mass(
            np.array([2e3]), np.array([250.0]), *commands(60, 0.0, 0.0, rate_deg)
        )
        bank = np.arctan(250.0 * np.radians(rate_deg) / 32.2)
        assert flown.bank_rad[[0, -1], 0] == pytest.approx([bank, bank], abs=2e-4)
        assert np.diff(flown.heading_rad[:, 0])[-1] == pytest.approx(
            np.radians(rate_deg) / 10, rel=1e-3
        )
        euler = fly_euler(np.array([2e3]), np.array([250.0]), *commands(60, 0.0, 20.0, rate_deg))
        assert euler.bank_rad[5, 0] == pytest.approx(bank)
        assert np.sin(euler.pitch_rad[5, 0]) == pytest.approx(20.0 / 250.0)


def test_rates_are_those_of_a_coordinated_body_in_any_attitude() -> None:
    """From the recorded angles back to body rates: r is gravity's, p and q keep their limits."""
    random = np.random.default_rng(4)
    climb = np.repeat(random.normal(0.0, 30.0, (5, 40)), 5, axis=0)
    turn = np.repeat(random.normal(0.0, 0.06, (5, 40)), 5, axis=0)
    own = np.radians(217.0)
    flown = fly_point_mass(np.full(40, 5e3), np.full(40, 220.0), climb * 0.0, climb, turn, own)
    v, theta, phi, psi = (
        x[:-1] for x in (flown.speed_ft_s, flown.pitch_rad, flown.bank_rad, flown.heading_rad)
    )
    pitching, rolling, turning = (
        np.diff(x, axis=0) / 0.1 for x in (flown.pitch_rad, flown.bank_rad, flown.heading_rad)
    )
    r = turning * np.cos(theta) * np.cos(phi) - pitching * np.sin(phi)
    q = pitching * np.cos(phi) + turning * np.cos(theta) * np.sin(phi)
    p = rolling - turning * np.sin(theta)
    assert r == pytest.approx(32.2 * np.sin(phi) * np.cos(theta) / v, abs=1e-9)
    assert np.degrees(np.abs(q)).max() == pytest.approx(3.0)
    assert np.abs(p).max() == pytest.approx(0.524)
    assert psi[0] == pytest.approx(own)
    for place, way in ((flown.north_ft, np.cos(psi)), (flown.east_ft, np.sin(psi))):
        assert np.diff(place, axis=0) == pytest.approx(0.1 * v * np.cos(theta) * way)
    euler = fly_euler(np.full(40, 5e3), np.full(40, 220.0), climb * 0.0, climb, turn, own)
    assert euler.north_ft[1] == pytest.approx(220.0 * np.cos(own))
    assert euler.east_ft[1] == pytest.approx(220.0 * np.sin(own))


@pytest.mark.parametrize("count", [1, 3, 5000])
def test_sums_begin_at_the_start_and_take_each_rate_once(count):
    start = np.arange(count) * 10.0
    rates = np.stack([np.full(count, rate) for rate in (1.0, -2.0, 4.0, 8.0)])
    expected = [start, start + 1.0, start - 1.0, start + 3.0]
    np.testing.assert_array_equal(cumulative_sums(start, rates), expected)
    np.testing.assert_array_equal(cumulative_sums(start, rates[:2]), expected[:2])
    np.testing.assert_array_equal(cumulative_sums(start, rates[:1]), expected[:1])


@pytest.mark.parametrize(("eps", "n"), [(0.03, 0.02), (0.02, -0.03), (-0.025, 0.03)])
def test_the_series_of_a_geodesic_are_those_of_its_integrals(eps, n):
    """Karney (2013), eqs 7 and 8: their means and harmonics, by the trapezoidal rule."""
    sigma = np.pi * np.arange(64) / 64
    stretch = np.sqrt(1.0 + 4.0 * eps / (1.0 - eps) ** 2 * np.sin(sigma) ** 2)
    flattening = 2.0 * n / (1.0 + n)
    longitude = (2.0 - flattening) / (1.0 + (1.0 - flattening) * stretch)

    def harmonics(rate, count):
        waves = np.cos(2.0 * np.outer(np.arange(1, count + 1), sigma))
        return (rate / rate.mean() * waves).mean(axis=1) / np.arange(1, count + 1)

    a1, c1, inverse = _distance_series(eps)
    assert a1 == pytest.approx(stretch.mean(), abs=1e-9)
    np.testing.assert_allclose(c1, harmonics(stretch, len(c1)), rtol=1e-3)
    np.testing.assert_allclose(c1[:4], harmonics(stretch, 4), rtol=2e-6)
    along = sigma + np.sin(2.0 * np.outer(sigma, np.arange(1, len(c1) + 1))) @ np.array(c1)
    back = along + np.sin(2.0 * np.outer(along, np.arange(1, len(c1) + 1))) @ np.array(inverse)
    np.testing.assert_allclose(back, sigma, atol=3e-9)
    a3, c3 = _longitude_series(eps, n)
    assert a3 == pytest.approx(longitude.mean(), abs=3e-9)
    np.testing.assert_allclose(c3, harmonics(longitude, len(c3)), atol=3e-9)


def test_who_stays_in_one_place_climbs_and_turns() -> None:
    """Latitude, longitude, altitude and climb, yaw and its rate; a yaw is from 0 to a turn."""
    table = np.array([[0.8, 0.8], [0.1, 0.2], [100.0, 100.0], [2.0, -3.0], [6.0, 1.0], [0.5, -0.5]])
    lat, lon, alt, yaw = position_and_yaw_held(table, np.array([10.0, 4.0]))
    assert (lat.tolist(), lon.tolist(), alt.tolist()) == ([0.8, 0.8], [0.1, 0.2], [120.0, 88.0])
    np.testing.assert_allclose(yaw, [11.0 - 2.0 * np.pi, 2.0 * np.pi - 1.0], rtol=1e-15)
