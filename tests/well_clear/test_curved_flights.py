"""Times at which curved flights come into a cylinder, against roots of their own equations."""

import math

import numpy as np
import pytest
from scipy.optimize import brentq

from components.well_clear.separation import FINEST_S, first_time_inside_cylinder_s

D_M, Z_M = 610.0, 76.0


def weaving(phase, tilt):
    """Distances that go up and down, and a bound on how fast."""

    def apart(time_s):
        across = np.abs(900.0 + 700.0 * np.sin(0.11 * time_s + phase) + tilt * time_s)
        high = np.abs(120.0 * np.sin(0.07 * time_s - 2.0 * phase))
        return across, high

    return apart, 700.0 * 0.11 + abs(tilt) + 120.0 * 0.07


def first_of(apart, begin_s, end_s, fastest, across_m=D_M):
    """The one found for a single pair."""
    between = np.array([begin_s]), np.array([end_s])
    speeds = np.array([fastest])
    return first_time_inside_cylinder_s(lambda _, t: apart(t), between, speeds, across_m, Z_M)[0]


def root(apart, begin_s, end_s):
    """By a change of sign on a grid of 5 ms, found to 1e-12; NaN without one."""

    def margin(t):
        across, high = apart(np.array([t]))
        return max(float(across[0]) - D_M, float(high[0]) - Z_M)

    times = np.append(np.arange(begin_s, end_s, 0.005), end_s)
    across, high = apart(times)
    inside = np.flatnonzero(np.maximum(across - D_M, high - Z_M) < 0.0)
    if not len(inside):
        return math.nan
    first = inside[0]
    return brentq(margin, times[first - 1], times[first], xtol=1e-12) if first else begin_s


def test_begins_of_many_pairs_are_within_the_bound():
    """More pairs than are looked at together; some never come inside, some have no time."""
    rng = np.random.default_rng(4)
    each = [weaving(*some) for some in rng.uniform([0, -6], [3, 9], (140, 2))]
    begin_s, end_s = rng.uniform(0.0, 40.0, 140), rng.uniform(42.0, 150.0, 140)
    end_s[7] = begin_s[7] - 0.1

    def apart(pair, time_s):
        found = np.empty((2, len(pair)))
        for number in set(pair.tolist()):
            mine = pair == number
            found[:, mine] = each[number][0](time_s[mine])
        return found

    fastest = np.array([speed for _, speed in each])
    first = first_time_inside_cylinder_s(apart, (begin_s, end_s), fastest, D_M, Z_M)
    assert np.isnan(first[7])
    wanted = np.array([
        root(alone, b, e) if e > b else math.nan
        for (alone, _), b, e in zip(each, begin_s.tolist(), end_s.tolist(), strict=True)
    ])  # fmt: skip
    assert 5 < np.isnan(wanted).sum() < 100
    assert (np.isnan(wanted) == np.isnan(first)).all()
    assert np.nanmax(np.abs(first - wanted)) <= FINEST_S
    (alone, speed) = each[139]
    assert first[139] == first_of(alone, begin_s[139], end_s[139], speed)
    # As many as metrics have of two thousand rings of nine; only the last two have any time.
    begin_s = np.append(np.ones(71_999), begin_s[138:])
    end_s = np.append(np.zeros(71_999), end_s[138:])
    many = first_time_inside_cylinder_s(
        lambda pair, time_s: apart(pair - 71_861, time_s), (begin_s, end_s),
        np.full(len(begin_s), fastest.max()), D_M, Z_M,
    )  # fmt: skip
    assert np.isnan(many[:71_999]).all()
    np.testing.assert_allclose(many[71_999:], wanted[138:], rtol=0, atol=FINEST_S)


def test_a_pass_between_two_samples_is_found():
    """Inside for 40 ms, between the tenths of a second: a cylinder that is crossed at its rim."""
    speed, miss = 200.0, math.sqrt(D_M**2 - (200.0 * 0.02) ** 2)

    def apart(time_s):
        return np.hypot(miss, speed * (time_s - 33.35)), np.full(len(time_s), 10.0)

    times = np.arange(0.0, 100.0, 0.1)
    assert (apart(times)[0] >= D_M).all()
    assert first_of(apart, 0.0, 100.0, speed) == pytest.approx(33.33, abs=FINEST_S)


def test_who_stays_on_the_edge_is_outside_and_ends():
    calls = []

    def apart(time_s):
        calls.append(len(time_s))
        return np.full(len(time_s), D_M), np.zeros(len(time_s))

    assert math.isnan(first_of(apart, 0.0, 3600.0, 150.0))
    assert sum(calls) < 500_000


def test_both_sizes_count():
    def apart(time_s):
        return np.full(len(time_s), 100.0), np.abs(100.0 - time_s)

    assert first_of(apart, 0.0, 300.0, 1.0) == pytest.approx(24.0, abs=FINEST_S)
    assert math.isnan(first_of(apart, 0.0, 300.0, 1.0, 99.0))
