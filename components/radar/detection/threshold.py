"""The threshold of the detector, and the distribution of the noise around it.

Poisson and negative binomial probabilities are had to full relative accuracy by the saddle point.
ln(m!) and m ln x are large and nearly cancel; Loader's form subtracts them on paper instead: what
is left is the small error of Stirling's formula and a deviance that vanishes at the mean.
Source: C. Loader, "Fast and Accurate Computation of Binomial Probabilities", 2000.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from components.arguments.checks import (
    FloatArray,
    broadcast_flat,
    check_probability,
    check_pulses,
    unflatten,
)

_TWO_PI = 2.0 * math.pi

# Stirling's series for ln(m!): 1/(12 m) - 1/(360 m³) + …; at m = 16 the next term is below 1e-18.
_STIRLING = (1 / 12, -1 / 360, 1 / 1260, -1 / 1680, 1 / 1188, -691 / 360360, 1 / 156)
_SERIES_FROM = 16


def _stirling_series(m: FloatArray) -> FloatArray:
    inverse_square = 1.0 / (m * m)
    total = np.full_like(m, _STIRLING[-1])
    for coefficient in reversed(_STIRLING[:-1]):
        total = total * inverse_square + coefficient
    return total / m


def _small_stirling_errors() -> FloatArray:
    errors = np.zeros(_SERIES_FROM + 1)
    errors[-1] = _stirling_series(np.array([float(_SERIES_FROM)]))[0]
    for m in range(_SERIES_FROM - 1, 0, -1):
        errors[m] = errors[m + 1] + (m + 0.5) * math.log1p(1.0 / m) - 1.0
    return errors


_SMALL_ERRORS = _small_stirling_errors()


def stirling_error(m: FloatArray) -> FloatArray:
    """Return ln(m!) - ln(sqrt(2 pi m) (m/e)^m) for whole m >= 1 (flat array; 0 gives 0)."""
    small = _SMALL_ERRORS[np.minimum(m, _SERIES_FROM).astype(np.intp)]
    return np.where(m <= _SERIES_FROM, small, _stirling_series(np.maximum(m, _SERIES_FROM)))


def deviance(m: FloatArray, mean: FloatArray) -> FloatArray:
    """Return m ln(m/mean) + mean - m without cancellation, for m >= 1, mean >= 0 (flat arrays)."""
    difference = mean - m
    ratio = difference / (mean + m)
    square = ratio * ratio
    # Near the mean: -difference·ratio + 2m·(ratio³/3 + …) as a series in ratio².
    near = np.zeros_like(square)
    for odd in range(19, 1, -2):
        near = near * square + 1.0 / odd
    near = difference * ratio - 2.0 * m * ratio * square * near
    # An SNR of 0 has mean 0, and no term that counts.
    away = m * (difference / m - np.log(np.maximum(mean, 1e-300) / m))
    return np.where(np.abs(ratio) < 0.1, near, away)


def poisson(m: FloatArray, mean: FloatArray) -> FloatArray:
    """Return the Poisson probability mean^m e^-mean / m! of whole m >= 0 (flat arrays)."""
    at_least_1 = np.maximum(m, 1.0)
    exponent = np.where(m == 0.0, -mean, -stirling_error(m) - deviance(at_least_1, mean))
    return np.exp(exponent) / np.where(m == 0.0, 1.0, np.sqrt(_TWO_PI * at_least_1))


def negative_binomial(m: FloatArray, shape: float, scale: FloatArray) -> FloatArray:
    """Return C(m+K-1, m) q^m (1-q)^K with q = c/(1+c), shape K and scale c (flat arrays)."""
    at_least_1 = np.maximum(m, 1.0)
    total = at_least_1 + shape
    k = np.full_like(m, shape)
    failure = 1.0 / (1.0 + scale)
    exponent = (
        stirling_error(total)
        - stirling_error(k)
        - stirling_error(at_least_1)
        - deviance(k, total * failure)
        - deviance(at_least_1, total * (scale * failure))
    )
    exponent = np.where(m == 0.0, -shape * np.log1p(scale), exponent)
    # Loader's binomial probability of K out of m + K, times K/(m + K).
    factor = np.sqrt(shape / (_TWO_PI * at_least_1 * total))
    return np.exp(exponent) * np.where(m == 0.0, 1.0, factor)


def detection_threshold(pulses: ArrayLike, false_alarm_probability: ArrayLike) -> Any:
    """Return the threshold V_T that noise alone crosses with the given probability.

    The noise is normalised so that the sum of the square-law detector over the pulses is
    Gamma(pulses, 1) distributed: V_T solves 1 - P(pulses, V_T) = false_alarm_probability, with P
    the regularised lower incomplete gamma function.

    Parameters
    ----------
    pulses : array_like
        Number of pulses summed non-coherently, whole numbers from 1 to 100,000.
    false_alarm_probability : array_like
        Per look, strictly between 0 and 1. Broadcasts with `pulses`.

    Returns
    -------
    array of the broadcast shape
        V_T, dimensionless, within one or two units in the last place.

    Raises
    ------
    ValueError
        If an argument is out of range.

    Notes
    -----
    One V_T for both places where the thesis (eq. 26 and 32) uses two symbols. Every distinct pair
    of arguments is solved once and remembered.
    """
    shape, (n, pfa) = broadcast_flat(
        pulses=check_pulses(pulses),
        false_alarm_probability=check_probability(
            "false_alarm_probability", false_alarm_probability
        ),
    )
    solved = [threshold_of(int(k), p) for k, p in zip(n.tolist(), pfa.tolist(), strict=True)]
    return unflatten(np.array(solved, dtype=np.float64), shape)


@lru_cache(maxsize=4096)
def threshold_of(pulses: int, false_alarm_probability: float) -> float:
    """Return the threshold that the sum of the pulses' noise exceeds with the given probability."""
    if pulses == 1:
        return -math.log(false_alarm_probability)
    from scipy.special import gammainccinv

    threshold = float(gammainccinv(pulses, false_alarm_probability))
    # Its last digits are not good enough: the miss probability magnifies an error of V_T up to
    # two thousand times. The slope of the tail is the Poisson term g(pulses - 1).
    for _ in range(4):
        slope = _poisson_at(pulses - 1, threshold)
        if false_alarm_probability <= 0.5:
            excess = slope * _scaled_poisson_sum_below(pulses, threshold) - false_alarm_probability
        else:
            below = slope * _scaled_poisson_sum_from(pulses, threshold)
            excess = (1.0 - false_alarm_probability) - below
        step = excess / slope
        if not math.isfinite(step):
            break
        threshold += step
        if abs(step) <= 1e-16 * threshold:
            break
    return threshold


def _poisson_at(m: int, mean: float) -> float:
    with np.errstate(under="ignore"):  # far from the mean the term is 0
        return float(poisson(np.array([float(m)]), np.array([mean]))[0])


def _scaled_poisson_sum_below(pulses: int, mean: float) -> float:
    """Return the sum of the Poisson terms 0 … pulses - 1, divided by the last one."""
    with np.errstate(under="ignore"):  # terms far below the last one are 0
        ratios = np.arange(pulses - 1, 0, -1, dtype=np.float64) / mean
        return math.fsum(np.cumprod(ratios).tolist()) + 1.0


def _scaled_poisson_sum_from(pulses: int, mean: float) -> float:
    """Return the sum of the Poisson terms from `pulses` on, divided by the term pulses - 1."""
    count = int(40.0 + 40.0 * math.sqrt(pulses))
    with np.errstate(under="ignore"):  # terms far above are 0
        ratios = mean / np.arange(pulses, pulses + count, dtype=np.float64)
        return math.fsum(np.cumprod(ratios).tolist())


@dataclass(frozen=True)
class Crossing:
    """The threshold of a look, and how often noise alone crosses it.

    The threshold is on the sum of pulses, in units of a pulse's mean noise; the probability of
    false alarm is per look and cell, and 0 where a double cannot hold it.
    """

    pulses: int
    false_alarm_probability: float
    threshold: float

    @classmethod
    @lru_cache(maxsize=256)
    def from_false_alarms(cls, pulses: int, false_alarm_probability: float) -> Crossing:
        """Return the threshold that noise alone crosses with this probability of false alarm."""
        threshold = float(detection_threshold(pulses, false_alarm_probability))
        return cls(pulses, false_alarm_probability, threshold)

    @classmethod
    @lru_cache(maxsize=256)
    def from_snr(cls, pulses: int, snr_db: float) -> Crossing:
        """Return the threshold given as SNR per pulse, dB, with its false alarm probability."""
        from scipy.special import gammaincc

        threshold = pulses * (1.0 + 10.0 ** (0.1 * snr_db))
        return cls(pulses, float(gammaincc(float(pulses), threshold)), threshold)


@dataclass(frozen=True)
class NoiseTerms:
    """Poisson terms of noise about the threshold V_T, which the detection series sum.

    `term` holds g(pulses + j) for j = 0, 1, …, the Poisson probabilities with mean V_T; `missed`
    their sums from j on, P(pulses + j, V_T), the probability that noise of pulses + j pulses stays
    below the threshold; `gained` the sums before j.
    """

    pulses: int
    false_alarm_probability: float
    threshold: float
    term: FloatArray
    missed: FloatArray
    gained: FloatArray


@lru_cache(maxsize=256)
def noise_terms(pulses: int, false_alarm_probability: float) -> NoiseTerms:
    """Return the Poisson terms from `pulses` on until they underflow; arguments are checked."""
    threshold = threshold_of(pulses, false_alarm_probability)
    largest = max(pulses, math.floor(threshold))
    end = int(largest + 40.0 * math.sqrt(largest) + 500.0)
    m = np.arange(pulses, end + 1, dtype=np.float64)
    term = np.empty_like(m)
    top = largest - pulses
    with np.errstate(under="ignore"):  # the terms run out into 0
        anchor = _poisson_at(largest, threshold)
        # Downwards g(m-1) = g(m) m/V, upwards g(m+1) = g(m) V/(m+1), both from the largest term.
        term[top] = anchor
        term[top + 1 :] = anchor * np.cumprod(threshold / m[top + 1 :])
        term[:top] = (anchor * np.cumprod(m[top:0:-1] / threshold))[::-1]
        kept = max(int(np.count_nonzero(term)), 1)
        term = term[:kept]
        missed = np.cumsum(term[::-1])[::-1].copy()
        gained = np.concatenate(([0.0], np.cumsum(term)[:-1]))
    for array in (term, missed, gained):
        array.flags.writeable = False
    return NoiseTerms(pulses, false_alarm_probability, threshold, term, missed, gained)
