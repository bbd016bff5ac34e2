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
from components.geometry.ellipsoid import line_of_sight
from components.geometry.state import TrajectoryState
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
        self,
        own: Any,
        fleet: Fleet,
        reach_m: float,
        end_s: float,
        lasts_s: float = 0.0,
    ) -> None:
        self._fleet, self.lasts_s = fleet, lasts_s
        self.reach_m = reach_m
        there = fleet.intervals_present_s
        first, last = own.interval_present()
        self.intervals: NearIntervals = near_intervals(
            partial(range_between, own.at, fleet.each),
            closing_speed_mps=fleet.max_speeds_mps + own.max_speed_mps,
            present_s=(np.maximum(there[:, 0], first), np.minimum(there[:, 1], last)),
            reach_m=reach_m,
            end_s=end_s + lasts_s,
        )
        self._last: tuple[IntArray, Any] | None = None

    def active(self, first_s: float, last_s: float) -> tuple[IntArray, Any]:
        """Return the targets that may come in reach between two times, and a fleet of them."""
        columns = self.intervals.during(first_s, last_s + self.lasts_s)
        if self._last is None or not np.array_equal(columns, self._last[0]):
            self._last = columns, self._fleet.subset(columns)
        return self._last

    def cut(self, time_s: FloatArray) -> tuple[IntArray, Any, BoolArray]:
        """Return the targets that may come in reach, a fleet of them, and when (rows, n)."""
        columns, fleet = self.active(float(time_s.min()), float(time_s.max()))
        return columns, fleet, self.near(columns, time_s)

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
# Targets are placed for so many epochs at once that it takes about this many cells.
_CELLS_AT_ONCE = 8192


def closing_speeds_mps(targets_mps: FloatArray, own_mps: Any) -> FloatArray:
    """Return how fast each target and a steered ownship can come nearer to each other."""
    closing: FloatArray = (targets_mps + own_mps * _OWN_SPEED_MARGIN) * _SPEED_MARGIN
    return closing


def epochs_of(closing_mps: FloatArray, reach_m: float) -> FloatArray:
    """Return how long an epoch lasts around each ownship, of closing speeds (ownships, targets)."""
    fastest = np.maximum(closing_mps.max(axis=1, initial=0.0), 1e-3)
    return np.maximum(SHORTEST_EPOCH_S, _DRIFT_SHARE * reach_m / fastest)


def within_of(closing_mps: FloatArray, reach_m: float, epoch_s: Any) -> FloatArray:
    """Return how near at the start of an epoch counts for who closes in so fast."""
    return np.asarray(reach_m + closing_mps * epoch_s + _RANGE_MARGIN_M)


class SteeredCulling:
    """The targets near an ownship that is steered, by epochs of time."""

    def __init__(self, own_speed_mps: float, fleet: Fleet, reach_m: float) -> None:
        self.reach_m, self._fleet = reach_m, fleet
        self._speeds_mps, self._own_mps = fleet.max_speeds_mps, own_speed_mps
        closing = closing_speeds_mps(self._speeds_mps, own_speed_mps)
        self.epoch_s = float(epochs_of(closing[np.newaxis], reach_m)[0])
        #: Ranges at the start of an epoch by its number, for one path of the ownship.
        self._range_m: dict[int, FloatArray] = {}
        self._own: Any = None
        #: Where all targets are at the starts of some epochs, from the first of them on.
        self._placed: tuple[int, Any] | None = None
        self._most_epochs = max(1, _CELLS_AT_ONCE // max(1, len(fleet)))
        self._last: tuple[IntArray, Any] = np.arange(len(fleet)), fleet

    def cut(self, own: Any, time_s: FloatArray) -> tuple[Any, IntArray, Any, BoolArray]:
        """Return the ownship's states, the targets that may be in reach, their fleet, and when."""
        if own is not self._own:
            self._own, self._range_m = own, {}
        # By a row's own instant the ownship may have been told to fly faster.
        fastest = np.maximum(own.fastest_by(time_s), self._own_mps)
        of_rows = np.stack([np.floor(time_s / self.epoch_s), fastest])
        pairs, of_row = np.unique(of_rows, axis=1, return_inverse=True)
        of_row = of_row.reshape(-1)
        numbers = pairs[0].astype(np.int64).tolist()
        new = sorted({number for number in numbers if number not in self._range_m})
        # One call for the rows and the epochs: a steered flight has many parts to go through.
        both = own.at(np.concatenate([time_s, np.array(new) * self.epoch_s]))
        rows = len(time_s)
        state = TrajectoryState(*(values[:rows] for values in both.arrays()))
        here = [both.lat_deg[rows:], both.lon_deg[rows:], both.alt_m[rows:]]
        self._learn(np.array(new, dtype=np.int64), here)
        closing = closing_speeds_mps(self._speeds_mps, pairs[1][:, np.newaxis])
        within_m = within_of(closing, self.reach_m, self.epoch_s)
        near = np.array([self._range_m[number] for number in numbers]) <= within_m
        columns = np.flatnonzero(near.any(axis=0))
        if not np.array_equal(columns, self._last[0]):
            self._last = columns, self._fleet.subset(columns)
        return state, columns, self._last[1], near[:, columns][of_row]

    def _learn(self, epochs: IntArray, here: list[FloatArray]) -> None:
        """Find who may come in reach in some epochs, given where the ownship starts each."""
        while len(epochs):
            first, others = self._placed or (0, None)
            if others is None or not first <= epochs[0] < first + self._most_epochs:
                first = int(epochs[0])
                others = self._fleet.at((first + np.arange(self._most_epochs)) * self.epoch_s)
                self._placed = first, others
            known = int(np.searchsorted(epochs, first + self._most_epochs))
            row = epochs[:known] - first
            own_lat, own_lon, own_alt = (values[:known, np.newaxis] for values in here)
            _, _, range_m = line_of_sight(
                own_lat, own_lon, own_alt,
                others.lat_deg[row], others.lon_deg[row], others.alt_m[row],
                validate=False,
            )  # fmt: skip
            self._range_m.update(zip(epochs[:known].tolist(), range_m, strict=True))
            epochs, here = epochs[known:], [values[known:] for values in here]
