"""Wrapping, exact differences of longitude, and sines in degrees."""

from fractions import Fraction

import mpmath
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from components.geometry.angles import (
    TWO_PI,
    heading_rad_from_deg,
    longitude_difference_deg,
    remainder,
    wrap_by_sines,
    wrap_difference_rad,
    wrap_heading_rad,
    wrap_longitude_deg,
    wrap_pi,
    wrap_two_pi,
)

fast = settings(derandomize=True, deadline=None, max_examples=100)
any_angle = st.floats(-1e6, 1e6) | st.floats(-10, 10) | st.floats(-1e150, 1e150)


@fast
@given(any_angle)
def test_wrap_stays_in_its_interval_and_keeps_the_direction(angle):
    with mpmath.workdps(200):
        exact = mpmath.mpf(angle)
        for wrapped in (wrap_pi(angle), wrap_two_pi(angle)):
            turns = (exact - mpmath.mpf(float(wrapped))) / (2 * mpmath.pi)
            assert abs(turns - mpmath.nint(turns)) < 2e-16
    assert -np.pi < wrap_pi(angle) <= np.pi
    assert 0.0 <= wrap_two_pi(angle) < 2 * np.pi


@fast
@given(st.floats(-np.pi, np.pi, exclude_min=True))
def test_angles_inside_keep_their_bits(angle):
    assert wrap_pi(angle) == angle
    assert wrap_pi([angle, 100.0])[0] == angle
    if angle >= 0:
        assert wrap_two_pi([angle, -1.0])[0] == angle


def test_edges_of_the_intervals():
    assert wrap_pi(np.pi) == np.pi
    assert wrap_pi(-np.pi) == np.pi
    assert wrap_two_pi(2 * np.pi) == 0.0
    assert wrap_two_pi(-1e-17) == 0.0
    below = np.nextafter(2 * np.pi, 0)
    assert wrap_two_pi(below) == below
    assert not np.signbit(wrap_two_pi(-0.0))


@fast
@given(st.floats(-1e4, 1e4), st.floats(-1e4, 1e4))
def test_difference_of_longitudes_is_exact(lon1, lon2):
    difference, error = longitude_difference_deg(lon1, lon2)
    assert -180.0 <= difference < 180.0
    assert abs(error) <= 1.5e-14
    exact = Fraction(lon2) - Fraction(lon1)
    turns = (exact - Fraction(float(difference)) - Fraction(float(error))) / 360
    assert turns.denominator == 1


def test_difference_of_huge_longitudes_is_exact():
    difference, error = longitude_difference_deg([1e20, 7.0], [5.0, -1e150])
    for got, rest, lon1, lon2 in zip(difference, error, [1e20, 7.0], [5.0, -1e150], strict=True):
        turns = (Fraction(lon2) - Fraction(lon1) - Fraction(got) - Fraction(rest)) / 360
        assert turns.denominator == 1
        assert -180.0 <= got < 180.0


@pytest.mark.parametrize("bad", [np.nan, np.inf, [0.0, -np.inf], "north"])
@pytest.mark.parametrize(
    ("function", "name"),
    [(wrap_pi, "angle_rad"), (wrap_two_pi, "angle_rad")],
)
def test_angles_that_are_none_are_refused(function, name, bad):
    with pytest.raises(ValueError, match=f"^{name} is "):
        function(bad)


@pytest.mark.parametrize("function", [wrap_pi, wrap_two_pi])
def test_bits_do_not_depend_on_shape(function):
    angles = np.random.default_rng(0).uniform(-1000, 1000, 3000)
    whole = np.asarray(function(angles))
    grid = np.asarray(function(angles.reshape(60, 50).T))
    assert np.array_equal(whole.reshape(*whole.shape[:-1], 60, 50), np.swapaxes(grid, -1, -2))
    for i in range(0, 3000, 97):
        assert np.array_equal(whole[..., i], np.asarray(function(angles[i])))


few_turns = st.floats(-30.0, 30.0)


@fast
@given(few_turns)
def test_the_cheap_forms_agree_with_the_exact_ones_within_a_few_turns(angle):
    one = np.array([angle, 0.5])
    assert abs(wrap_pi(wrap_difference_rad(one)[0] - wrap_pi(angle))) < 1e-14
    assert abs(wrap_pi(wrap_by_sines(one)[0] - wrap_pi(angle))) < 1e-14
    assert abs(wrap_pi(wrap_heading_rad(one)[0] - wrap_two_pi(angle))) < 1e-14
    assert abs(wrap_pi(remainder(one, TWO_PI)[0] - wrap_two_pi(angle))) < 1e-14
    assert np.abs(wrap_difference_rad(one)).max() <= np.pi
    for inside in (wrap_heading_rad(one), remainder(one, TWO_PI)):
        assert (inside >= 0.0).all()
        assert (inside < TWO_PI).all()


def test_what_rounds_up_to_a_whole_turn_is_none():
    tiny = np.array([-1e-20, 0.0, 1e-20])
    assert remainder(tiny, 360.0).tolist() == [0.0, 0.0, 1e-20]
    assert remainder(tiny, TWO_PI).tolist() == [0.0, 0.0, 1e-20]
    assert wrap_heading_rad(tiny).tolist() == [0.0, 0.0, 1e-20]
    assert heading_rad_from_deg(-143.0) == np.radians(217.0)


@fast
@given(st.integers(-4000, 4000), st.integers(0, 1023))
def test_longitudes_wrap_exactly(whole, parts):
    lon = whole + parts / 1024
    wrapped = wrap_longitude_deg(np.array([lon, 180.0]))
    assert wrapped.tolist() == [(lon + 180.0) % 360.0 - 180.0, -180.0]
