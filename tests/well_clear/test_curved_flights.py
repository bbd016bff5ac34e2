"""Spans inside a cylinder of flights that are curved, against roots of their own equations."""

import math

import numpy as np
import pytest
from scipy.optimize import brentq

from components.well_clear.curved_flights import FINEST_S, cylinder_spans, first_inside_cylinder

D_M, Z_M = 610.0, 76.0


def weaving(phase, tilt, seed=0):
    """Distances that go up and down, and a bound on how fast."""

    def apart(time_s):
        across = np.abs(900.0 + 700.0 * np.sin(0.11 * time_s + phase) + tilt * time_s)
        high = np.abs(120.0 * np.sin(0.07 * time_s - 2.0 * phase))
        return across, high

    return apart, 700.0 * 0.11 + abs(tilt) + 120.0 * 0.07


def roots(apart, end_s):
    """Begins and ends by sign changes on a grid of 5 ms, each found to 1e-12."""

    def margin(t):
        across, high = apart(np.array([t]))
        return max(float(across[0]) - D_M, float(high[0]) - Z_M)

    times = np.linspace(0.0, end_s, 1 + round(end_s / 0.005))
    across, high = apart(times)
    inside = np.maximum(across - D_M, high - Z_M) < 0.0
    edges = [0.0] if inside[0] else []
    for k in np.flatnonzero(inside[1:] != inside[:-1]):
        edges.append(brentq(margin, times[k], times[k + 1], xtol=1e-12))
    edges += [end_s] if inside[-1] else []
    return np.array(edges).reshape(-1, 2)


@pytest.mark.parametrize("phase", [0.0, 0.7, 2.9])
@pytest.mark.parametrize("tilt", [-6.0, 0.0, 4.0])
def test_begins_and_ends_are_within_the_bound(phase, tilt):
    apart, fastest = weaving(phase, tilt)
    wanted = roots(apart, 150.0)
    found = cylinder_spans(apart, (0.0, 150.0), fastest, D_M, Z_M)
    assert len(wanted) >= 1 and found.shape == wanted.shape
    assert np.abs(found - wanted).max() <= FINEST_S


def test_the_first_begin_of_many_pairs_is_that_of_each():
    """More pairs than are looked at together; some never come inside, some have no time."""
    rng = np.random.default_rng(4)
    each = [weaving(*some) for some in rng.uniform([0, -6], [3, 9], (140, 2))]
    begin_s, end_s = rng.uniform(0.0, 40.0, 140), rng.uniform(30.0, 150.0, 140)

    def apart(pair, time_s):
        found = np.empty((2, len(pair)))
        for number in set(pair.tolist()):
            mine = pair == number
            found[:, mine] = each[number][0](time_s[mine])
        return found

    fastest = np.array([speed for _, speed in each])
    first = first_inside_cylinder(apart, (begin_s, end_s), fastest, D_M, Z_M)
    wanted = [
        cylinder_spans(alone, (b, e), v, D_M, Z_M)[:1, 0]
        for (alone, v), b, e in zip(each, begin_s.tolist(), end_s.tolist(), strict=True)
    ]
    assert np.isnan(first).sum() == sum(len(one) == 0 for one in wanted) > 5
    assert first[~np.isnan(first)].tolist() == np.concatenate(wanted).tolist()


def test_a_pass_between_two_samples_is_found():
    """Inside for 40 ms, between the tenths of a second: a cylinder that is crossed at its rim."""
    speed, miss = 200.0, math.sqrt(D_M**2 - (200.0 * 0.02) ** 2)

    def apart(time_s):
        return np.hypot(miss, speed * (time_s - 33.35)), np.full(len(time_s), 10.0)

    times = np.arange(0.0, 100.0, 0.1)
    assert (apart(times)[0] >= D_M).all()
    found = cylinder_spans(apart, (0.0, 100.0), speed, D_M, Z_M)
    assert found == pytest.approx(np.array([[33.33, 33.37]]), abs=FINEST_S)


def test_who_stays_on_the_edge_is_outside_and_ends():
    calls = []

    def apart(time_s):
        calls.append(len(time_s))
        return np.full(len(time_s), D_M), np.zeros(len(time_s))

    assert len(cylinder_spans(apart, (0.0, 3600.0), 150.0, D_M, Z_M)) == 0
    assert sum(calls) < 500_000


def test_both_sizes_count_and_no_time_is_no_span():
    def apart(time_s):
        return np.full(len(time_s), 100.0), np.abs(100.0 - time_s)

    found = cylinder_spans(apart, (0.0, 300.0), 1.0, D_M, Z_M)
    assert found == pytest.approx(np.array([[24.0, 176.0]]), abs=FINEST_S)
    assert len(cylinder_spans(apart, (0.0, 300.0), 1.0, 99.0, Z_M)) == 0
    assert len(cylinder_spans(apart, (5.0, 4.0), 1.0, D_M, Z_M)) == 0
