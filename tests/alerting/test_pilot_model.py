"""The pilot's times and sizes against the published table, by means over even draws."""

import math

import numpy as np
import pytest

from components.operator.pilot_model import (
    Draws,
    commanded_change_out_of_band,
    decision_pause_s,
    mean_decision_pause_s,
    reaction_and_execution_delays_s,
)

EVEN = (np.arange(4000) + 0.5) / 4000
DEG, FOOT_M = math.pi / 180, 0.3048


@pytest.mark.parametrize(
    ("level", "least", "mean"), [(0, 12, 12), (1, 9, 6), (2, 6, 3), (3, 6, 3), (7, 6, 3)]
)
def test_pauses_are_those_of_their_level(level, least, mean):
    drawn = np.array([decision_pause_s(level, u) for u in EVEN])
    assert drawn.min() == pytest.approx(least, abs=0.01)
    assert drawn.mean() == pytest.approx(least + mean, rel=2e-3)
    assert np.median(drawn) == pytest.approx(least + mean * math.log(2), rel=1e-3)
    assert mean_decision_pause_s(level) == least + mean


def test_responses_are_the_sum_of_three_times():
    """Exponential, gamma of shape 5.5, exponential: each by itself, and all together."""
    for which, mean in ((0, 5.0), (1, 11.0), (2, 3.0)):
        means = [0.0, 0.0, 0.0]
        means[which] = mean
        drawn = np.array(
            [sum(reaction_and_execution_delays_s(np.eye(3)[which] * u, *means)) for u in EVEN]
        )
        spread = mean / math.sqrt(5.5) if which == 1 else mean
        assert (drawn.mean(), drawn.std()) == pytest.approx((mean, spread), rel=0.02)
    parts = [
        sum(reaction_and_execution_delays_s(np.eye(3)[k] * 0.3, *(np.eye(3)[k] * 4.0)))
        for k in range(3)
    ]
    waits_s, executes_s = reaction_and_execution_delays_s(np.full(3, 0.3), 4.0, 4.0, 4.0)
    assert (waits_s, executes_s) == pytest.approx((parts[0] + parts[1], parts[2]))
    assert reaction_and_execution_delays_s(None, 5.0, 11.0, 3.0) == (16.0, 3.0)


@pytest.mark.parametrize("sign", [-1, 1])
def test_sizes_are_the_least_change_and_a_shifted_gamma(sign):
    """The nearer side, the other one, and altitudes; means are shape times scale less the shift."""
    near, far = 50 * DEG, 70 * DEG
    changes = (-near, far) if sign < 0 else (-far, near)
    follows = [commanded_change_out_of_band(changes, True, Draws(0.79, 0.0, u)) for u in EVEN]
    assert np.mean(follows) * sign == pytest.approx(near + (6.21 * 9.67 - 30) * DEG, rel=2e-3)
    side = 0.0 if sign > 0 else 0.61  # left below 0.6
    other = [commanded_change_out_of_band(changes, True, Draws(0.81, side, u)) for u in EVEN]
    assert np.mean(other) * -sign == pytest.approx(far + (5.47 * 8.25 - 30) * DEG, rel=2e-3)
    feet = (-900.0, 1000.0) if sign < 0 else (-1000.0, 900.0)
    climbs = [
        commanded_change_out_of_band((feet[0] * FOOT_M, feet[1] * FOOT_M), False, Draws(0.1, 0, u))
        for u in EVEN
    ]
    assert np.mean(climbs) * sign == pytest.approx((900 + 9.73 * 207.98 - 1500) * FOOT_M, rel=5e-3)
    for way, turns, beyond in ((near, True, 30 * DEG), (270.0, False, 500 * FOOT_M)):
        both = (-way, 2 * way) if sign < 0 else (-2 * way, way)
        assert commanded_change_out_of_band(both, turns, None) == pytest.approx(
            sign * min(way + beyond, 1e9)
        )


def test_who_is_undecided_goes_left_six_times_in_ten_and_down_every_other_time():
    """Ways that differ by more than 40 degrees leave no choice; nor does a way on one side only."""
    for turns, share in ((True, 0.6), (False, 0.5)):
        ways = (-1.0, 1.3) if turns else (-300.0, 310.0)
        went = [commanded_change_out_of_band(ways, turns, Draws(0.9, u, 0.5)) < 0 for u in EVEN]
        assert np.mean(went) == pytest.approx(share, abs=1e-3)
    ways = (-50 * DEG, 91 * DEG)
    assert commanded_change_out_of_band(ways, True, Draws(0.99, 0.99, 0.5)) < 0
    assert commanded_change_out_of_band((-50 * DEG, 89 * DEG), True, Draws(0.99, 0.99, 0.5)) > 0
    assert commanded_change_out_of_band((-math.inf, 0.5), True, Draws(0.99, 0.0, 0.5)) > 0
    assert commanded_change_out_of_band((-math.inf, math.inf), True, None) == 0.0
    assert (
        commanded_change_out_of_band((-0.4, 0.4), True, None) > 0
    )  # the right one of two that are equal
    assert commanded_change_out_of_band((-3.0, math.inf), True, None) == -math.pi
    assert commanded_change_out_of_band((-math.inf, 0.01), True, Draws(0.1, 0.1, 1e-9)) == 0.0
