"""When flights of any shape come into a cylinder: time is halved, with the largest speed as proof.

Two aircraft that are d apart at the middle of an interval of length 2h stay farther apart than
d - v·h all through it, and nearer than d + v·h, with v the largest speed at which they can close
in. So an interval is surely outside the cylinder, surely inside, or is cut in two; recorded
samples, legs and turns are all alike, and nothing between samples is missed.
"""

from collections.abc import Callable

import numpy as np

from dsa_des.arrays.types import BoolArray, FloatArray, IntArray

#: Intervals are cut down to this, s.
FINEST_S = 1e-3
# Flights along the very edge would be cut up all the way: with so many pieces it ends.
_MOST_PIECES = 100_000
_FIRST_PIECES = 64
_PAIRS_AT_ONCE = 128


def first_inside_cylinder(
    apart: Callable[[IntArray, FloatArray], tuple[FloatArray, FloatArray]],
    between_s: tuple[FloatArray, FloatArray],
    closing_mps: FloatArray,
    horizontal_m: float,
    vertical_m: float,
) -> FloatArray:
    """Return when pairs of flights first are inside a cylinder, s; NaN for those that never are.

    The boundary is outside. Each is within `FINEST_S` of the true one. Where a flight comes inside
    for less than that, it may be left out: it is then inside by no more than `closing_mps` times
    half of `FINEST_S`, 0.1 m at 200 m/s. Where more than 100,000 pieces along the edge would have
    to be cut, their length stands for `FINEST_S`.

    Parameters
    ----------
    apart : callable
        Horizontal distance and difference in height (m, not negative) of pairs (n,) at times (n,).
    between_s : two of (pairs,)
        The times looked at.
    closing_mps : (pairs,)
        Neither distance changes faster.
    horizontal_m, vertical_m : float
        Radius and half of the height.
    """
    begin_s, end_s = between_s
    if len(begin_s) > _PAIRS_AT_ONCE:  # flights along the very edge would take all of the memory
        rest = (begin_s[_PAIRS_AT_ONCE:], end_s[_PAIRS_AT_ONCE:])
        return np.concatenate([
            first_inside_cylinder(
                apart, (begin_s[:_PAIRS_AT_ONCE], end_s[:_PAIRS_AT_ONCE]),
                closing_mps[:_PAIRS_AT_ONCE], horizontal_m, vertical_m,
            ),
            first_inside_cylinder(
                lambda pair, time_s: apart(pair + _PAIRS_AT_ONCE, time_s), rest,
                closing_mps[_PAIRS_AT_ONCE:], horizontal_m, vertical_m,
            ),
        ])  # fmt: skip
    earliest = np.full(len(begin_s), np.inf)
    length = (end_s - begin_s) / _FIRST_PIECES
    looked_at = np.flatnonzero(end_s >= begin_s)
    pair = np.repeat(looked_at, _FIRST_PIECES)
    number = np.tile(np.arange(_FIRST_PIECES, dtype=np.float64), len(looked_at))
    start: FloatArray = begin_s[pair] + length[pair] * number
    while len(start):
        half = 0.5 * length
        across_m, high_m = apart(pair, start + half[pair])
        drift_m = (closing_mps * half)[pair]
        maybe, within = _judged(across_m, high_m, drift_m, horizontal_m, vertical_m)
        pieces = np.bincount(pair[maybe], minlength=len(length))
        last = ((length <= FINEST_S) | (2 * pieces > _MOST_PIECES))[pair]
        inside = (across_m < horizontal_m) & (high_m < vertical_m)
        within, maybe = np.where(last, inside, within), np.where(last, inside, maybe)
        np.minimum.at(earliest, pair[within], start[within])
        cut = maybe & ~within & (start < earliest[pair])
        pair, start = pair[cut], start[cut]
        start = np.concatenate([start, start + half[pair]])
        pair = np.concatenate([pair, pair])
        length = half
    return np.where(np.isfinite(earliest), earliest, np.nan)


def _judged(
    across_m: FloatArray,
    high_m: FloatArray,
    drift_m: FloatArray | float,
    horizontal_m: float,
    vertical_m: float,
) -> tuple[BoolArray, BoolArray]:
    """Return which pieces may hold a time inside, and which are surely inside all through."""
    maybe = (across_m - drift_m < horizontal_m) & (high_m - drift_m < vertical_m)
    within = (across_m + drift_m <= horizontal_m) & (high_m + drift_m <= vertical_m)
    return maybe, within
