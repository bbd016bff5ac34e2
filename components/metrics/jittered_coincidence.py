"""The share of meetings of two clocks that jitter or run at slightly wrong rates.

Between the grid instants everything is exact ticks; jitter is normal and independent from scan to
scan, so the difference of two instants is normal about the grid's difference.
"""

import math

import numpy as np
from scipy.special import ndtr

from dsa_des.arrays.types import FloatArray, IntArray
from dsa_des.time.clock import ClockSpec, ScanClock

#: Beyond so many standard deviations nothing is expected to happen.
_SIGMAS = 6.0


def mean_coincidence_share(
    own: ClockSpec,
    other: ClockSpec,
    *,
    ticks_per_s: int,
    end_tick: int,
    gate_ticks: int,
    delay_ticks: int = 0,
    other_delay_ticks: int = 0,
) -> float | None:
    """Return the expected share of a clock's scans that meet a scan of the other one.

    Parameters
    ----------
    own, other : ClockSpec
        The clock whose scans are counted, and the one that must have a scan near them.
    ticks_per_s : int
    end_tick : int
        Scans and arrivals before it count: drift makes the share depend on how long a run is.
    gate_ticks : int
        Largest distance of the two arrivals, inclusive.
    delay_ticks, other_delay_ticks : int
        Time from a scan to its arrival.

    Returns
    -------
    float or None
        None where two scans of one clock may lie in one gate: the probabilities of single pairs
        do not add up then.
    """
    for clock in (own, other):
        if 2 * gate_ticks + _SIGMAS * clock.jitter_s * ticks_per_s >= clock.period_s * ticks_per_s:
            return None
    sigma = math.hypot(own.jitter_s, other.jitter_s) * ticks_per_s
    mine = _grid(own, ticks_per_s, end_tick) + delay_ticks
    theirs = _grid(other, ticks_per_s, end_tick) + other_delay_ticks
    theirs = theirs[theirs < end_tick]
    if not len(mine) or not len(theirs):
        return None
    after = np.searchsorted(theirs, mine)
    share = np.zeros(len(mine))
    period_ticks = float(other.period_s * ticks_per_s)
    reach = 1 + math.ceil((gate_ticks + _SIGMAS * sigma) / period_ticks)
    for step in range(-reach, reach):
        place = after + step
        there = np.flatnonzero((place >= 0) & (place < len(theirs)))
        share[there] += _within(theirs[place[there]] - mine[there], gate_ticks, sigma)
    return float(np.mean(np.minimum(share, 1.0)))


def _grid(spec: ClockSpec, ticks_per_s: int, end_tick: int) -> IntArray:
    return ScanClock(spec, ticks_per_s).between(0, end_tick)[1]


def _within(apart: IntArray, gate: int, sigma: float) -> FloatArray:
    """Return the probability that a distance with normal error lies within the gate."""
    if sigma == 0.0:
        return np.asarray(np.abs(apart) <= gate, dtype=float)
    return np.asarray(ndtr((gate - apart) / sigma) - ndtr((-gate - apart) / sigma))
