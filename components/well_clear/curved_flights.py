"""When flights of any shape are inside a cylinder: time is halved, with the largest speed as proof.

Two aircraft that are d apart at the middle of an interval of length 2h stay farther apart than
d - v·h all through it, and nearer than d + v·h, with v the largest speed at which they can close
in. So an interval is surely outside the cylinder, surely inside, or is cut in two; recorded
samples, legs and turns are all alike, and nothing between samples is missed.
"""

from collections.abc import Callable

import numpy as np

from dsa_des.arrays.types import FloatArray

#: Intervals are cut down to this, s.
FINEST_S = 1e-3
# Flights along the very edge would be cut up all the way: with so many pieces it ends.
_MOST_PIECES = 100_000
_FIRST_PIECES = 64


def cylinder_spans(
    apart: Callable[[FloatArray], tuple[FloatArray, FloatArray]],
    between_s: tuple[float, float],
    closing_mps: float,
    horizontal_m: float,
    vertical_m: float,
    *,
    first_only: bool = False,
) -> FloatArray:
    """Return from when to when two flights are inside a cylinder, its boundary left out.

    Parameters
    ----------
    apart : callable
        Horizontal distance and difference in height (m, not negative) at times (n,).
    between_s : (float, float)
        The times looked at.
    closing_mps : float
        Neither distance changes faster.
    horizontal_m, vertical_m : float
        Radius and half of the height.
    first_only : bool
        Whether the first span is enough; only its begin is right then.

    Returns
    -------
    (spans, 2)
        In order, s. Each begin and end is within `FINEST_S` of the true one. Where a flight comes
        inside for less than that, it may be left out: it is then inside by no more than
        `closing_mps` times half of `FINEST_S`, 0.1 m at 200 m/s. Where more than 100,000 pieces
        along the edge would have to be cut, their length stands for `FINEST_S`.
    """
    begin_s, end_s = between_s
    if not end_s >= begin_s:
        return np.empty((0, 2))
    length = (end_s - begin_s) / _FIRST_PIECES
    start: FloatArray = begin_s + length * np.arange(_FIRST_PIECES, dtype=np.float64)
    found = [np.empty((0, 2))]
    earliest = np.inf
    while len(start):
        half = 0.5 * length
        across_m, high_m = apart(start + half)
        drift_m = closing_mps * half
        maybe = (across_m - drift_m < horizontal_m) & (high_m - drift_m < vertical_m)
        within = (across_m + drift_m <= horizontal_m) & (high_m + drift_m <= vertical_m)
        if length <= FINEST_S or 2 * np.count_nonzero(maybe) > _MOST_PIECES:
            within = maybe = (across_m < horizontal_m) & (high_m < vertical_m)
        if within.any():
            earliest = min(earliest, float(start[within][0]))
            found.append(np.stack([start[within], start[within] + length], axis=1))
        cut = start[maybe & ~within & (not first_only or start < earliest)]
        start = np.sort(np.concatenate([cut, cut + half]))
        length = half
    spans = np.concatenate(found)
    return _joined(spans[np.argsort(spans[:, 0], kind="stable")])


def _joined(spans: FloatArray) -> FloatArray:
    """Return spans in order, those that touch as one."""
    if not len(spans):
        return spans
    apart = spans[1:, 0] > spans[:-1, 1] + 1e-9 * np.maximum(np.abs(spans[1:, 0]), 1.0)
    begins = np.concatenate([[True], apart])
    return np.stack([spans[begins, 0], spans[np.append(apart, True), 1]], axis=1)
