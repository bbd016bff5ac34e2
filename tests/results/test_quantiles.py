"""Quantiles and their intervals, by the binomial distribution; and how often they hold."""

import math

import numpy as np
import pytest
from scipy import stats

from dsa_des.results.statistics import estimate_quantile


@pytest.mark.parametrize(("count", "share"), [(1000, 0.95), (140, 0.95), (60, 0.5), (200, 0.1)])
def test_the_ends_are_the_order_statistics_of_the_binomial(count, share):
    values = np.random.default_rng(3).permutation(np.arange(1.0, count + 1))
    found = estimate_quantile(np.append(values, np.nan), share, 0.95)
    low, high = stats.binom.ppf([0.025, 0.975], count, share)
    # Either end as near as its probability allows: one further in would err too often.
    assert found.low <= low <= found.low + 1 and found.high - 1 <= high <= found.high
    assert (
        stats.binom.cdf(found.low - 1, count, share)
        <= 0.025
        < stats.binom.cdf(found.low, count, share)
    )
    assert (
        stats.binom.sf(found.high - 1, count, share)
        <= 0.025
        < stats.binom.sf(found.high - 2, count, share)
    )
    assert found.value == math.ceil(share * count) and found.count == count and not found.few


@pytest.mark.parametrize("draw", ["standard_exponential", "standard_normal"])
def test_intervals_hold_the_quantile(draw):
    random = np.random.default_rng(8)
    truth = stats.expon.ppf(0.9) if draw == "standard_exponential" else stats.norm.ppf(0.9)
    held = 0
    for _ in range(600):
        found = estimate_quantile(getattr(random, draw)(120), 0.9, 0.95)
        held += found.low <= truth <= found.high
    assert held / 600 > 0.95 - 3 * math.sqrt(0.05 * 0.95 / 600)


def test_too_few_values_have_no_upper_end():
    found = estimate_quantile(np.arange(20.0), 0.95, 0.95)
    assert found.high == math.inf and found.few and found.value == 18.0
    assert math.isnan(estimate_quantile(np.array([np.nan]), 0.5, 0.95).value)
