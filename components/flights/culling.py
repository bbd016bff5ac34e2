"""Targets that a sensor may look at, with the largest speeds as proof.

Of an ownship whose flight is known, time is halved until a target is surely near or surely not.
Around one that is steered, time falls into epochs of a few seconds: until the end of one it and a
target cannot close in by more than their two largest speeds allow. What a row holds follows from
its own epoch and so does not depend on the window that it is in.
"""

from dataclasses import dataclass

import numpy as np

from components.flights.fleet import Fleet
from components.flights.many_flights import SteeredFleet
from components.geometry import TrajectoryState, slant_range_m
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
    """The time intervals (n,) outside of which a target surely is not near the ownship.

    Targets ascend; both ends are included, and those of one target are in order and apart.
    """

    target: IntArray
    start_s: FloatArray
    end_s: FloatArray

    def may_be_near(self, columns: IntArray, time_s: FloatArray, lasts_s: float) -> BoolArray:
        """Return a mask (rows, targets), True if maybe near within ``lasts_s`` of the row's time.

        `columns` are those of `targets_near` all of these looks: which of them are near at which
        one does not depend on the window.
        """
        always = (self.start_s <= time_s.min() + lasts_s) & (self.end_s >= time_s.max())
        if np.count_nonzero(always) == len(columns):
            return np.ones((len(time_s), len(columns)), dtype=bool)
        order = np.argsort(time_s, kind="stable")  # of replicas, one comes after the other
        first_s = time_s[order]
        last_s = first_s + lasts_s
        met = (self.start_s <= last_s[-1]) & (self.end_s >= first_s[0])
        column = np.searchsorted(columns, self.target[met])
        change = np.zeros((len(first_s) + 1, len(columns)), dtype=np.int8)
        np.add.at(change, (np.searchsorted(last_s, self.start_s[met]), column), 1)
        ends = np.searchsorted(first_s, self.end_s[met], side="right")
        np.subtract.at(change, (ends, column), 1)
        near: BoolArray = np.empty((len(time_s), len(columns)), dtype=bool)
        near[order] = np.cumsum(change[:-1], axis=0, dtype=np.int8) > 0
        return near

    def targets_near(self, first_s: float, last_s: float) -> IntArray:
        """Return the targets that may be near at some time in [first_s, last_s], ascending."""
        met = (self.start_s <= last_s) & (self.end_s >= first_s)
        return np.unique(self.target[met])

    def may_be_near_throughout(
        self, target: IntArray, time_s: FloatArray, until_s: FloatArray
    ) -> BoolArray:
        """Return a mask (n,), True if a target may be near from its ``time_s`` to ``until_s``."""
        first = np.searchsorted(self.target, target)
        count = np.searchsorted(self.target, target, side="right") - first
        inside: BoolArray = np.zeros(len(target), dtype=bool)
        for k in range(int(count.max(initial=0))):
            rest = np.flatnonzero(count > k)
            one = first[rest] + k
            inside[rest] |= (self.start_s[one] <= until_s[rest]) & (time_s[rest] <= self.end_s[one])
        return inside

    def max_near_targets_at_once(self) -> int:
        """Return the largest number of targets that may be near at one time."""
        times = np.concatenate([self.start_s, self.end_s])
        change = np.repeat([1, -1], len(self.target))
        order = np.lexsort((-change, times))
        return int(np.cumsum(change[order]).max(initial=0))


def near_intervals(
    own: Fleet, targets: Fleet, reach_m: float | FloatArray, end_s: float
) -> NearIntervals:
    """Return the intervals in which each target may be within ``reach_m`` of its run's ownship.

    Every time at which a target is within `reach_m` lies in one of its intervals; they exceed the
    true ones by `FINEST_S` or less at each end (more only for a target that stays for long within a
    few metres of the edge). `own` is the ownship of each run; `targets` are as many in each run,
    one run after the other. The reach may be another one in each run; where it is infinite, all
    its targets may be near all the time, as in a run of its own that asks for no intervals.
    """
    of_run = max(1, len(targets) // len(own))
    run = np.arange(len(targets)) // of_run
    own_s, targets_s = own.intervals_present_s[run], targets.intervals_present_s
    present_s = np.maximum(targets_s[:, 0], own_s[:, 0]), np.minimum(targets_s[:, 1], own_s[:, 1])
    within_m = np.broadcast_to(reach_m, len(own))[run]
    always = np.isinf(within_m)
    present_s[0][always], present_s[1][always] = -np.inf, np.inf
    closing = (targets.max_speeds_mps + own.max_speeds_mps[run]) * _SPEED_MARGIN
    target = np.arange(len(closing))
    piece: FloatArray = np.zeros(len(closing))
    kept = [(target[:0], closing[:0], closing[:0])]
    length = float(end_s)
    while len(target):
        start: FloatArray = piece * length
        half = 0.5 * length
        middle = start + half
        states = own.each(run[target], middle), targets.each(target, middle)
        range_m = slant_range_m(*(values for state in states for values in state.arrays()[:3]))
        drift = closing[target] * half + _RANGE_MARGIN_M
        there = (present_s[0][target] <= start + length) & (present_s[1][target] >= start)
        maybe = there & (range_m <= within_m[target] + drift)
        fine = length <= FINEST_S or _run_has_too_many_pieces(run[target], of_run)
        settled = maybe & ((range_m <= within_m[target] - drift) | fine)
        kept.append((target[settled], start[settled], start[settled] + length))
        cut = maybe & ~settled
        target, piece = np.repeat(target[cut], 2), np.repeat(2.0 * piece[cut], 2)
        piece[1::2] += 1
        length = half
    near, begin, end = (np.concatenate(parts) for parts in zip(*kept, strict=True))
    start, end = np.maximum(begin, present_s[0][near]), np.minimum(end, present_s[1][near])
    some = start <= end
    return _merge_intervals(near[some], start[some], end[some])


def _run_has_too_many_pieces(run: IntArray, of_run: int) -> BoolArray:
    """Return a mask over pieces of time, True where the run has more pieces than the limit."""
    too_many: BoolArray = 2 * np.bincount(run) > _MOST_PIECES_PER_TARGET * of_run
    return too_many[run]


def _merge_intervals(target: IntArray, start_s: FloatArray, end_s: FloatArray) -> NearIntervals:
    order = np.lexsort((start_s, target))
    target, start_s, end_s = target[order], start_s[order], end_s[order]
    begins: BoolArray = np.ones(len(target), dtype=bool)
    begins[1:] = (target[1:] != target[:-1]) | (start_s[1:] > end_s[:-1] + _TIME_MARGIN_S)
    ends = np.roll(begins, -1)
    return NearIntervals(
        target[begins], start_s[begins] - _TIME_MARGIN_S, end_s[ends] + _TIME_MARGIN_S
    )


# An epoch lasts until the fastest target can have come nearer by this part of the reach.
_DRIFT_SHARE = 0.25
SHORTEST_EPOCH_S = 1.0
# Targets are moved for so many epochs at once, or as many as are so many cells: a run goes back.
_MOST_EPOCHS, _MOST_CELLS = 64, 65_536
# Steering keeps the speed to 1e-4 unless another one is commanded.
_OWN_SPEED_MARGIN = 1.05


class SteeredCulling:
    """Tells which targets may be near steered ownships, one per run, once in each epoch of time.

    `own` flies as before it is steered; `targets` are as many in each run, one run after the other;
    nothing is asked about after `end_s`.
    """

    def __init__(self, own: Fleet, targets: Fleet, reach_m: float, end_s: float) -> None:
        self._own_mps, self._targets = own.max_speeds_mps, targets
        self._reach_m, self._end_s = reach_m, end_s
        runs = len(own), len(targets) // len(own)
        self._targets_mps: FloatArray = targets.max_speeds_mps.reshape(runs)
        fastest = self._closing_speed_bounds_mps(self._targets_mps, self._own_mps).max(
            axis=1, initial=1e-3
        )
        #: How long an epoch lasts around each ownship.
        self.epoch_s: FloatArray = np.maximum(SHORTEST_EPOCH_S, _DRIFT_SHARE * reach_m / fastest)
        # Ranges and positions of targets as epochs begin, and of which epochs they are known, each
        # by its number modulo room.
        room = max(1, min(_MOST_EPOCHS, _MOST_CELLS // max(1, len(targets))))
        self._known: IntArray = np.full((2, len(own), room), -1, dtype=np.int64)
        self._range_m: FloatArray = np.empty((len(own), room, runs[1]))
        self._position: FloatArray = np.empty((3, *self._range_m.shape))

    @staticmethod
    def _closing_speed_bounds_mps(targets_mps: FloatArray, own_mps: FloatArray) -> FloatArray:
        """Return the largest closing speeds (n, targets) of ownships (n,) and their targets."""
        return np.asarray(
            (targets_mps + own_mps[:, np.newaxis] * _OWN_SPEED_MARGIN) * _SPEED_MARGIN
        )

    def forget_ranges_from(self, run: int, time_s: float) -> None:
        """Discard a run's stored ranges from the time from which its ownship is steered."""
        known = self._known[0, run]
        known[known * self.epoch_s[run] >= time_s] = -1

    def own_states_and_near_mask(
        self, own: SteeredFleet, run: IntArray, time_s: FloatArray
    ) -> tuple[TrajectoryState, BoolArray]:
        """Return own states at rows as steered, and if targets may be in reach, (rows, targets)."""
        rows = len(time_s)
        epoch = np.floor(time_s / self.epoch_s[run]).astype(np.int64)
        fastest = np.maximum(own.largest_manoeuvre_speed_mps(run, time_s), self._own_mps[run])
        begins = np.ones(len(run), dtype=bool)
        begins[1:] = (run[1:] != run[:-1]) | (epoch[1:] != epoch[:-1])
        begins[1:] |= fastest[1:] != fastest[:-1]
        first = np.flatnonzero(begins)
        of, number = run[first], epoch[first]
        index = number % self._range_m.shape[1]
        range_m = self._range_m[of, index]
        new = np.flatnonzero(self._known[0, of, index] != number)
        begun, start_s = of[new], number[new] * self.epoch_s[of[new]]
        # One call for rows and epochs: a steered flight has parts to go through.
        here = own.each(np.concatenate([run, begun]), np.concatenate([time_s, start_s])).arrays()
        if len(new):
            at_start = (values[rows:, np.newaxis] for values in here[:3])
            range_m[new] = slant_range_m(
                *at_start, *self._target_positions_at_epoch(begun, number[new])
            )
            self._known[0, begun, index[new]] = number[new]
            self._range_m[begun, index[new]] = range_m[new]
        closing = self._closing_speed_bounds_mps(self._targets_mps[of], fastest[first])
        within_m = self._reach_m + closing * self.epoch_s[of][:, np.newaxis] + _RANGE_MARGIN_M
        near = np.asarray((range_m <= within_m)[np.cumsum(begins) - 1])
        return TrajectoryState(*(values[:rows] for values in here)), near

    def _target_positions_at_epoch(self, run: IntArray, epoch: IntArray) -> FloatArray:
        """Return target positions (3, n, targets) at epoch starts, computing what is not stored."""
        _, _, room, width = self._position.shape
        position, left = np.empty((3, len(run), width)), np.arange(len(run))
        while len(left):
            of, index = run[left], epoch[left] % room
            known = self._known[1, of, index] == epoch[left]
            position[:, left[known]] = self._position[:, of[known], index[known]]
            left = left[~known]
            if len(left):
                self._store_target_positions(run[left], epoch[left])
        return position

    def _store_target_positions(self, run: IntArray, epoch: IntArray) -> None:
        """Compute and store the runs' targets at the first given epoch and as many as fit after."""
        of, first = np.unique(run, return_index=True)
        _, _, room, width = self._position.shape
        number = epoch[first, np.newaxis] + np.arange(room)
        start_s = np.minimum(number * self.epoch_s[of, np.newaxis], self._end_s)
        target = of[:, np.newaxis, np.newaxis] * width + np.arange(width)
        target = np.broadcast_to(target, (*number.shape, width)).reshape(-1)
        there = self._targets.each(target, np.repeat(start_s, width))
        place = of[:, np.newaxis], number % room
        self._known[1][place] = number
        for position, values in zip(self._position, there.arrays(), strict=False):
            position[place] = values.reshape(*number.shape, width)
