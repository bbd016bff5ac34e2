"""Pd of a steady target by Albersheim's one-line equation."""

from __future__ import annotations

import math

import numpy as np

from components.arguments.checks import FloatArray

_PD_RANGE = (0.1, 0.9)
_PFA_RANGE = (1e-7, 1e-3)
_MOST_PULSES = 8096


def albersheim_probability(
    snr: FloatArray, pulses: int, false_alarm_probability: float, model: str
) -> FloatArray:
    """Return Pd of a steady target by inverting Albersheim's equation for the SNR required.

    Stated validity: swerling0, Pd 0.1 to 0.9, Pfa 1e-7 to 1e-3, 1 to 8096 pulses. It claims 0.2 dB
    and was fitted to a linear detector. Against the exact square-law detector we measure 0.08 dB
    at 1 pulse and Pd above 0.5, 0.33 dB over all pulses and Pd above 0.3, but 0.9 dB at Pd 0.2 and
    4.1 dB at Pd 0.1 (1 pulse, Pfa 1e-3). Worst absolute error of Pd: 0.11 (8096 pulses, Pfa 1e-7).

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
        Outside the stated validity; for an SNR the message gives the range allowed.

    Notes
    -----
    W. J. Albersheim, "A closed-form approximation to Robertson's detection characteristics",
    Proc. IEEE 69 (7), 1981: with A = ln(0.62/Pfa) and B = ln(Pd/(1-Pd)),
    SNR_dB = -5 log10 n + (6.2 + 4.54/sqrt(n + 0.44)) log10(A + 0.12 A B + 1.7 B).
    """
    if model != "swerling0":
        raise ValueError(
            f"model is {model!r}: method 'albersheim' must be used with swerling0 (swerling5)"
        )
    low, high = _PFA_RANGE
    if not low <= false_alarm_probability <= high:
        raise ValueError(
            f"false_alarm_probability is {false_alarm_probability:g}: it must lie in "
            f"[{low:g}, {high:g}] for method 'albersheim'"
        )
    if pulses > _MOST_PULSES:
        raise ValueError(
            f"pulses is {pulses}: it must be at most {_MOST_PULSES} for method 'albersheim'"
        )
    a = math.log(0.62 / false_alarm_probability)
    span = 6.2 + 4.54 / math.sqrt(pulses + 0.44)
    gain = 5.0 * math.log10(pulses)

    def required_db(pd: float) -> float:
        b = math.log(pd / (1.0 - pd))
        return span * math.log10(a + 0.12 * a * b + 1.7 * b) - gain

    low_db, high_db = (required_db(pd) for pd in _PD_RANGE)
    # A part in 1e9 of room, so that the end points themselves are inside.
    lowest, highest = 10.0 ** (low_db / 10.0), 10.0 ** (high_db / 10.0)
    outside = ~((snr >= lowest * (1.0 - 1e-9)) & (snr <= highest * (1.0 + 1e-9)))
    if np.any(outside):
        raise ValueError(
            f"snr is {float(snr[outside][0]):g}: it must lie in [{lowest:.6g}, {highest:.6g}] "
            f"({low_db:.2f} to {high_db:.2f} dB, Pd 0.1 to 0.9) for method 'albersheim' with "
            f"{pulses} pulses and false_alarm_probability {false_alarm_probability:g}"
        )
    z = (10.0 * np.log10(snr) + gain) / span
    b = (np.exp(z * math.log(10.0)) - a) / (0.12 * a + 1.7)
    return 1.0 / (1.0 + np.exp(-b))
