"""The share of meetings of two periodic clocks within a gate, in exact rational numbers.

The scans of one clock fall on finitely many phases of the other's period: q equally spaced ones,
where f1/f2 = p/q in lowest terms. Counting them is exact.
"""

import math
from fractions import Fraction


def coincidence_share(
    rate_hz: Fraction,
    other_rate_hz: Fraction,
    *,
    offset_s: Fraction = Fraction(0),
    other_offset_s: Fraction = Fraction(0),
    before_s: Fraction = Fraction(0),
    after_s: Fraction = Fraction(0),
) -> Fraction:
    """Return the share of a clock's scans that have a scan of the other one near them.

    Parameters
    ----------
    rate_hz, offset_s : Fraction
        The clock whose scans are counted.
    other_rate_hz, other_offset_s : Fraction
        The clock that must have a scan at t - before_s ≤ t' ≤ t + after_s.
    before_s, after_s : Fraction
        0 or more; both bounds are inclusive.

    Returns
    -------
    Fraction
        In the long run, or over any whole number of beat periods.
    """
    period = 1 / other_rate_hz
    phases = (other_rate_hz / rate_hz).denominator
    spacing = period / phases
    phase = (offset_s - other_offset_s) % spacing
    if before_s + after_s >= period:
        return Fraction(1)
    # Phases are phase + j·spacing for j = 0 ... phases - 1; an earlier partner is that far away.
    early = _count(before_s, phase, spacing, phases)
    late = _count(after_s, (-phase) % spacing, spacing, phases)
    both = 1 if phase == 0 else 0  # the same instant is early and late
    return Fraction(min(phases, early + late - both), phases)


def _count(reach: Fraction, first: Fraction, spacing: Fraction, most: int) -> int:
    """Return how many of first, first + spacing, ... lie within reach, at most `most`."""
    if reach < first:
        return 0
    return min(most, math.floor((reach - first) / spacing) + 1)
