"""Intervals of means, differences and shares against those of scipy.stats."""

import math

import numpy as np
import pytest
from scipy import stats

from dsa_des.results.differences import estimate_difference
from dsa_des.results.statistics import FEW, estimate_mean, estimate_share

RNG = np.random.default_rng(4)
NORMAL = RNG.normal(3.0, 2.0, 24)
OTHER = NORMAL + RNG.normal(0.7, 0.4, 24)
WIDE = RNG.normal(1.0, 9.0, 24)


@pytest.mark.parametrize("confidence", [0.9, 0.95, 0.99])
@pytest.mark.parametrize("count", [2, 5, 24])
def test_a_mean_has_student_s_interval(count, confidence):
    values = NORMAL[:count]
    found = estimate_mean(values, confidence)
    expected = stats.ttest_1samp(values, 0.0).confidence_interval(confidence)
    assert found.value == pytest.approx(np.mean(values))
    assert (found.low, found.high) == pytest.approx((expected.low, expected.high))
    assert found.few is (count < FEW == 10)


@pytest.mark.parametrize("method", ["t", "bootstrap"])
def test_means_and_differences_of_the_largest_numbers_are_those_of_small_ones(method):
    """Times a power of two, which changes no digit; sums of such values are beyond the largest."""
    large = 2.0**1019
    small, found = (estimate_mean(unit * NORMAL, 0.95, method) for unit in (1.0, large))
    assert [large * end for end in (small.value, small.low, small.high)] == [
        found.value, found.low, found.high,
    ]  # fmt: skip
    plain, far = (
        estimate_difference(unit * NORMAL, unit * OTHER, 0.95, method) for unit in (1.0, large)
    )
    assert far.paired.half_width == large * plain.paired.half_width
    assert far.unpaired.half_width == large * plain.unpaired.half_width


@pytest.mark.parametrize("second", [OTHER, WIDE])
def test_a_difference_is_the_second_less_the_first_paired_and_not(second):
    found = estimate_difference(NORMAL, second, 0.95)
    paired = stats.ttest_rel(second, NORMAL).confidence_interval(0.95)
    assert found.paired.value == pytest.approx(np.mean(second) - np.mean(NORMAL))
    assert (found.paired.low, found.paired.high) == pytest.approx((paired.low, paired.high))
    welch = stats.ttest_ind(second, NORMAL, equal_var=False).confidence_interval(0.95)
    assert found.unpaired.value == pytest.approx(np.mean(second) - np.mean(NORMAL))
    assert (found.unpaired.low, found.unpaired.high) == pytest.approx((welch.low, welch.high))
    ratio = (welch.high - welch.low) / (paired.high - paired.low)
    assert found.narrowing_factor == pytest.approx(ratio)
    assert bool(ratio > 3.0) is (second is OTHER)


def wilson(value: float, trials: float) -> tuple[float, float]:
    z = stats.norm.ppf(0.975)
    middle = (value + z**2 / (2 * trials)) / (1 + z**2 / trials)
    spread = value * (1.0 - value) / trials + z**2 / (4 * trials**2)
    half = z / (1 + z**2 / trials) * math.sqrt(spread)
    return middle - half, middle + half


@pytest.mark.parametrize("won", [0, 1, 7, 19, 20])
def test_a_share_of_lone_trials_has_wilson_s_interval(won):
    """Where the trials differ their spread is estimated, which takes one of them."""
    successes = np.array([1.0] * won + [0.0] * (20 - won))
    found = estimate_share(successes, np.ones(20), 0.95)
    known = stats.binomtest(won, 20).proportion_ci(0.95, method="wilson")
    assert wilson(won / 20, 20) == pytest.approx((known.low, known.high), abs=1e-9)
    expected = (known.low, known.high) if won in (0, 20) else wilson(won / 20, 19)
    assert found.value == won / 20
    assert (found.low, found.high) == pytest.approx(expected, abs=1e-9)


def test_trials_that_hang_together_count_as_fewer():
    """Bunches of unlike size: the ratio's spread from bunch to bunch, with Student's t."""
    trials = np.array([30.0, 3.0, 12.0, 8.0] * 6)
    successes = np.floor(trials * RNG.uniform(0.0, 1.0, len(trials)))
    found = estimate_share(successes, trials, 0.95)
    count, total = len(trials), trials.sum()
    value = successes.sum() / total
    assert found.value == pytest.approx(value)
    assert found.value != pytest.approx(np.mean(successes / trials), rel=0.01)
    variance = count / (count - 1) * np.sum((successes - value * trials) ** 2) / total**2
    z = stats.norm.ppf(0.975)
    variance *= (stats.t.ppf(0.975, count - 1) / z) ** 2
    effective = value * (1.0 - value) / variance
    assert effective < 0.5 * total
    assert (found.low, found.high) == pytest.approx(wilson(value, effective))


def test_the_bootstrap_agrees_for_normal_values_and_leans_for_skewed_ones():
    values = np.random.default_rng(1).normal(0.0, 1.0, 400)
    plain, resampled = estimate_mean(values, 0.9), estimate_mean(values, 0.9, "bootstrap")
    width = plain.high - plain.low
    assert resampled.low == pytest.approx(plain.low, abs=0.07 * width)
    assert resampled.high == pytest.approx(plain.high, abs=0.07 * width)
    skewed = np.random.default_rng(2).exponential(1.0, 30) ** 2
    found = estimate_mean(skewed, 0.95, "bootstrap")
    assert found.high - found.value > 1.3 * (found.value - found.low)
