"""Intervals in which targets are near: time is halved, with the largest speeds as proof.

A target whose distance is d at the middle of an interval of length 2h stays farther away than
d - v·h all through it, and nearer than d + v·h, with v the sum of the two largest speeds. So an
interval is surely outside, surely inside, or is cut in two. That asks nothing of the flight but
its largest speed: legs, turns and recorded samples are all alike.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from components.geometry.ellipsoid import line_of_sight
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
        """Return which targets may be near at some time of each of several looks.

        Parameters
        ----------
        columns : (targets,) of int
            Ascending; all that are near at any time of the looks.
        first_s, last_s : (rows,)
            When each look starts and ends, both in order.

        Returns
        -------
        (rows, targets) of bool
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
        """Return whether each of some targets (n,) may be near at some time of its own (n,) look.

        Parameters
        ----------
        target : (n,) of int
        time_s, until_s : (n,)
            When each look starts and ends.
        """
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

    Parameters
    ----------
    range_at : callable
        Range from the ownship in m of targets (n,) of int, each at a time (n,) of its own.
    closing_speed_mps : (targets,)
        Largest speed of the target plus that of the ownship.
    present_s : two (targets,)
        First and last time at which both are there.
    reach_m : float
    end_s : float
        Above 0.
    of_run : int, optional
        Where the targets are those of many runs: how many each of them has. All in one by default.

    Returns
    -------
    NearIntervals
        Every time at which a target is within `reach_m` lies in one of its intervals; they
        exceed the true ones by `FINEST_S` or less at each end (more only for a target that
        stays for long within a few metres of the edge).
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
    """Return the range from an ownship to targets (n,), each at a time (n,) of its own, m.

    Parameters
    ----------
    own_at : callable
        State of the ownship at times (m,).
    targets_at : callable
        States of targets (n,) of int at times (n,).
    target, time_s : (n,)
    """
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
