"""Poisson and negative binomial probabilities to full relative accuracy, by the saddle point.

ln(m!) and m ln x are large and nearly cancel; Loader's form subtracts them on paper instead: what
is left is the small error of Stirling's formula and a deviance that vanishes at the mean.
Source: C. Loader, "Fast and Accurate Computation of Binomial Probabilities", 2000.
"""

from __future__ import annotations

import math

import numpy as np

from components.arguments.checks import FloatArray

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
