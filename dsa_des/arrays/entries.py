"""Entries of rows: those of row i stand at ``offsets[i]:offsets[i + 1]``."""

import numpy as np

from dsa_des.arrays.types import IntArray


def offsets_of(row: IntArray, rows: int) -> IntArray:
    """Return the offsets of entries that belong to rows, given each entry's row, ascending.

    Parameters
    ----------
    row : (entries,) of int64
    rows : int
        How many rows there are.
    """
    offsets = np.zeros(rows + 1, dtype=np.int64)
    np.bincount(row, minlength=rows).cumsum(out=offsets[1:])
    return offsets


def row_of_entries(offsets: IntArray) -> IntArray:
    """Return the row of each entry; where none has two, much faster than repeating them."""
    counts = offsets[1:] - offsets[:-1]
    if counts.max(initial=0) > 1:
        return np.repeat(np.arange(len(counts)), counts)
    return (counts > 0).nonzero()[0]


def entries_of(offsets: IntArray, rows: slice | IntArray) -> tuple[IntArray, slice | IntArray]:
    """Return the offsets of some rows by themselves, and which entries are theirs."""
    if isinstance(rows, slice):
        start, stop, _ = rows.indices(len(offsets) - 1)
        stop = max(start, stop)
        first, last = int(offsets[start]), int(offsets[stop])
        return offsets[start : stop + 1] - first, slice(first, last)
    counts = offsets[rows + 1] - offsets[rows]
    new = np.concatenate(([0], np.cumsum(counts)))
    index = np.repeat(offsets[rows] - new[:-1], counts) + np.arange(new[-1])
    return new, index
