"""Pd by the thesis's Gram-Charlier series, with its lost factor put back."""

from __future__ import annotations

import math

import numpy as np

from components.arguments.checks import FloatArray
from components.radar.threshold import threshold_of


def gram_charlier_probability(
    snr: FloatArray, pulses: int, false_alarm_probability: float, model: str
) -> FloatArray:
    """Return Pd of a steady target by three terms of the Gram-Charlier series, clipped to [0, 1].

    Covers swerling0 only: the thesis gives the series' constants for no other model. Any number
    of pulses and any Pfa, but it is an approximation: worst absolute error over all SNR and Pfa of
    1e-12 to 0.1, 0.025 at 1 pulse, 0.010 at 2, 0.003 at 5, 0.001 at 10 and 5e-5 at 100 (at Pfa
    1e-4: 0.0062, 0.0039, 0.0017, 0.0008 and 5e-5); before clipping it exceeds 1 by up to 0.001,
    and it is not monotonic in SNR nor bounded by Pfa.

    Parameters
    ----------
    snr : (m,) contiguous array, linear, 0 or more
    pulses, false_alarm_probability, model
        Checked and canonical.

    Returns
    -------
    (m,) array

    Raises
    ------
    ValueError
        For a model other than swerling0.

    Notes
    -----
    Thesis eq. 26-31 with the factor 1/sqrt(2 pi) that eq. 27 lacks (B. R. Mahafza, Radar Systems
    Analysis and Design Using MATLAB, has it). Without it Pd reaches 1.0074 at 5 pulses, Pfa 1e-4
    and 8 dB, where the exact value is 0.9958.
    """
    if model != "swerling0":
        raise ValueError(
            f"model is {model!r}: method 'gram_charlier' must be used with swerling0 (swerling5), "
            "the only model for which thesis eq. 28-31 give its constants"
        )
    from scipy.special import erfc

    n = float(pulses)
    # An SNR beyond 1e100 is detected for certain; its square would overflow.
    ratio = np.minimum(snr, 1e100)
    spread = 2.0 * ratio + 1.0
    omega = np.sqrt(n * spread)
    v = (threshold_of(pulses, false_alarm_probability) - n * (1.0 + ratio)) / omega
    c3 = -(ratio + 1.0 / 3.0) / (math.sqrt(n) * spread * np.sqrt(spread))
    c4 = (ratio + 0.25) / (n * spread * spread)
    c6 = 0.5 * c3 * c3
    # Beyond ±40 the normal tail is 0 however large the polynomial.
    v = np.minimum(np.maximum(v, -40.0), 40.0)
    square = v * v
    with np.errstate(under="ignore"):  # the normal tail fades to 0
        series = (
            c3 * (square - 1.0)
            + c4 * v * (3.0 - square)
            - c6 * v * (square * square - 10.0 * square + 15.0)
        )
        density = np.exp(-0.5 * square) / math.sqrt(2.0 * math.pi)
        result = 0.5 * np.asarray(erfc(v / math.sqrt(2.0))) - density * series
    return np.minimum(np.maximum(result, 0.0), 1.0)
