"""Marcum's Q function of order one, with a threshold that may differ from element to element."""

from __future__ import annotations

import math

import numpy as np

from components.arguments.checks import FloatArray

#: Largest threshold of the sums.
MOST = 240.0
# Elements per pass, so that the working arrays stay in the cache.
_CHUNK = 4096


def marcum_q1(signal: FloatArray, threshold: FloatArray, largest_threshold: float) -> FloatArray:
    """Return the probability that a steady signal in unit noise crosses a threshold.

    Q_1(sqrt(2 signal), sqrt(2 threshold)) for flat arrays.

    Parameters
    ----------
    signal : (m,) array
        Power ratio, 0 or more.
    threshold : (m,) array
        In [0, largest_threshold], in the unit in which noise alone is Exponential(1).
    largest_threshold : float
        It sets the number of terms, so that an element's bits depend on nothing else. Above 240
        (a false-alarm probability of 1e-104) thresholds beyond 240 have an asymptotic form, with
        an absolute error below 1e-4.

    Returns
    -------
    (m,) array
        In [0, 1], relative error below 1e-14 (1 - Q: below 1e-12 while it is above 1e-4).

    Notes
    -----
    With N Poisson(signal) and M Poisson(threshold) this is Pr(M <= N): summed over N where the
    signal is below the threshold, its complement over M elsewhere. All terms are positive.
    """
    if largest_threshold > MOST:
        return _q1_of_any(signal, threshold)
    terms = math.ceil(largest_threshold + 9.0 * math.sqrt(largest_threshold) + 36.0)
    result = np.empty_like(signal)
    for start in range(0, signal.size, _CHUNK):
        part = slice(start, start + _CHUNK)
        weak = signal[part] < threshold[part]
        # The outer sum runs over the variable with the smaller mean, which has run out by then.
        outer_mean = np.where(weak, signal[part], threshold[part])
        inner_mean = np.minimum(np.where(weak, threshold[part], signal[part]), 740.0)
        # Capped, a strong signal is still missed with a probability below 1e-50 only.
        # Weak: sum of Pr(N = j) Pr(M <= j). Strong: 1 - sum of Pr(M = j) Pr(N <= j - 1).
        with np.errstate(under="ignore"):  # the terms run out into 0
            outer, inner = np.exp(-outer_mean), np.exp(-inner_mean)
            below = inner.copy()
            total = np.where(weak, outer * below, 0.0)
            for j in range(1, terms):
                outer *= outer_mean * (1.0 / j)
                previous = below
                inner *= inner_mean * (1.0 / j)
                below = below + inner
                total += outer * np.where(weak, below, previous)
        result[part] = np.where(weak, total, 1.0 - total)
    return np.minimum(np.maximum(result, 0.0), 1.0)


def _q1_of_any(signal: FloatArray, threshold: FloatArray) -> FloatArray:
    """Return the same for any threshold; far out both amplitudes are large.

    There Q1(a, b) is Q(b - a) + e/2, of which Q1(a, b) + Q1(b, a) = 1 + e is exact, with
    e = exp(-(a - b)²/2) i0e(a b).
    """
    from scipy.special import i0e, ndtr

    far = threshold > MOST
    result = marcum_q1(signal, np.where(far, 1.0, threshold), MOST)
    a, b = np.sqrt(2.0 * signal[far]), np.sqrt(2.0 * threshold[far])
    with np.errstate(under="ignore"):  # far apart the tails are 0
        result[far] = ndtr(a - b) + 0.5 * np.exp(-0.5 * (a - b) ** 2) * i0e(a * b)
    return np.minimum(result, 1.0)
