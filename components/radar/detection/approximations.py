"""Approximations of Pd: a table, and the equations of Albersheim, Shnidman and the thesis.

The table is indexed by the bits of the SNR itself: exponent and leading bits of a double are the
number of the cell, so there is no logarithm and no search. Each octave of SNR has 64 cells; a cell
holds the cubic through four exact values.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from components.arguments.checks import FloatArray
from components.radar.detection.exact import exact_probability
from components.radar.detection.threshold import threshold_of

_ALBERSHEIM_PD_RANGE = (0.1, 0.9)
_ALBERSHEIM_PFA_RANGE = (1e-7, 1e-3)
_ALBERSHEIM_MOST_PULSES = 8096


def albersheim_probability(
    snr: FloatArray, pulses: int, false_alarm_probability: float, model: str
) -> FloatArray:
    """Return a steady target's probability of detection, by inverting Albersheim's equation.

    Stated validity: swerling0, Pd 0.1 to 0.9, Pfa 1e-7 to 1e-3, 1 to 8096 pulses; outside it is
    refused. It claims 0.2 dB and was fitted to a linear detector. Against the exact square-law
    detector we measure 0.08 dB at 1 pulse and Pd above 0.5, 0.33 dB over all pulses and Pd above
    0.3, but 0.9 dB at Pd 0.2 and 4.1 dB at Pd 0.1 (1 pulse, Pfa 1e-3). Worst absolute error of Pd:
    0.11 (8096 pulses, Pfa 1e-7).

    W. J. Albersheim, "A closed-form approximation to Robertson's detection characteristics", Proc.
    IEEE 69 (7), 1981: with A = ln(0.62/Pfa) and B = ln(Pd/(1-Pd)), SNR_dB = -5 log10 n + (6.2 +
    4.54/sqrt(n + 0.44)) log10(A + 0.12 A B + 1.7 B).
    """
    if model != "swerling0":
        raise ValueError(
            f"model is {model!r}: method 'albersheim' must be used with swerling0 (swerling5)"
        )
    low, high = _ALBERSHEIM_PFA_RANGE
    if not low <= false_alarm_probability <= high:
        raise ValueError(
            f"false_alarm_probability is {false_alarm_probability:g}: it must lie in "
            f"[{low:g}, {high:g}] for method 'albersheim'"
        )
    if pulses > _ALBERSHEIM_MOST_PULSES:
        raise ValueError(
            f"pulses is {pulses}: it must be at most {_ALBERSHEIM_MOST_PULSES} "
            "for method 'albersheim'"
        )
    a = math.log(0.62 / false_alarm_probability)
    span = 6.2 + 4.54 / math.sqrt(pulses + 0.44)
    gain = 5.0 * math.log10(pulses)

    def required_db(pd: float) -> float:
        b = math.log(pd / (1.0 - pd))
        return span * math.log10(a + 0.12 * a * b + 1.7 * b) - gain

    low_db, high_db = (required_db(pd) for pd in _ALBERSHEIM_PD_RANGE)
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


def gram_charlier_probability(
    snr: FloatArray, pulses: int, false_alarm_probability: float, model: str
) -> FloatArray:
    """Return Pd of a steady target by three terms of the Gram-Charlier series, clipped to [0, 1].

    Covers swerling0 only: the thesis gives the series' constants for no other model. Any number of
    pulses and any Pfa, but it is an approximation: worst absolute error over all SNR and Pfa of
    1e-12 to 0.1, 0.025 at 1 pulse, 0.010 at 2, 0.003 at 5, 0.001 at 10 and 5e-5 at 100 (at Pfa
    1e-4: 0.0062, 0.0039, 0.0017, 0.0008 and 5e-5); before clipping it exceeds 1 by up to 0.001, and
    it is not monotonic in SNR nor bounded by Pfa.

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


_SHNIDMAN_PD_RANGE = (0.1, 0.99)
_SHNIDMAN_PFA_RANGE = (1e-9, 1e-3)
_SHNIDMAN_MOST_PULSES = 100
# Above this Pd the equation adds a second correction, with a step.
_KNEE = 0.872
_NODES = 256
_STEPS = 5


def shnidman_probability(
    snr: FloatArray, pulses: int, false_alarm_probability: float, model: str
) -> FloatArray:
    """Return Pd by inverting Shnidman's equation for the SNR required.

    Stated validity, outside of which it is refused: all Swerling models, Pd 0.1 to 0.99, Pfa 1e-9
    to 1e-3, 1 to 100 pulses. Measured worst absolute error of Pd within that, for swerling0 … 4:
    0.052, 0.036, 0.048, 0.045, 0.042; of the SNR required: 0.3, 1.2, 1.2, 0.7, 0.6 dB. The inverse
    itself is good to 2e-8.

    D. A. Shnidman, "Determination of required SNR values", IEEE Trans. Aerospace and Electronic
    Systems 38 (3), 2002. The required SNR steps up at Pd 0.872; within that step Pd is 0.872.
    """
    low, high = _SHNIDMAN_PFA_RANGE
    if not low <= false_alarm_probability <= high:
        raise ValueError(
            f"false_alarm_probability is {false_alarm_probability:g}: it must lie in "
            f"[{low:g}, {high:g}] for method 'shnidman'"
        )
    if pulses > _SHNIDMAN_MOST_PULSES:
        raise ValueError(
            f"pulses is {pulses}: it must be at most {_SHNIDMAN_MOST_PULSES} for method 'shnidman'"
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
    return equation.pd_at_snr(snr)


@dataclass(frozen=True)
class _Equation:
    """Shnidman's equation for one radar and fluctuation model, with starts for its inversion."""

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
            [
                np.linspace(_SHNIDMAN_PD_RANGE[0], _KNEE, _NODES),
                np.linspace(_KNEE, _SHNIDMAN_PD_RANGE[1], _NODES),
            ]
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

    def pd_at_snr(self, snr: FloatArray) -> FloatArray:
        """Return the Pd at which the required SNR is `snr`, found by secant steps."""
        left = np.searchsorted(self.node_snr, snr, side="right") - 1
        left = np.minimum(np.maximum(left, 0), self.node_snr.size - 2)
        upper = left >= _NODES
        # On the step both nodes have the same Pd, and the interval stays a point.
        p0, p1 = self.node_pd[left], self.node_pd[left + 1]
        s0, s1 = self.node_snr[left], self.node_snr[left + 1]
        for _ in range(_STEPS):
            rise = np.where(s1 > s0, s1 - s0, 1.0)
            guess = p0 + (p1 - p0) * ((snr - s0) / rise)
            guess = np.minimum(np.maximum(guess, _SHNIDMAN_PD_RANGE[0]), _SHNIDMAN_PD_RANGE[1])
            p0, s0, p1, s1 = p1, s1, guess, self.required_snr(guess, upper)
        return p1


_CELL_BITS = 6
_CELLS_PER_OCTAVE = 1 << _CELL_BITS
_SHIFT = 52 - _CELL_BITS
_BIAS = 1023

# The table spans the octaves in which Pd is this far from its two ends.
_END = 1e-8
_OCTAVES = np.arange(-120, 120)


@dataclass(frozen=True)
class DetectionTable:
    """Table of Pd over SNR in cubic pieces: value + t (a + t (b + t c)) in a cell, t in [0, 1]."""

    false_alarm_probability: float
    lowest: float
    highest: float
    at_lowest: float
    first_cell: int
    edge: FloatArray
    left: FloatArray
    width: FloatArray
    a: FloatArray
    b: FloatArray
    c: FloatArray


def table_probability(
    snr: FloatArray, pulses: int, false_alarm_probability: float, model: str
) -> FloatArray:
    """Return Pd interpolated from a table, which is built at the first call and kept.

    Absolute error below 1e-6 over all SNR (worst measured 2.9e-8 over the five models, pulses 1 to
    1000 and Pfa 1e-12 to 0.1), Pfa at SNR 0, rising with SNR up to one rounding, never outside
    [Pfa, 1]. About 30 ns per element; building takes some 10 ms and 200 kB.
    """
    table = detection_table(pulses, false_alarm_probability, model)
    inside = np.minimum(np.maximum(snr, table.lowest), np.nextafter(table.highest, 0.0))
    cell = (inside.view(np.int64) >> _SHIFT) - table.first_cell
    t = (inside - table.left[cell]) / table.width[cell]
    value = table.edge[cell]
    result = value + t * (table.a[cell] + t * (table.b[cell] + t * table.c[cell]))
    result = np.minimum(np.maximum(result, value), table.edge[cell + 1])
    # Left of the table Pd is as good as linear in SNR; right of it, as good as 1.
    pfa = table.false_alarm_probability
    share = np.minimum(snr, table.lowest) / table.lowest
    result = np.where(snr < table.lowest, pfa + share * (table.at_lowest - pfa), result)
    return np.where(snr >= table.highest, 1.0, result)


@lru_cache(maxsize=64)
def detection_table(pulses: int, false_alarm_probability: float, model: str) -> DetectionTable:
    """Build the table of one model, number of pulses and false-alarm probability."""

    def exact(snr: FloatArray, miss: bool = False) -> FloatArray:
        return exact_probability(snr, pulses, false_alarm_probability, model, miss=miss)

    powers = np.ldexp(1.0, _OCTAVES)
    rise = exact(powers) - false_alarm_probability
    start = int(np.flatnonzero(rise <= _END)[-1])
    stop = int(np.flatnonzero(exact(powers, miss=True) <= _END)[0])
    low, high = int(_OCTAVES[start]), int(_OCTAVES[stop])

    octave = np.repeat(np.arange(low, high), _CELLS_PER_OCTAVE)
    part = np.tile(np.arange(_CELLS_PER_OCTAVE), high - low)
    width = np.ldexp(1.0 / _CELLS_PER_OCTAVE, octave)
    left = np.ldexp(1.0 + part / _CELLS_PER_OCTAVE, octave)
    knots = left[:, None] + width[:, None] * (np.arange(3) / 3.0)
    values = exact(np.append(knots.reshape(-1), powers[stop]))
    edge = np.append(values[0:-1:3], values[-1])
    edge = np.maximum.accumulate(edge)
    y0, y1, y2, y3 = edge[:-1], values[1:-1:3], values[2:-1:3], edge[1:]
    # The cubic through t = 0, 1/3, 2/3, 1.
    a = (-11.0 * y0 + 18.0 * y1 - 9.0 * y2 + 2.0 * y3) / 2.0
    b = (18.0 * y0 - 45.0 * y1 + 36.0 * y2 - 9.0 * y3) / 2.0
    c = (-9.0 * y0 + 27.0 * y1 - 27.0 * y2 + 9.0 * y3) / 2.0
    # Where rounding outweighs the rise, a straight line keeps the cell from falling.
    quadratic = 3.0 * c
    with np.errstate(divide="ignore", invalid="ignore"):  # c = 0 has no inner extremum
        turning = np.where(c != 0.0, -b / quadratic, -1.0)
    at_turning = np.where(
        (turning > 0.0) & (turning < 1.0), a + turning * (2.0 * b + turning * quadratic), 0.0
    )
    falls = (np.minimum(a, a + 2.0 * b + quadratic) < 0.0) | (at_turning < 0.0)
    flat = falls | (y3 - y0 < 1e-12)
    return DetectionTable(
        false_alarm_probability=false_alarm_probability,
        lowest=float(powers[start]),
        highest=float(powers[stop]),
        at_lowest=float(edge[0]),
        first_cell=(low + _BIAS) << _CELL_BITS,
        edge=edge,
        left=left,
        width=width,
        a=np.where(flat, y3 - y0, a),
        b=np.where(flat, 0.0, b),
        c=np.where(flat, 0.0, c),
    )
