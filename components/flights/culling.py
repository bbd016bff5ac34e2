"""Targets that a sensor may look at, with the largest speeds as proof.

Of an ownship whose flight is known, time is halved until a target is surely near or surely not.
Around one that is steered, time falls into epochs of a few seconds: until the end of one it and a
target cannot close in by more than their two largest speeds allow. What a row holds follows from
its own epoch and so does not depend on the window that it is in.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from components.flights.fleet import Fleet
from components.geometry import line_of_sight
from dsa_des.arrays.types import BoolArray, FloatArray, IntArray

FINEST_S = 0.5
# The speeds of turns and long legs hold to 2e-4; a metre covers the rounding of positions, and
# a millisecond that of times.
_SPEED_MARGIN = 1.001
_RANGE_MARGIN_M = 1.0
_TIME_MARGIN_S = 1e-3
# Targets that fly along the very edge of the reach would be cut up all the way: it stops here.
_MOST_PIECES_PER_TARGET = 100


@dataclass(frozen=True, eq=False)
class NearIntervals:
    """Intervals of time in which targets may be near; outside them they are surely not.

    Parameters
    ----------
    target : (n,) of int
        Ascending.
    start_s, end_s : (n,)
        Both included; those of one target are in order and apart.
    """

    target: IntArray
    start_s: FloatArray
    end_s: FloatArray

    def during(self, first_s: float, last_s: float) -> IntArray:
        """Return the targets that may be near at some time in [first_s, last_s], ascending."""
        met = (self.start_s <= last_s) & (self.end_s >= first_s)
        return np.unique(self.target[met])

    def throughout(self, first_s: float, last_s: float) -> int:
        """Return how many targets may be near at every time in [first_s, last_s]."""
        return int(np.count_nonzero((self.start_s <= first_s) & (self.end_s >= last_s)))

    def at_each(self, columns: IntArray, first_s: FloatArray, last_s: FloatArray) -> BoolArray:
        """Return which targets may be near at some time of each of several looks, (rows, targets).

        Looks are in order; `columns` holds, ascending, all that are near in any of them.
        """
        met = (self.start_s <= last_s[-1]) & (self.end_s >= first_s[0])
        column = np.searchsorted(columns, self.target[met])
        change = np.zeros((len(first_s) + 1, len(columns)), dtype=np.int8)
        np.add.at(change, (np.searchsorted(last_s, self.start_s[met]), column), 1)
        ends = np.searchsorted(first_s, self.end_s[met], side="right")
        np.subtract.at(change, (ends, column), 1)
        near: BoolArray = np.cumsum(change[:-1], axis=0, dtype=np.int8) > 0
        return near

    def holds(self, target: IntArray, time_s: FloatArray, until_s: FloatArray) -> BoolArray:
        """Return whether each of some targets (n,) may be near at some time of its own look."""
        first = np.searchsorted(self.target, target)
        count = np.searchsorted(self.target, target, side="right") - first
        inside: BoolArray = np.zeros(len(target), dtype=bool)
        for k in range(int(count.max(initial=0))):
            rest = np.flatnonzero(count > k)
            one = first[rest] + k
            inside[rest] |= (self.start_s[one] <= until_s[rest]) & (time_s[rest] <= self.end_s[one])
        return inside

    def most_at_once(self) -> int:
        """Return the largest number of targets that may be near at one time."""
        times = np.concatenate([self.start_s, self.end_s])
        change = np.repeat([1, -1], len(self.target))
        order = np.lexsort((-change, times))
        return int(np.cumsum(change[order]).max(initial=0))


def near_intervals(
    range_at: Callable[[IntArray, FloatArray], FloatArray],
    *,
    closing_speed_mps: FloatArray,
    present_s: tuple[FloatArray, FloatArray],
    reach_m: float,
    end_s: float,
    of_run: int | None = None,
) -> NearIntervals:
    """Find when targets may be within a range of the ownship, between time 0 and an end.

    Every time at which a target is within `reach_m` lies in one of its intervals; they exceed the
    true ones by `FINEST_S` or less at each end (more only for a target that stays for long within a
    few metres of the edge). Where targets are those of many runs, `of_run` says how many each run
    has.
    """
    closing = closing_speed_mps * _SPEED_MARGIN
    target = np.arange(len(closing))
    piece: FloatArray = np.zeros(len(closing))
    found = [(target[:0], closing[:0], closing[:0])]
    length = float(end_s)
    while len(target):
        start: FloatArray = piece * length
        half = 0.5 * length
        range_m = range_at(target, start + half)
        drift = closing[target] * half + _RANGE_MARGIN_M
        there = (present_s[0][target] <= start + length) & (present_s[1][target] >= start)
        maybe = there & (range_m <= reach_m + drift)
        fine = length <= FINEST_S or _too_many(target, of_run or len(closing))
        settled = maybe & ((range_m <= reach_m - drift) | fine)
        found.append((target[settled], start[settled], start[settled] + length))
        cut = maybe & ~settled
        target, piece = np.repeat(target[cut], 2), np.repeat(2.0 * piece[cut], 2)
        piece[1::2] += 1
        length = half
    near, begin, end = (np.concatenate(parts) for parts in zip(*found, strict=True))
    start, end = np.maximum(begin, present_s[0][near]), np.minimum(end, present_s[1][near])
    some = start <= end
    return _merged(near[some], start[some], end[some])


def _too_many(target: IntArray, of_run: int) -> BoolArray:
    """Return for each piece whether its run has become too many of them."""
    run = target // of_run
    too_many: BoolArray = 2 * np.bincount(run) > _MOST_PIECES_PER_TARGET * of_run
    return too_many[run]


def range_between(
    own_at: Callable[[FloatArray], Any],
    targets_at: Callable[[IntArray, FloatArray], Any],
    target: IntArray,
    time_s: FloatArray,
) -> FloatArray:
    """Return the range from an ownship to targets (n,), each at a time (n,) of its own, m."""
    times, which = np.unique(time_s, return_inverse=True)
    own, other = own_at(times), targets_at(target, time_s)
    _, _, range_m = line_of_sight(
        own.lat_deg[which], own.lon_deg[which], own.alt_m[which],
        other.lat_deg, other.lon_deg, other.alt_m,
        validate=False,
    )  # fmt: skip
    return range_m


def _merged(target: IntArray, start_s: FloatArray, end_s: FloatArray) -> NearIntervals:
    order = np.lexsort((start_s, target))
    target, start_s, end_s = target[order], start_s[order], end_s[order]
    begins: BoolArray = np.ones(len(target), dtype=bool)
    begins[1:] = (target[1:] != target[:-1]) | (start_s[1:] > end_s[:-1] + _TIME_MARGIN_S)
    ends = np.roll(begins, -1)
    return NearIntervals(
        target[begins], start_s[begins] - _TIME_MARGIN_S, end_s[ends] + _TIME_MARGIN_S
    )


class Culling:
    """The targets that can come within a range of the ownship, by intervals of entry and exit.

    The intervals are found once, for all targets together; which targets a window needs is then
    a look at them, so the answer for an instant does not depend on how instants are grouped.
    """

    def __init__(
        self, own: Any, fleet: Fleet, reach_m: float, end_s: float, lasts_s: float = 0.0
    ) -> None:
        self.reach_m, self.lasts_s = reach_m, lasts_s
        there = fleet.intervals_present_s
        first, last = own.interval_present()
        self.intervals: NearIntervals = near_intervals(
            partial(range_between, own.at, fleet.each),
            closing_speed_mps=fleet.max_speeds_mps + own.max_speed_mps,
            present_s=(np.maximum(there[:, 0], first), np.minimum(there[:, 1], last)),
            reach_m=reach_m,
            end_s=end_s + lasts_s,
        )

    def active(self, first_s: float, last_s: float) -> IntArray:
        """Return the targets that may come in reach between two times, ascending."""
        return self.intervals.during(first_s, last_s + self.lasts_s)

    def near(self, columns: IntArray, time_s: FloatArray) -> BoolArray:
        """Return which targets may come in reach during a look from each time on.

        A window holds targets that are near at some of its instants; this says at which, so that
        what is counted does not depend on the window.
        """
        last_s = float(time_s.max())
        if self.intervals.throughout(float(time_s.min()) + self.lasts_s, last_s) == len(columns):
            return np.ones((len(time_s), len(columns)), dtype=bool)
        if bool((time_s[1:] >= time_s[:-1]).all()):
            return self.intervals.at_each(columns, time_s, time_s + self.lasts_s)
        order = np.argsort(time_s, kind="stable")  # replicas, one after the other
        near: BoolArray = np.empty((len(time_s), len(columns)), dtype=bool)
        near[order] = self.near(columns, time_s[order])
        return near


# An epoch lasts until the fastest target can have come nearer by this part of the reach.
_DRIFT_SHARE = 0.25
SHORTEST_EPOCH_S = 1.0
# Steering keeps the speed to 1e-4 unless another one is told.
_OWN_SPEED_MARGIN = 1.05


class SteeredCulling:
    """The targets near ownships that are steered, one in each run, by epochs of time.

    Parameters
    ----------
    own_mps : (runs,)
        Largest speeds of the ownships before they are steered.
    targets_mps : (runs, targets)
        Those of the targets of each run.
    reach_m : float
    """

    def __init__(self, own_mps: FloatArray, targets_mps: FloatArray, reach_m: float) -> None:
        self._own_mps, self._targets_mps, self.reach_m = own_mps, targets_mps, reach_m
        fastest = self._closing_mps(targets_mps, own_mps).max(axis=1, initial=1e-3)
        #: How long an epoch lasts around each ownship.
        self.epoch_s: FloatArray = np.maximum(SHORTEST_EPOCH_S, _DRIFT_SHARE * reach_m / fastest)
        # The last epoch that is known of each run, and ranges at its start.
        self._last: IntArray = np.full(len(own_mps), -1, dtype=np.int64)
        self._range_m: FloatArray = np.zeros_like(targets_mps)

    @staticmethod
    def _closing_mps(targets_mps: FloatArray, own_mps: FloatArray) -> FloatArray:
        """Return how fast ownships (n,) and targets (n, targets) can come nearer to each other."""
        return np.asarray(
            (targets_mps + own_mps[:, np.newaxis] * _OWN_SPEED_MARGIN) * _SPEED_MARGIN
        )

    def forget(self, run: IntArray) -> None:
        """Take note that the ownships of some runs fly on otherwise than was known."""
        self._last[run] = -1

    def near(
        self,
        run: IntArray,
        time_s: FloatArray,
        told_mps: FloatArray,
        range_m: Callable[[IntArray, IntArray, FloatArray], FloatArray],
    ) -> BoolArray:
        """Return which targets may be in reach at each row, (rows, targets).

        Parameters
        ----------
        run, time_s : (rows,)
            Ascending by run.
        told_mps : (rows,)
            Largest speed that the ownship was told to fly by then, or 0.
        range_m : callable
            Gives the ranges from ownships to targets of runs, numbered through, at times, all (n,).
        """
        width = self._targets_mps.shape[1]
        epoch = np.floor(time_s / self.epoch_s[run]).astype(np.int64)
        fastest = np.maximum(told_mps, self._own_mps[run])
        begins = np.ones(len(run), dtype=bool)
        begins[1:] = (run[1:] != run[:-1]) | (epoch[1:] != epoch[:-1])
        begins[1:] |= fastest[1:] != fastest[:-1]
        first = np.flatnonzero(begins)
        of, number = run[first], epoch[first]
        found = self._range_m[of]
        new = np.flatnonzero(self._last[of] != number)
        if len(new):
            target = (of[new][:, np.newaxis] * width + np.arange(width)).reshape(-1)
            start_s = np.repeat(number[new] * self.epoch_s[of[new]], width)
            ranges = range_m(np.repeat(of[new], width), target, start_s)
            found[new] = ranges.reshape(len(new), width)
        self._last[of], self._range_m[of] = number, found
        closing = self._closing_mps(self._targets_mps[of], fastest[first])
        within_m = self.reach_m + closing * self.epoch_s[of][:, np.newaxis] + _RANGE_MARGIN_M
        return np.asarray((found <= within_m)[np.cumsum(begins) - 1])
