"""A table of Pd, for many echoes of one radar at a fraction of the exact cost.

The table is indexed by the bits of the SNR itself: exponent and leading bits of a double are the
number of the cell, so there is no logarithm and no search. Each octave of SNR has 64 cells; a cell
holds the cubic through four exact values.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from components.arguments.checks import FloatArray
from components.radar.detection_exact import exact_probability

_CELL_BITS = 6
_CELLS_PER_OCTAVE = 1 << _CELL_BITS
_SHIFT = 52 - _CELL_BITS
_BIAS = 1023

# The table spans the octaves in which Pd is this far from its two ends.
_END = 1e-8
_OCTAVES = np.arange(-120, 120)


@dataclass(frozen=True)
class DetectionTable:
    """Hold the cells from `lowest` on; cell i is value + t (a + t (b + t c)), t from 0 to 1."""

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
    """Return Pd from a table that is built at the first call and remembered.

    Absolute error below 1e-6 over all SNR (worst measured 2.9e-8 over the five models, pulses 1 to
    1000 and Pfa 1e-12 to 0.1), Pfa at SNR 0, rising with SNR up to one rounding, never outside
    [Pfa, 1]. About 30 ns per element; building takes some 10 ms and 200 kB.

    Parameters
    ----------
    snr : (m,) contiguous array, linear, 0 or more
    pulses, false_alarm_probability, model
        Checked and canonical.

    Returns
    -------
    (m,) array
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
    place = np.tile(np.arange(_CELLS_PER_OCTAVE), high - low)
    width = np.ldexp(1.0 / _CELLS_PER_OCTAVE, octave)
    left = np.ldexp(1.0 + place / _CELLS_PER_OCTAVE, octave)
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
