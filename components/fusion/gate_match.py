"""The nearest detection of another sensor within gates of time, angle and range."""

from collections.abc import Callable
from typing import Any

import numpy as np

from components.geometry.directions import angle_by_haversine
from dsa_des.arrays.types import FloatArray, IntArray

#: Given entries of one sensor and of another, pair by pair: azimuth, elevation and range of the
#: other one at the instant of the first.
Carried = Callable[[IntArray, IntArray], tuple[FloatArray, FloatArray, FloatArray]]


def nearest_in_gate(
    one: Any,
    anchors: IntArray,
    anchor_ticks: IntArray,
    other: Any,
    other_ticks: IntArray,
    *,
    gate_ticks: int,
    angle_gate_rad: float,
    range_gate_m: float,
    anchor_came: IntArray | None = None,
    other_came: IntArray | None = None,
    keep_ticks: int | None = None,
    carried: Carried | None = None,
) -> IntArray:
    """Return for each anchor the entry of the other sensor that belongs to it, or -1.

    Of the entries in the gates those nearest in time count, of these the one nearest in angle,
    then in range. Nothing but measured values decides.

    Parameters
    ----------
    one, other : Detections
        With ``azimuth_rad``, ``elevation_rad`` and ``range_m`` per entry; range NaN where it is not
        measured.
    anchors : (n,)
        Entries of `one` that are asked about.
    anchor_ticks : (n,)
        When they were measured.
    other_ticks : (m,)
        When each entry of `other` was measured.
    gate_ticks : int
        Farthest apart in time; inclusive, as the other gates are.
    angle_gate_rad, range_gate_m : float
    anchor_came, other_came : (n,) and (m,), optional
        When they arrived, where that is later: what comes after an anchor is not known to it.
    keep_ticks : int, optional
        How long before an anchor another entry may have come.
    carried : callable, optional
        Where the other entry would have been seen at the instant of the anchor.
    """
    best = np.full(len(anchors), -1, dtype=np.int64)
    if len(other_ticks) == 0:
        return best
    here = anchor_ticks if anchor_came is None else anchor_came
    there = other_ticks if other_came is None else other_came
    in_time = np.argsort(other_ticks, kind="stable")
    first = np.searchsorted(other_ticks[in_time], anchor_ticks - gate_ticks, side="left")
    counts = np.searchsorted(other_ticks[in_time], anchor_ticks + gate_ticks, side="right") - first
    which = np.repeat(np.arange(len(anchors)), counts)
    start = np.repeat(np.cumsum(counts) - counts, counts)
    candidate = in_time[np.arange(len(which)) - start + np.repeat(first, counts)]
    known = there[candidate] <= here[which]
    if keep_ticks is not None:
        known &= there[candidate] >= here[which] - keep_ticks
    which, candidate = which[known], candidate[known]
    mine = anchors[which]
    azimuth, elevation, range_m = (
        (other.azimuth_rad[candidate], other.elevation_rad[candidate], other.range_m[candidate])
        if carried is None
        else carried(mine, candidate)
    )
    apart_rad = angle_by_haversine(
        one.azimuth_rad[mine], one.elevation_rad[mine], azimuth, elevation
    )
    apart_m = np.abs(one.range_m[mine] - range_m)
    # Where either has no range the difference is NaN, and the range gate is open.
    inside = np.flatnonzero((apart_rad <= angle_gate_rad) & ~(apart_m > range_gate_m))
    late = np.abs(other_ticks[candidate[inside]] - anchor_ticks[which[inside]])
    # The first of each anchor counts. A sensor's own order would tell who is who, so that alike
    # ones are told apart by what was measured of them, as long as that differs.
    order = np.lexsort(
        (
            candidate[inside],
            range_m[inside],
            elevation[inside],
            azimuth[inside],
            apart_m[inside],
            apart_rad[inside],
            late,
            which[inside],
        )
    )
    chosen = inside[order]
    anchor, place = np.unique(which[chosen], return_index=True)
    best[anchor] = candidate[chosen[place]]
    return best
