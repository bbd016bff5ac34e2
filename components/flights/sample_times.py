"""The times at which distances are compared: a regular grid, or the times of recorded samples.

Neither is ever laid out in full: a flight of a month on a grid of tenths of a second has 26
million of them.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from dsa_des.arrays.types import FloatArray, IntArray


class PieceSearch:
    """The pieces of many paths, laid end to end."""

    def __init__(self, starts_s: FloatArray, counts: IntArray) -> None:
        ends = np.cumsum(counts)
        self.starts_s = starts_s
        #: Index of each aircraft's first and last piece among all.
        self.first, self.last = ends - counts, ends - 1
        self._steps = int(counts.max(initial=1) - 1).bit_length()

    @classmethod
    def of(cls, starts_s: Sequence[FloatArray]) -> "PieceSearch":
        """Return the search among the pieces of each."""
        counts = np.array([len(starts) for starts in starts_s], dtype=np.int64)
        return cls(np.concatenate([*starts_s, np.empty(0)]), counts)

    def __call__(self, aircraft: IntArray, time_s: FloatArray) -> IntArray:
        """Return the last piece that starts at or before a time, or the first one."""
        low, high = self.first[aircraft], self.last[aircraft]
        for _ in range(self._steps):
            middle = (low + high + 1) // 2
            begun = self.starts_s[middle] <= time_s
            low = np.where(begun, middle, low)
            high = np.where(begun, high, np.maximum(middle - 1, low))
        return low


_DIGITS = 9


def regular_times_s(step_s: float, number: IntArray) -> FloatArray:
    """Return the times of some places of a regular grid that starts at 0, s.

    They are rounded to nanoseconds, so that 0.1 s steps read 99.6 and not 99.60000000000001.
    """
    return np.round(number * step_s, _DIGITS)


def regular_count(step_s: float, duration_s: float) -> int:
    """Return how many places a regular grid over a duration has."""
    return int(duration_s / step_s) + 1


class SampleTimes(Protocol):
    """Times in order, for each of many targets."""

    def at(self, target: IntArray, number: IntArray) -> FloatArray:
        """Return the time (n,) of each target's sample of a number, s."""

    def between(
        self, target: IntArray, first_s: FloatArray, last_s: FloatArray
    ) -> tuple[IntArray, IntArray]:
        """Return the numbers of the first and the last sample in [first_s, last_s], all (n,).

        Where there is none, the last is below the first.
        """


@dataclass(frozen=True)
class RegularTimes:
    """Every target's times are one grid: 0, step, 2 step, ...

    Parameters
    ----------
    step_s : float
    duration_s : float
        The last time does not lie after it by more than rounding.
    """

    step_s: float
    duration_s: float

    def at(self, target: IntArray, number: IntArray) -> FloatArray:
        """Return the time of each sample."""
        return regular_times_s(self.step_s, number)

    def between(
        self, target: IntArray, first_s: FloatArray, last_s: FloatArray
    ) -> tuple[IntArray, IntArray]:
        """Return the numbers of the first and the last sample in each interval."""
        end = regular_count(self.step_s, self.duration_s) - 1
        guess = np.minimum(np.maximum(first_s, 0.0), self.duration_s) / self.step_s
        first = np.maximum(guess.astype(np.int64) - 1, 0)
        for _ in range(3):  # the division and the rounding are wrong by less than a step each
            first += self.at(target, first) < first_s
        guess = np.minimum(np.maximum(last_s, -self.step_s), self.duration_s) / self.step_s
        last = np.minimum(np.floor(guess).astype(np.int64) + 1, end)
        for _ in range(3):
            last -= self.at(target, last) > last_s
        return first, last


@dataclass(frozen=True, eq=False)
class SharedTimes:
    """Every target has the same times.

    Parameters
    ----------
    times_s : (samples,)
        Ascending.
    """

    times_s: FloatArray

    def at(self, target: IntArray, number: IntArray) -> FloatArray:
        """Return the time of each sample."""
        return self.times_s[number]

    def between(
        self, target: IntArray, first_s: FloatArray, last_s: FloatArray
    ) -> tuple[IntArray, IntArray]:
        """Return the numbers of the first and the last sample in each interval."""
        first = np.searchsorted(self.times_s, first_s, side="left")
        return first, np.searchsorted(self.times_s, last_s, side="right") - 1


class OwnTimes:
    """Every target has times of its own."""

    def __init__(self, times_s: Sequence[FloatArray]) -> None:
        self._find = PieceSearch.of(times_s)

    def at(self, target: IntArray, number: IntArray) -> FloatArray:
        """Return the time of each sample."""
        return self._find.starts_s[self._find.first[target] + number]

    def between(
        self, target: IntArray, first_s: FloatArray, last_s: FloatArray
    ) -> tuple[IntArray, IntArray]:
        """Return the numbers of the first and the last sample in each interval."""
        times_s, start = self._find.starts_s, self._find.first[target]
        first, last = self._find(target, first_s), self._find(target, last_s)
        first += times_s[first] < first_s
        last -= times_s[last] > last_s
        return first - start, last - start
