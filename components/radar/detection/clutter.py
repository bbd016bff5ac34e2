r"""Detection and false alarms with clutter in the target's cell.

The model. In one look (the pulses of a coherent interval already added up) the receiver sees the
complex amplitude ``target + mean clutter + Gaussian``, against the threshold that was set for noise
alone, or against one that rises with the power of the clutter. The thesis has only the Gaussian
part, of zero mean: noise. Clutter adds to it

- a *mean*: the echo of this patch of ground. It is *constant* (a building, a rock face) or
  *fluctuating* (exponential power from look to look: many scatterers), with a phase that is random
  against the target's;
- a *diffuse* part of zero mean, which is more noise: `diffuse_cnr`.

This follows D. A. Shnidman, "Generalized radar clutter model", IEEE Trans. AES 35(3), 1999, and
"Radar detection in clutter", IEEE Trans. AES 41(3), 2005 (thesis section 5.3.2), whose mean may
fluctuate with a gamma distribution of any shape; here the shape is 1 (exponential) or infinite.
The closed forms are our own derivation for one look; `tests/radar` draws the amplitudes and counts.

With S, C, D the mean power of target, mean clutter and diffuse clutter over the noise, V the
threshold and Q(a, v) Marcum's Q_1(sqrt(2a), sqrt(2v)):

========== ========================= ====================================
target     fluctuating mean          constant mean
========== ========================= ====================================
none       exp(-V/N), N = 1 + C + D  Q(C/N, V/N), N = 1 + D
steady     Q(S/N, V/N)               mean of Q(\|s + c\|²/N, V/N) over the phase
exponential exp(-V/(N + S))          Q(C/M, V/M), M = N + S
chi-square 4 exp(-V/M) (1 + V a/M²),  d/da of a Q(C/M, V/M), M = N + a, a = S/2
           M = N + a, a = S/2
========== ========================= ====================================
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from components.arguments.checks import (
    FloatArray,
    broadcast_flat,
    check_not_negative,
    check_one_of,
    check_probability,
    check_swerling_model,
    refuse,
    unflatten,
)
from components.radar.detection.probability import detection_probability

#: Largest threshold of the sums.
MOST = 240.0
# Elements per pass, so that the working arrays stay in the cache.
_CHUNK = 4096


def marcum_q1(signal: FloatArray, threshold: FloatArray, largest_threshold: float) -> FloatArray:
    """Return Marcum's Q1: the chance that a steady signal in unit noise crosses a threshold.

    Q_1(sqrt(2 signal), sqrt(2 threshold)) for flat arrays of power ratios, in the unit in which
    noise alone is Exponential(1), to a relative error below 1e-14 (1 - Q: below 1e-12 while it is
    above 1e-4). `largest_threshold` sets the number of terms, so that an element's bits depend on
    nothing else; above 240 (a false-alarm probability of 1e-104) thresholds beyond 240 have an
    asymptotic form, with an absolute error below 1e-4.

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
    """Return Marcum's Q1 for thresholds of any size, with an asymptotic form for large ones.

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


KINDS = ("constant", "fluctuating")

# Half circle of phases between a steady target and constant clutter.
_PHASES = 64
# For a threshold that has no largest value.
_ANY_THRESHOLD = math.inf
_SMALLEST_FALSE_ALARM_PROBABILITY = 1e-100
# Of a threshold that noise never crosses.
_LEAST = 1e-300


def clutter_detection_probability(
    snr: ArrayLike,
    cnr: ArrayLike,
    *,
    false_alarm_probability: float,
    model: str = "swerling1",
    clutter: str = "fluctuating",
    diffuse_cnr: ArrayLike = 0.0,
    threshold: str = "noise",
    noise_threshold: float | None = None,
) -> Any:
    """Return the probability that a target's cell with clutter crosses the threshold, in one look.

    `snr`, `cnr` and `diffuse_cnr` are S, C and D above, linear, 0 or more; without clutter the
    result is `detection_probability`'s, to the bit. The `clutter` mean is ``constant`` or
    ``fluctuating`` from look to look. The `threshold` stays where noise alone has it (``noise``, at
    `noise_threshold` or by `false_alarm_probability`, 1e-100 to below 1), or rises with the mean
    power of noise and clutter, V (1 + C + D) (``adaptive``): the false alarms of fluctuating
    clutter then stay what they are, and those of a constant mean are fewer.

    For several pulses clutter's phase against the target's from pulse to pulse would have to be
    known. Relative error below 1e-13 (1e-12 of the miss), except a steady target in constant
    clutter: a mean over 64 phases, good to 1e-14 while the weaker of the two is below 20 dB, to
    1e-8 at 25 dB and 1e-4 at 30 dB.
    """
    name = check_swerling_model(model)
    kind = check_one_of("clutter", clutter, KINDS)
    rises = check_one_of("threshold", threshold, ("noise", "adaptive")) == "adaptive"
    pfa = check_probability("false_alarm_probability", false_alarm_probability)
    refuse(
        "false_alarm_probability",
        pfa,
        np.atleast_1d((pfa < _SMALLEST_FALSE_ALARM_PROBABILITY) | (pfa.ndim > 0)),
        "be one number of at least 1e-100",
    )
    shape, (target, mean, diffuse) = broadcast_flat(
        snr=check_not_negative("snr", snr),
        cnr=check_not_negative("cnr", cnr),
        diffuse_cnr=check_not_negative("diffuse_cnr", diffuse_cnr),
    )
    level = -math.log(float(pfa)) if noise_threshold is None else float(noise_threshold)
    result = np.empty_like(target)
    cluttered = (mean > 0.0) | (diffuse > 0.0)
    clear = ~cluttered
    clear_pfa = float(pfa) if noise_threshold is None else max(math.exp(-level), _LEAST)
    result[clear] = detection_probability(
        target[clear], false_alarm_probability=clear_pfa, model=name
    )
    noise = 1.0 + diffuse[cluttered]
    # A threshold that is so many times higher sees all powers so many times lower.
    over = noise + mean[cluttered] if rises else np.ones_like(noise)
    powers = (target[cluttered] / over, mean[cluttered] / over, noise / over)
    cell = (*powers, level, _ANY_THRESHOLD if rises else 0.0)
    with np.errstate(under="ignore"):  # vanishing probabilities are 0
        probability = (
            _pd_in_fluctuating_clutter(name, *cell)
            if kind == "fluctuating"
            else _pd_in_constant_clutter(name, *cell)
        )
    result[cluttered] = np.minimum(np.maximum(probability, 0.0), 1.0)
    return unflatten(result, shape)


def _pd_in_fluctuating_clutter(
    model: str, target: FloatArray, mean: FloatArray, noise: FloatArray, v: float, most: float
) -> FloatArray:
    noise = noise + mean
    if model == "swerling0":
        # With the mean as noise a threshold that rises is back at v, up to rounding.
        return marcum_q1(target / noise, v / noise, v)
    if model in ("swerling1", "swerling2"):
        return np.exp(-v / (noise + target))
    total = noise + 0.5 * target
    return np.exp(-v / total) * (1.0 + (v / total) * (0.5 * target / total))


def _pd_in_constant_clutter(
    model: str, target: FloatArray, mean: FloatArray, noise: FloatArray, v: float, most: float
) -> FloatArray:
    largest = max(v, most)
    if model == "swerling0":
        return _integrate_phases(target, mean, noise, v, largest)
    if model in ("swerling1", "swerling2"):
        total = noise + target
        return marcum_q1(mean / total, v / total, largest)
    a = 0.5 * target
    total = noise + a
    return marcum_q1(mean / total, v / total, largest) + a / total * _scaled_q1_derivative(
        mean / total, v / total
    )


def _scaled_q1_derivative(c: FloatArray, w: FloatArray) -> FloatArray:
    """Return M times the derivative by M of Marcum's Q1(C/M, V/M), for c = C/M and w = V/M."""
    from scipy.special import i0e, i1e

    root_c, root_w = np.sqrt(c), np.sqrt(w)
    x = 2.0 * root_c * root_w
    return np.exp(-((root_c - root_w) ** 2)) * (w * i0e(x) - root_c * root_w * i1e(x))


def _integrate_phases(
    target: FloatArray, mean: FloatArray, noise: FloatArray, v: float, largest: float
) -> FloatArray:
    s, c = np.sqrt(target), np.sqrt(mean)
    total = np.zeros_like(s)
    for phase in (np.arange(_PHASES) + 0.5) * (math.pi / _PHASES):
        # |s + c e^(i phase)|² as (s - c)² + 4 s c cos²(phase/2): never negative.
        power = (s - c) ** 2 + 4.0 * s * c * math.cos(0.5 * phase) ** 2
        total += marcum_q1(power / noise, v / noise, largest)
    return total / _PHASES
