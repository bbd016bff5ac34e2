"""Keeping a bounded number of rows of many series, however many rows come."""

import numpy as np

from dsa_des.types import FloatArray, IntArray


class ThinnedStream:
    """Rows of many series that come piece by piece, of which no more are kept than fit.

    Every series keeps its first row and every n-th from there on, with n a power of two that
    follows from how many rows each series has. So what is kept rests on the rows, not on the
    pieces they came in, and a series with few rows keeps them beside one with millions.

    Parameters
    ----------
    most : int
        More rows than this are never kept, unless there are more series: each keeps one.
    columns : int
        Numbers per row.
    """

    def __init__(self, most: int, columns: int) -> None:
        self._most = most
        self._series: IntArray = np.empty(0, dtype=np.int64)
        #: How many rows of its series came before each row that is kept.
        self._number: IntArray = np.empty(0, dtype=np.int64)
        self._columns: list[FloatArray] = [np.empty(0) for _ in range(columns)]
        self._seen: IntArray = np.empty(0, dtype=np.int64)

    def add(self, series: IntArray, *columns: FloatArray) -> None:
        """Take rows, `most` or fewer at a time.

        Parameters
        ----------
        series : (rows,) of int
            Which series each row belongs to; 0, 1, 2, ... with none left out for long.
        *columns : (rows,)
        """
        new = int(series.max(initial=-1)) + 1 - len(self._seen)
        self._seen = np.concatenate((self._seen, np.zeros(max(0, new), dtype=np.int64)))
        number = self._seen[series] + places_in_groups(series)
        self._seen += np.bincount(series, minlength=len(self._seen))
        every = strides(self._seen, self._most)
        old, more = self._number % every[self._series] == 0, number % every[series] == 0
        self._series = np.concatenate((self._series[old], series[more]))
        self._number = np.concatenate((self._number[old], number[more]))
        self._columns = [
            np.concatenate((kept[old], column[more]))
            for kept, column in zip(self._columns, columns, strict=True)
        ]

    def rows(self) -> tuple[IntArray, list[FloatArray]]:
        """Return the series and the columns of the rows that are kept, in the order they came."""
        return self._series, self._columns


def strides(counts: IntArray, most: int) -> IntArray:
    """Return every how many rows of each series one is kept, a power of two.

    Series of up to some length keep all their rows, longer ones at most that length, such that
    all together keep `most`, or one each. Where any count grows, no stride shrinks.

    Parameters
    ----------
    counts : (series,) of int
        Rows of each.
    most : int
    """
    if int(counts.sum()) <= most:
        return np.ones(len(counts), dtype=np.int64)
    ascending = np.sort(counts)
    shorter = np.concatenate(([0], np.cumsum(ascending)[:-1]))
    # The length when the i-th and all longer series share what the shorter ones leave over.
    shared = (most - shorter) // np.arange(len(counts), 0, -1)
    longest = max(1, int(shared[np.argmax(shared < ascending)]))
    every: IntArray = np.ones(len(counts), dtype=np.int64)
    while (long := -(-counts // every) > longest).any():
        every[long] *= 2
    return every


def places_in_groups(group: IntArray) -> IntArray:
    """Return how many rows of its own group come before each row, shape (rows,)."""
    order = np.argsort(group, kind="stable")
    starts = np.flatnonzero(np.diff(group[order], prepend=-1))
    lengths = np.diff(starts, append=len(group))
    places = np.empty(len(group), dtype=np.int64)
    places[order] = np.arange(len(group)) - np.repeat(starts, lengths)
    return places
