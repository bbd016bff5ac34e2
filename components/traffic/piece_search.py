"""The piece of its own path that each aircraft is on, for many aircraft at once."""

import numpy as np

from components.geometry.angles import FloatArray
from dsa_des.arrays.types import IntArray


class PieceSearch:
    """The pieces of many paths, laid end to end.

    Parameters
    ----------
    starts_s : sequence of ndarray
        For each aircraft the times at which its pieces start, strictly increasing, at least one.
    """

    def __init__(self, starts_s: list[FloatArray]) -> None:
        lengths = np.array([len(starts) for starts in starts_s], dtype=np.int64)
        ends = np.cumsum(lengths)
        self.starts_s = np.concatenate([*starts_s, np.empty(0)])
        #: Index of each aircraft's first and last piece among all.
        self.first, self.last = ends - lengths, ends - 1
        self._steps = int(lengths.max(initial=1) - 1).bit_length()

    @classmethod
    def joined(cls, one: "PieceSearch", other: "PieceSearch") -> "PieceSearch":
        """Return the search for the paths of both, those of `other` after those of `one`."""
        search = cls([])
        search.starts_s = np.concatenate([one.starts_s, other.starts_s])
        search.first = np.concatenate([one.first, other.first + len(one.starts_s)])
        search.last = np.concatenate([one.last, other.last + len(one.starts_s)])
        search._steps = max(one._steps, other._steps)
        return search

    @classmethod
    def of_one_each(cls, aircraft: int) -> "PieceSearch":
        """Return the search for paths of one piece, which starts at 0."""
        search = cls([])
        search.starts_s = np.zeros(aircraft)
        search.first = search.last = np.arange(aircraft)
        return search

    def __call__(self, aircraft: IntArray, time_s: FloatArray) -> IntArray:
        """Return the last piece that starts at or before a time, the first piece before them all.

        Parameters
        ----------
        aircraft : (n,) of int
        time_s : (n,)
            On the clock of `starts_s`.

        Returns
        -------
        (n,) of int
            Index into all pieces.
        """
        low, high = self.first[aircraft], self.last[aircraft]
        for _ in range(self._steps):
            middle = (low + high + 1) // 2
            begun = self.starts_s[middle] <= time_s
            low = np.where(begun, middle, low)
            high = np.where(begun, high, np.maximum(middle - 1, low))
        return low
