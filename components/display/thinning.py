"""Leaving out marks that would lie on top of each other."""

import numpy as np

from dsa_des.arrays.types import FloatArray, IntArray


def staggered(along_px: FloatArray, spacing_px: float, phase: float) -> IntArray:
    """Return the indices of marks about `spacing_px` apart along a path.

    Several sensors that mark the same path take turns on it, so that their marks alternate
    instead of covering each other; every mark stays where it belongs.

    Parameters
    ----------
    along_px : (points,)
        Where each point lies along the path, ascending; NaN is left out.
    spacing_px : float
    phase : float
        Where in the spacing this sensor's turn is, as a share of it.

    Returns
    -------
    (kept,) of int
        Ascending; the first point is always among them, and a gap stays a gap.
    """
    known = np.flatnonzero(np.isfinite(along_px))
    bins = np.floor(along_px[known] / spacing_px - phase)
    return known[np.diff(bins, prepend=-np.inf) > 0]


def evenly(count: int, most: int) -> IntArray:
    """Return at most `most` indices spread over ``range(count)``, with both ends."""
    if count <= most:
        return np.arange(count)
    return np.linspace(0, count - 1, most).astype(np.int64)


def by_target(target: IntArray) -> list[tuple[int, IntArray]]:
    """Return each target that occurs and its rows, ascending."""
    order = np.argsort(target, kind="stable")
    starts = np.flatnonzero(np.diff(target[order], prepend=-1))
    return [(int(target[rows[0]]), rows) for rows in np.split(order, starts[1:]) if len(rows)]
