"""Pd by Shnidman's equation, for any Swerling model."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from components.arguments.checks import FloatArray

_PD_RANGE = (0.1, 0.99)
_PFA_RANGE = (1e-9, 1e-3)
_MOST_PULSES = 100
# Above this Pd the equation adds a second correction, with a step.
_KNEE = 0.872
_NODES = 256
_STEPS = 5


def shnidman_probability(
    snr: FloatArray, pulses: int, false_alarm_probability: float, model: str
) -> FloatArray:
    """Return Pd by inverting Shnidman's equation for the SNR required.

    Stated validity: all Swerling models, Pd 0.1 to 0.99, Pfa 1e-9 to 1e-3, 1 to 100 pulses.
    Measured worst absolute error of Pd within that, for swerling0 … 4: 0.052, 0.036, 0.048, 0.045,
    0.042; of the SNR required: 0.3, 1.2, 1.2, 0.7, 0.6 dB. The inverse itself is good to 2e-8.

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
    D. A. Shnidman, "Determination of required SNR values", IEEE Trans. Aerospace and Electronic
    Systems 38 (3), 2002. The required SNR steps up at Pd 0.872; within that step Pd is 0.872.
    """
    low, high = _PFA_RANGE
    if not low <= false_alarm_probability <= high:
        raise ValueError(
            f"false_alarm_probability is {false_alarm_probability:g}: it must lie in "
            f"[{low:g}, {high:g}] for method 'shnidman'"
        )
    if pulses > _MOST_PULSES:
        raise ValueError(
            f"pulses is {pulses}: it must be at most {_MOST_PULSES} for method 'shnidman'"
        )
    equation = _Equation.of(pulses, false_alarm_probability, model)
    lowest, highest = float(equation.node_snr[0]), float(equation.node_snr[-1])
    outside = ~((snr >= lowest * (1.0 - 1e-9)) & (snr <= highest * (1.0 + 1e-9)))
    if np.any(outside):
        raise ValueError(
            f"snr is {float(snr[outside][0]):g}: it must lie in [{lowest:.6g}, {highest:.6g}] "
            f"({10 * math.log10(lowest):.2f} to {10 * math.log10(highest):.2f} dB, Pd 0.1 to 0.99) "
            f"for method 'shnidman' with {model}, {pulses} pulses and false_alarm_probability "
            f"{false_alarm_probability:g}"
        )
    return equation.invert(snr)


@dataclass(frozen=True)
class _Equation:
    """Hold Shnidman's equation for one radar and model, and nodes to start its inverse from."""

    pulses: float
    false_alarm_probability: float
    inverse_k: float
    node_pd: FloatArray
    node_snr: FloatArray

    @staticmethod
    @lru_cache(maxsize=64)
    def of(pulses: int, false_alarm_probability: float, model: str) -> _Equation:
        inverse_k = {
            "swerling0": 0.0,
            "swerling1": 1.0,
            "swerling2": 1.0 / pulses,
            "swerling3": 0.5,
            "swerling4": 0.5 / pulses,
        }[model]
        # Two branches that meet in the step: the knee is a node of both.
        pd = np.concatenate(
            [np.linspace(_PD_RANGE[0], _KNEE, _NODES), np.linspace(_KNEE, _PD_RANGE[1], _NODES)]
        )
        upper = np.repeat([False, True], _NODES)
        bare = _Equation(float(pulses), false_alarm_probability, inverse_k, pd, pd)
        return _Equation(
            float(pulses), false_alarm_probability, inverse_k, pd, bare.required_snr(pd, upper)
        )

    def required_snr(self, pd: FloatArray, upper: np.ndarray) -> FloatArray:
        """Return the SNR per pulse for `pd`; `upper` selects the branch above the knee."""
        pfa, n = self.false_alarm_probability, self.pulses
        alpha = 0.0 if n < 40 else 0.25
        side = np.sqrt(-0.8 * np.log(np.minimum(4.0 * pd * (1.0 - pd), 1.0)))
        eta = math.sqrt(-0.8 * math.log(4.0 * pfa * (1.0 - pfa))) + np.sign(pd - 0.5) * side
        steady = eta * (eta + 2.0 * math.sqrt(0.5 * n + (alpha - 0.25)))
        loss_db = ((17.7006 * pd - 18.4496) * pd + 14.5339) * pd - 3.525
        more_db = np.exp(27.31 * pd - 25.14) + (pd - 0.8) * (
            0.7 * math.log(1e-5 / pfa) + (2.0 * n - 20.0) / 80.0
        )
        loss_db = self.inverse_k * (loss_db + np.where(upper, more_db, 0.0))
        return np.exp(loss_db * (math.log(10.0) / 10.0)) * steady / n

    def invert(self, snr: FloatArray) -> FloatArray:
        """Return the Pd whose required SNR is `snr`, by the secant between two nodes and on."""
        left = np.searchsorted(self.node_snr, snr, side="right") - 1
        left = np.minimum(np.maximum(left, 0), self.node_snr.size - 2)
        upper = left >= _NODES
        # On the step both nodes have the same Pd, and the interval stays a point.
        p0, p1 = self.node_pd[left], self.node_pd[left + 1]
        s0, s1 = self.node_snr[left], self.node_snr[left + 1]
        for _ in range(_STEPS):
            rise = np.where(s1 > s0, s1 - s0, 1.0)
            guess = p0 + (p1 - p0) * ((snr - s0) / rise)
            guess = np.minimum(np.maximum(guess, _PD_RANGE[0]), _PD_RANGE[1])
            p0, s0, p1, s1 = p1, s1, guess, self.required_snr(guess, upper)
        return p1
