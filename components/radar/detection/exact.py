"""The exact probability of detection, or of a miss, of each Swerling model, as a series.

Given the echo, the detector's sum is Gamma(n + N, 1) with a random whole N: Poisson for a steady
echo (Swerling 0), negative binomial with shape K for the others (K = 1, n, 2, 2n for I, II, III,
IV). With the noise terms g of `threshold.NoiseTerms`

    Pd     = Pfa + sum_j Pr(N = j) · gained_j
    1 - Pd =       sum_j Pr(N = j) · missed_j

and every term is positive. Two ways to sum: a polynomial where Pr(N = j) is a power times a
polynomial (K = 1 and 2), and two chains that run towards the largest term otherwise.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from components.arguments.checks import FloatArray
from components.radar.detection.threshold import (
    NoiseTerms,
    negative_binomial,
    noise_terms,
    poisson,
    threshold_of,
)

IndexArray = NDArray[np.intp]

# Elements per block: small enough for the working arrays to stay in the cache.
_BLOCK = 4096

# Parts in 1e18 of a sum are not missed.
_NEGLIGIBLE = 1e-18


def geometric_detection_probability(noise: NoiseTerms, shape: int, echo: FloatArray) -> FloatArray:
    """Return Pd for a fluctuation of shape 1 or 2; `echo` is pulses times SNR (flat array)."""
    q, r = _echo_and_noise_shares(echo / shape)
    term = noise.term[: _count_noise_terms(noise)]
    total = _polynomial(term, q)
    if shape == 2:
        # Pr(N > i) = q^(i+1) (1 + (i+1) r)
        total += r * _polynomial(term * np.arange(1.0, term.size + 1.0), q)
    return noise.false_alarm_probability + q * total


def geometric_miss_probability(noise: NoiseTerms, shape: int, echo: FloatArray) -> FloatArray:
    """Return 1 - Pd for a fluctuation of shape 1 or 2; `echo` is pulses times SNR (flat array)."""
    q, r = _echo_and_noise_shares(echo / shape)
    missed = noise.missed[: _count_noise_terms(noise)]
    if shape == 2:
        return _polynomial(missed * np.arange(1.0, missed.size + 1.0), q) * r * r
    return _polynomial(missed, q) * r


def _echo_and_noise_shares(scale: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return q = c/(1+c) and 1 - q, both to full accuracy, for c from 0 to infinity."""
    r = 1.0 / (1.0 + scale)
    return np.where(scale < 1.0, np.minimum(scale, 1.0) * r, 1.0 - r), r


def _count_noise_terms(noise: NoiseTerms) -> int:
    """Return the number of leading noise terms that are not negligible."""
    small = np.flatnonzero(noise.missed < _NEGLIGIBLE * noise.missed[0])
    return int(small[0]) + 1 if small.size else noise.missed.size


def _polynomial(coefficients: FloatArray, x: FloatArray) -> FloatArray:
    """Evaluate sum c_i x^i by Horner's rule, block by block, each element by itself."""
    total = np.empty_like(x)
    values = coefficients.tolist()
    for start in range(0, x.size, _BLOCK):
        part = x[start : start + _BLOCK]
        out = total[start : start + _BLOCK]
        out.fill(values[-1])
        for value in reversed(values[:-1]):
            np.multiply(out, part, out=out)
            np.add(out, value, out=out)
    return total


def _gain_over_pfa_or_miss_probability(
    noise: NoiseTerms,
    shape: int | None,
    echo: FloatArray,
    *,
    gain: bool,
    negligible: float,
) -> FloatArray:
    """Return each echo's sum over j of Pr(N = j) times a weight, around the largest term.

    With the weights `gained` (meant for n + echo < V_T) or `missed` (for the others), and any K
    (None: Poisson). Sums that are bound to stay below `negligible` are 0 and not worked out.

    The sum is Pr(N = a) · (below + above), with `below` running up from the window's low end to
    the anchor a and `above` running down from its high end, each step one ratio of neighbouring
    probabilities (Horner's rule with changing factors). Sorting makes the elements that are at
    work in a step neighbours; no element's arithmetic depends on another's.
    """
    weight = noise.gained if gain else noise.missed
    anchor = _index_of_largest_term(noise, shape, echo)
    if not gain:
        anchor = np.minimum(anchor, float(weight.size - 1))
    # The window is a function of the anchor alone. The weights of a gain level off at its far end
    # and leave the slow decay q^j of the negative binomial, at most with the echo V - n.
    v, n = noise.threshold, float(noise.pulses)
    if shape is None:
        width = 36.0 + 9.0 * np.sqrt(anchor + 1.0)
        tail = 0.0
    else:
        k = float(shape)
        width = 36.0 + 9.0 * np.sqrt((anchor + 1.0) * (anchor + k) / (k - 1.0))
        tail = 40.0 * (1.0 + max(v - n, 0.0) / k) if gain else 0.0
    low = np.maximum(np.floor(anchor - width), 0.0).astype(np.intp)
    high = np.floor(anchor + (width + tail)).astype(np.intp)
    if gain and high.size:
        missing = max(int(high.max()) + 1 - weight.size, 0)
        weight = np.concatenate([weight, np.full(missing, weight[-1])])
    high = np.minimum(high, weight.size - 1)
    whole = anchor.astype(np.intp)

    if shape is None:
        z = echo
        first = poisson(anchor, echo)
    else:
        z, _ = _echo_and_noise_shares(echo / shape)
        first = negative_binomial(anchor, float(shape), echo / shape)
    # The largest term times the number of terms bounds the sum.
    work = np.flatnonzero(first * weight[whole] * (high - low + 1) > negligible)
    work = work[np.argsort(whole[work], kind="stable")]
    total = np.zeros_like(echo)
    for start in range(0, work.size, _BLOCK):
        chosen = work[start : start + _BLOCK]
        below = _sum_up_to_anchor(weight, shape, z[chosen], low[chosen], whole[chosen])
        total[chosen] = below + _sum_above_anchor(
            weight, shape, z[chosen], whole[chosen], high[chosen]
        )
    return first * total


def _index_of_largest_term(noise: NoiseTerms, shape: int | None, echo: FloatArray) -> FloatArray:
    """Return j at about the largest term Pr(N = j) g(n + j), where neighbours are equal."""
    n, v = float(noise.pulses), noise.threshold
    if shape is None:
        # mean/(j+1) · V/(n+j+1) = 1
        peak = 2.0 * echo * v / (n + np.sqrt(n * n + 4.0 * echo * v))
    else:
        # q (j+K)/(j+1) · V/(n+j+1) = 1
        q, _ = _echo_and_noise_shares(echo / shape)
        slope = n + 2.0 - q * v
        constant = n + 1.0 - q * v * shape
        root = np.sqrt(np.maximum(slope * slope - 4.0 * constant, 0.0))
        peak = np.maximum(0.5 * (root - slope), 0.0)
    return np.floor(peak)


def _term_ratio(shape: int | None, j: int) -> float:
    """Return Pr(N = j) / Pr(N = j - 1) without its factor z (the mean, or q)."""
    return 1.0 / j if shape is None else (j + shape - 1.0) / j


def _sum_up_to_anchor(
    weight: FloatArray, shape: int | None, z: FloatArray, low: IndexArray, anchor: IndexArray
) -> FloatArray:
    """Sum weight_j Pr(j)/Pr(anchor) for j = low … anchor."""
    total = np.zeros_like(z)
    inverse = 1.0 / np.maximum(z, 1e-300)  # where it matters, z is far above that
    first, final = int(low[0]), int(anchor[-1])
    steps = np.arange(first, final + 1)
    begins = np.searchsorted(anchor, steps, side="left").tolist()
    ends = np.searchsorted(low, steps, side="right").tolist()
    values = weight[first : final + 1].tolist()
    for j, begin, end, value in zip(range(first, final + 1), begins, ends, values, strict=True):
        part = total[begin:end]
        if j > 0:
            np.multiply(part, inverse[begin:end], out=part)
            np.multiply(part, 1.0 / _term_ratio(shape, j), out=part)
        np.add(part, value, out=part)
    return total


def _sum_above_anchor(
    weight: FloatArray, shape: int | None, z: FloatArray, anchor: IndexArray, high: IndexArray
) -> FloatArray:
    """Sum weight_j Pr(j)/Pr(anchor) for j = anchor + 1 … high."""
    total = np.zeros_like(z)
    first, final = int(anchor[0]) + 1, int(high[-1])
    steps = np.arange(first, final + 1)
    begins = np.searchsorted(high, steps, side="left").tolist()
    ends = np.searchsorted(anchor, steps, side="left").tolist()
    for j in range(final, first - 1, -1):
        begin, end = begins[j - first], ends[j - first]
        part = total[begin:end]
        np.add(part, weight[j], out=part)
        np.multiply(part, z[begin:end], out=part)
        np.multiply(part, _term_ratio(shape, j), out=part)
    return total


# Computes one tail for a flat array of SNR.
Side = Callable[[FloatArray], FloatArray]

# A miss below this leaves Pd = 1 (with room for a bound that is not sharp).
_NO_TRACE_IN_PD = 1e-22
# A miss below this is 0.
_UNDERFLOW = 1e-300


def exact_probability(
    snr: FloatArray, pulses: int, false_alarm_probability: float, model: str, *, miss: bool
) -> FloatArray:
    """Return Pd, or 1 - Pd if `miss`, for a flat contiguous array of checked SNR.

    The smaller side is summed from positive terms, whichever was asked for; the other one is its
    complement, at most a bit lost. Smaller means: the detector's mean n(1 + SNR) is below the
    threshold (Pd is summed) or above it (1 - Pd is summed).
    """
    pfa = false_alarm_probability
    # Far from the threshold a probability is honestly 0, and SNR times pulses may reach infinity.
    with np.errstate(under="ignore", over="ignore"):
        if pulses == 1 and model in ("swerling1", "swerling2"):
            exponent = threshold_of(1, pfa) / (1.0 + snr)
            result = -np.expm1(-exponent) if miss else np.exp(-exponent)
        else:
            gain_side, miss_side = _detection_and_miss_functions(
                pulses, pfa, model, _UNDERFLOW if miss else _NO_TRACE_IN_PD
            )
            high = pulses * (1.0 + snr) >= threshold_of(pulses, pfa)
            result = np.empty_like(snr)
            gained, missed = gain_side(snr[~high]), miss_side(snr[high])
            result[~high] = 1.0 - gained if miss else gained
            result[high] = missed if miss else 1.0 - missed
    at_zero = 1.0 - pfa if miss else pfa
    result = np.minimum(result, at_zero) if miss else np.minimum(np.maximum(result, at_zero), 1.0)
    result[snr == 0.0] = at_zero
    result[np.isinf(snr)] = 0.0 if miss else 1.0
    return result


def _detection_and_miss_functions(
    pulses: int, pfa: float, model: str, negligible: float
) -> tuple[Side, Side]:
    noise = noise_terms(pulses, pfa)
    shapes = {"swerling1": 1, "swerling2": pulses, "swerling3": 2, "swerling4": 2 * pulses}
    shape = shapes.get(model)
    if shape is not None and shape <= 2:
        return (
            lambda snr: geometric_detection_probability(noise, shape, pulses * snr),
            lambda snr: geometric_miss_probability(noise, shape, pulses * snr),
        )
    # An echo of 1e15 is missed with probability 0 (Poisson), and 1e100 is as good as infinite for
    # a negative binomial with K >= 3; the cap keeps the anchor's arithmetic finite.
    cap = 1e15 if shape is None else 1e100

    def chain(snr: FloatArray, gain: bool, negligible: float) -> FloatArray:
        echo = np.minimum(pulses * snr, cap)
        return _gain_over_pfa_or_miss_probability(
            noise, shape, echo, gain=gain, negligible=negligible
        )

    return (
        lambda snr: pfa + chain(snr, True, -1.0),
        lambda snr: chain(snr, False, negligible),
    )
