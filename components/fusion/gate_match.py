"""The nearest detection of another sensor within gates of time, angle and range."""

from typing import Any

import numpy as np

from components.geometry.directions import angle_by_haversine
from dsa_des.arrays.types import IntArray


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
) -> IntArray:
    """Return for each anchor the entry of the other sensor that belongs to it, or -1.

    Of the entries in the gates the latest ones count, and of those the one nearest in angle.

    Parameters
    ----------
    one, other : Detections
        With ``azimuth_rad``, ``elevation_rad`` and ``range_m`` per entry; range NaN where it is not
        measured.
    anchors : (n,)
        Entries of `one` that are asked about.
    anchor_ticks : (n,)
        When they arrived.
    other_ticks : (m,)
        When each entry of `other` arrived, ascending.
    gate_ticks : int
        Largest age; inclusive, as the other gates are.
    angle_gate_rad, range_gate_m : float
    """
    best = np.full(len(anchors), -1, dtype=np.int64)
    if len(other_ticks) == 0:
        return best
    first = np.searchsorted(other_ticks, anchor_ticks - gate_ticks, side="left")
    counts = np.searchsorted(other_ticks, anchor_ticks, side="right") - first
    counts = np.maximum(counts, 0)
    which = np.repeat(np.arange(len(anchors)), counts)
    start = np.repeat(np.cumsum(counts) - counts, counts)
    candidate = np.arange(len(which)) - start + np.repeat(first, counts)
    mine = anchors[which]
    apart_rad = angle_by_haversine(
        one.azimuth_rad[mine],
        one.elevation_rad[mine],
        other.azimuth_rad[candidate],
        other.elevation_rad[candidate],
    )
    apart_m = np.abs(one.range_m[mine] - other.range_m[candidate])
    # Where either has no range the difference is NaN, and the range gate is open.
    inside = np.flatnonzero((apart_rad <= angle_gate_rad) & ~(apart_m > range_gate_m))
    # Latest first, then nearest, then the sensor's own order; the first of each anchor counts.
    order = np.lexsort(
        (
            candidate[inside],
            apart_rad[inside],
            -other_ticks[candidate[inside]],
            which[inside],
        )
    )
    chosen = inside[order]
    anchor, place = np.unique(which[chosen], return_index=True)
    best[anchor] = candidate[chosen[place]]
    return best
