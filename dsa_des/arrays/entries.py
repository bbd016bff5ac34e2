"""Entries of rows: those of row i stand at ``offsets[i]:offsets[i + 1]``."""

import numpy as np

from dsa_des.arrays.types import BoolArray, IntArray


def offsets_from_entry_rows(row: IntArray, rows: int) -> IntArray:
    """Return the offsets (rows + 1,) of entries, given the ascending row number of each entry: row
    i has the entries from offsets[i] to before offsets[i + 1].
    """
    count = len(row)
    if count == 0:
        return np.zeros(rows + 1, dtype=np.int64)
    # Each number of entries stands as often as rows lie between two of them.
    gaps = np.empty(count + 1, dtype=np.int64)
    gaps[0], gaps[-1] = row[0] + 1, rows - row[-1]
    np.subtract(row[1:], row[:-1], out=gaps[1:-1])
    return np.arange(count + 1).repeat(gaps)


def rows_and_columns_of_true(mask: BoolArray) -> tuple[IntArray, IntArray]:
    """Return row and column indices of the True elements of a 2-D mask, row by row."""
    cell, width = mask.ravel().nonzero()[0], mask.shape[1]
    if len(mask) == 1:
        return np.zeros(len(cell), dtype=np.int64), cell
    if width < 2:
        return cell, np.zeros(len(cell), dtype=np.int64)
    row = cell // width
    return row, cell - row * width


def rows_of_entries(offsets: IntArray) -> IntArray:
    """Return the row number of each entry, given the offsets (rows + 1,) of the rows."""
    counts = offsets[1:] - offsets[:-1]
    if counts.max(initial=0) > 1:
        return np.arange(len(counts)).repeat(counts)
    return (counts > 0).nonzero()[0]


def selected_offsets_and_indices(
    offsets: IntArray, rows: slice | IntArray
) -> tuple[IntArray, slice | IntArray]:
    """Return (selected rows' offsets, from 0; indices of their entries, a slice if `rows` is)."""
    if isinstance(rows, slice):
        start, stop, _ = rows.indices(len(offsets) - 1)
        stop = max(start, stop)
        first, last = int(offsets[start]), int(offsets[stop])
        return offsets[start : stop + 1] - first, slice(first, last)
    counts = offsets[rows + 1] - offsets[rows]
    new = np.concatenate(([0], np.cumsum(counts)))
    index = np.repeat(offsets[rows] - new[:-1], counts) + np.arange(new[-1])
    return new, index
