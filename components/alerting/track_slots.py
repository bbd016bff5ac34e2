"""Which place of a memory each track has; places of tracks that are gone are given again."""

import numpy as np

from dsa_des.arrays.types import IntArray


class TrackSlots:
    """Places 0, 1, ... of tracks by their numbers."""

    def __init__(self) -> None:
        self._number: IntArray = np.empty(0, dtype=np.int64)
        self._seen_s = np.empty(0)

    def of(
        self, numbers: IntArray, times: list[float], forgotten_s: float
    ) -> tuple[IntArray, IntArray]:
        """Return the track at every place, and the places that are given to new ones.

        Parameters
        ----------
        numbers : (tracks,) of int
            That are there at some time between the first and the last.
        times : list of float
            Ascending, s.
        forgotten_s : float
            After so long without a track its place is free.
        """
        known = np.isin(numbers, self._number)
        gone = ~np.isin(self._number, numbers)
        free = np.flatnonzero(gone & (times[0] - self._seen_s > forgotten_s))
        coming = numbers[~known]
        more = max(len(coming) - len(free), 0)
        start = len(self._number)
        self._number = np.concatenate([self._number, np.full(more, -1)])
        self._seen_s = np.concatenate([self._seen_s, np.full(more, -np.inf)])
        given = np.concatenate([free, np.arange(start, start + more)])[: len(coming)]
        self._number[given] = coming
        self._seen_s[np.isin(self._number, numbers)] = times[-1]
        return self._number.copy(), given
