"""Rounding to a sensor's grid against exact fractions."""

import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from components.sensor.grid import Grid, SensorGrid

sizes = st.floats(-1e9, 1e9)
steps = st.floats(1e-6, 1e6)


def rounded(values, step, **limits):
    """Values on a grid; of one value, one."""
    result = Grid(step, **limits).round(np.atleast_1d(np.asarray(values, dtype=np.float64)))
    return result if np.ndim(values) else result[0]


def exact(value, step):
    """Round with unlimited precision (Python rounds fractions half to even)."""
    return float(round(Fraction(value) / Fraction(step)) * Fraction(step))


@settings(derandomize=True, deadline=None, max_examples=100)
@given(sizes, steps)
def test_agrees_with_exact_fractions(value, step):
    assert rounded(value, step) == exact(value, step)


@settings(derandomize=True, deadline=None, max_examples=100)
@given(st.integers(-(10**6), 10**6), steps, st.integers(-2, 2))
def test_cell_edges_and_their_neighbours_are_exact(cell, step, places):
    edge = (cell + 0.5) * step
    for _ in range(abs(places)):
        edge = math.nextafter(edge, math.inf if places > 0 else -math.inf)
    assert rounded(edge, step) == exact(edge, step)
    assert rounded(-edge, step) == -rounded(edge, step)


def test_naive_division_gets_edges_wrong_and_we_do_not():
    # Values a last place below an edge whose quotient rounds onto the edge.
    step = 0.1
    cells = np.arange(1, 20001, 2)
    below = np.nextafter((cells + 0.5) * step, 0.0)
    reference = np.array([exact(value, step) for value in below.tolist()])
    assert np.any(np.rint(below / step) * step != reference)
    np.testing.assert_array_equal(rounded(below, step), reference)


@pytest.mark.parametrize(
    ("value", "step", "expected"),
    [
        (0.5, 1.0, 0.0),
        (1.5, 1.0, 2.0),
        (2.5, 1.0, 2.0),
        (-0.5, 1.0, 0.0),
        (-2.5, 1.0, -2.0),
        (0.125, 0.25, 0.0),
        (0.375, 0.25, 0.5),
        (0.05, 0.1, 0.0),
        (7.3, 0.0, 7.3),
        (1e300, 1e-300, 1e300),
        (1e-300, 1e300, 0.0),
        (1.7e308, 1e308, 1.7e308),
        (5e-324, 5e-324, 5e-324),
    ],
)
def test_ties_go_to_even_and_extremes_pass(value, step, expected):
    result = rounded(value, step)
    assert result == expected and math.copysign(1.0, result) == math.copysign(1.0, expected + 0.0)


@settings(derandomize=True, deadline=None, max_examples=100)
@given(st.floats(-10.0, 10.0), st.floats(1e-3, 2.0), st.floats(0.0, 12.0), st.floats(0.0, 12.0))
def test_stays_inside_the_field_of_view(value, step, low, high):
    result = rounded(value, step, limit_low=-low, limit_high=high)
    assert -low <= result <= high
    free = rounded(value, step)
    if -low <= free <= high:
        assert result == free
    else:
        outside = result + step if free > high else result - step
        slack = 1e-12 * max(low, high, step)
        assert not (-low + slack <= outside <= high - slack)


@pytest.mark.parametrize("degrees", [110, 50, 30, 7, 90, 180])
def test_limit_that_is_a_grid_point_counts_as_one(degrees):
    # The field of view's edge and so many times the step may differ in the last bit.
    step, limit = math.radians(1.0), math.radians(degrees)
    for value in (limit, math.nextafter(limit, 0.0), limit - 0.4 * step, limit + 0.3):
        result = rounded(value, step, limit_low=-limit, limit_high=limit)
        assert result <= limit and result == pytest.approx(limit, rel=1e-15)
        assert rounded(-value, step, limit_low=-limit, limit_high=limit) == -result


def test_limits_that_are_no_grid_points():
    # 10 degree cells in a field of view of 27 degrees: 27 would round to 30, outside.
    values = [27.0, 25.1, -26.0, 14.0, 0.2]
    result = rounded(values, 10.0, limit_low=-27.0, limit_high=27.0)
    np.testing.assert_array_equal(result, [20.0, 20.0, -20.0, 10.0, 0.0])
    result = rounded([5.0, 29.0, 95.0], 10.0, limit_low=12.0, limit_high=93.0)
    np.testing.assert_array_equal(result, [20.0, 30.0, 90.0])
    result = rounded([-5.0, -29.0, -95.0], 10.0, limit_low=-93.0, limit_high=-12.0)
    np.testing.assert_array_equal(result, [-20.0, -30.0, -90.0])


@pytest.mark.parametrize(
    ("call", "says"),
    [
        ({"step": -1.0}, "step is -1.0"),
        ({"step": np.inf}, "step is inf"),
        ({"step": 1.0, "limit_low": 2.0, "limit_high": 1.0}, "limit_low is 2.0"),
        ({"step": 1.0, "limit_high": np.nan}, "limit_high is nan"),
        ({"step": 10.0, "limit_low": 12.0, "limit_high": 18.0}, "step is 10.0"),
    ],
)
def test_bad_input_is_named(call, says):
    with pytest.raises(ValueError, match=says):
        Grid(**call)


GRID_STEPS = st.sampled_from([0.0, math.radians(1.0), 6.25e-4, 76.2, 0.1, 1e-9])
GRID_VALUES = st.lists(
    st.floats(-1e300, 1e300) | st.integers(-9, 9).map(float) | st.floats(-4, 4), max_size=9
)


@settings(derandomize=True, max_examples=200)
@given(values=GRID_VALUES, step=GRID_STEPS, half=st.booleans())
def test_many_values_are_rounded_as_each_alone_and_as_fractions_say(values, step, half):
    array = np.array(values, dtype=np.float64)
    if half and step:
        array = np.concatenate([array, (np.arange(-6, 6) + 0.5) * step])
    counted = [step and abs(v) < min(2.0**50 * step, 1e300) for v in array.tolist()]
    values = [exact(v, step) if c else v for v, c in zip(array.tolist(), counted, strict=True)]
    assert Grid(step).round(array).tolist() == values
    limits = {"limit_low": -1.9198621771937625, "limit_high": 1.9198621771937625}
    if step < 1.0:
        got = Grid(step, **limits).round(array)
        assert got.tolist() == [rounded(value, step, **limits) for value in array.tolist()]
        assert not np.signbit(got[got == 0.0]).any()


@pytest.mark.parametrize("step", [0.0174532925199433, 0.1, 1.0 / 3.0, 2.0**-7, 76.2])
def test_at_and_beside_half_steps_a_grid_rounds_as_remainders_say(step: float) -> None:
    random = np.random.default_rng(7)
    half = np.concatenate([random.integers(0, most, 2000) for most in (400, 2**40)]) * 0.5 * step
    values = np.concatenate([half, np.nextafter(half, 0.0), np.nextafter(half, np.inf)])
    some = values[::97].tolist()
    assert Grid(step).round(values[::97]).tolist() == [exact(value, step) for value in some]


def test_all_round_straight_astern_is_one_direction_from_either_side():
    steps = {"azimuth": math.radians(2.0), "elevation": math.radians(1.0)}
    grid = SensorGrid((-math.pi, math.pi), (-1.0, 1.0), steps)
    off = np.radians([179.4, -179.4, 10.9])
    azimuth, elevation, _ = grid.round(off, np.radians([0.4, 0.6, -7.6]), np.full(3, np.nan))
    assert azimuth[0] == azimuth[1] and abs(azimuth[0]) == pytest.approx(math.pi, abs=1e-15)
    assert math.degrees(azimuth[2]) == pytest.approx(10.0, abs=1e-12)
    np.testing.assert_allclose(np.degrees(elevation), [0.0, 1.0, -8.0], atol=1e-12)
