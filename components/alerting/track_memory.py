"""What an alerting logic remembers of tracks, of many runs, by their numbers."""

import numpy as np

from components.alerting.memory import AlertMemory, MemoryRule
from dsa_des.arrays.types import BoolArray, FloatArray, IntArray

# Numbers of tracks stay below this; a key holds the run above it.
_MOST_TRACKS = 1 << 40


class TrackMemory:
    """The memories of tracks; a track that was gone for longer than anything lasts is new.

    Parameters
    ----------
    rule : MemoryRule
    """

    def __init__(self, rule: MemoryRule) -> None:
        self._rule = rule
        #: Run and number of each track that is remembered, ascending, and when it was last there.
        self._key: IntArray = np.empty(0, dtype=np.int64)
        self._seen_s: FloatArray = np.empty(0)
        self._memory = AlertMemory(rule, 0)

    def __len__(self) -> int:
        """Return how many tracks are remembered."""
        return len(self._key)

    def levels(
        self,
        run: IntArray,
        number: IntArray,
        now_s: FloatArray,
        due: BoolArray,
        early: BoolArray,
    ) -> IntArray:
        """Take in tracks at some instants and return the level of each, (n,).

        Parameters
        ----------
        run, number : (n,) of int
            Runs ascending; the instants of a run in order.
        now_s : (n,)
        due, early : (n, levels) of bool
            As `AlertMemory.step` has them.
        """
        key = run * _MOST_TRACKS + number
        level = np.zeros(len(key), dtype=np.int64)
        if len(key) == 0:
            return level
        order = np.argsort(key, kind="stable")
        begins = np.append(True, key[order][1:] != key[order][:-1])
        place = np.empty(len(key), dtype=np.int64)
        place[order] = self._places(key[order][begins])[np.cumsum(begins) - 1]
        turn = np.empty(len(key), dtype=np.int64)
        turn[order] = np.arange(len(key)) - np.flatnonzero(begins)[np.cumsum(begins) - 1]
        turns = np.argsort(turn, kind="stable")
        for rows in np.split(turns, np.cumsum(np.bincount(turn))[:-1]):
            part = self._memory.take(place[rows])
            there = np.ones(len(rows), dtype=bool)
            level[rows] = part.step(now_s[rows], there, due[rows], early[rows])
            self._memory.put(place[rows], part)
        self._seen_s[place] = now_s  # the last of each counts
        return level

    def forget(self, runs: IntArray, times_s: FloatArray) -> None:
        """Forget tracks that were gone for too long.

        Parameters
        ----------
        runs : (n,) of int
            Ascending.
        times_s : (n,)
            What time it is in them.
        """
        of = self._key // _MOST_TRACKS
        last = np.minimum(np.searchsorted(runs, of), len(runs) - 1)
        away_s = np.where(runs[last] == of, times_s[last] - self._seen_s, 0.0)
        self._remember(np.flatnonzero(away_s <= self._rule.hysteresis_s))

    def forget_before(self, run: int) -> None:
        """Forget the runs before one."""
        self._remember(np.flatnonzero(self._key >= run * _MOST_TRACKS))

    def _remember(self, which: IntArray) -> None:
        if len(which) < len(self._key):
            self._key, self._seen_s = self._key[which], self._seen_s[which]
            self._memory = self._memory.take(which)

    def _places(self, keys: IntArray) -> IntArray:
        """Return the places of tracks (ascending), all of them remembered from now on."""
        if not np.isin(keys, self._key).all():
            every = np.union1d(self._key, keys)
            old = np.searchsorted(every, self._key)
            memory, seen_s = AlertMemory(self._rule, len(every)), np.full(len(every), -np.inf)
            memory.put(old, self._memory)
            seen_s[old] = self._seen_s
            self._key, self._seen_s, self._memory = every, seen_s, memory
        return np.searchsorted(self._key, keys)
