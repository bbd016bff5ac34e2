"""The exact probability of detection, or of a miss, of each Swerling model."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from components.arguments.checks import FloatArray
from components.radar.detection_series import (
    chain_gain,
    chain_miss,
    geometric_gain,
    geometric_miss,
)
from components.radar.threshold import noise_terms, threshold_of

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
            gain_side, miss_side = _sides(
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


def _sides(pulses: int, pfa: float, model: str, negligible: float) -> tuple[Side, Side]:
    noise = noise_terms(pulses, pfa)
    shapes = {"swerling1": 1, "swerling2": pulses, "swerling3": 2, "swerling4": 2 * pulses}
    shape = shapes.get(model)
    if shape is not None and shape <= 2:
        return (
            lambda snr: geometric_gain(noise, shape, pulses * snr),
            lambda snr: geometric_miss(noise, shape, pulses * snr),
        )
    # An echo of 1e15 is missed with probability 0 (Poisson), and 1e100 is as good as infinite for
    # a negative binomial with K >= 3; the cap keeps the anchor's arithmetic finite.
    cap = 1e15 if shape is None else 1e100
    return (
        lambda snr: chain_gain(noise, shape, np.minimum(pulses * snr, cap)),
        lambda snr: chain_miss(noise, shape, np.minimum(pulses * snr, cap), negligible=negligible),
    )
