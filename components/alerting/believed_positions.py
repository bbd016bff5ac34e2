"""Flights believed from positions: straight lines through those of the last seconds."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from components.alert_configuration.configuration import Deviations
from components.alerting.received import OwnPoses, ReceivedRows
from components.geometry import body_to_ned, east_north_m
from components.messages.fused import FusedDetections
from components.messages.targets import TrafficStates
from components.messages.tracks import Tracks
from dsa_des.arrays.run_ticks import RunTicks, first_position_in_runs, last_position_at_or_before
from dsa_des.arrays.types import BoolArray, FloatArray, IntArray
from dsa_des.block.wake import Arrivals, Wake
from dsa_des.record.failure_counts import NO_RUNS, counts_with_cases_added

# Positions closer in time than this are one instant, from which no velocity follows, s.
_SHORTEST_S = 1e-6


class BelievedFlights(NamedTuple):
    """Relative flights (own less target): row per scan, column per target, or a row per track."""

    known: BoolArray  # (rows, columns)
    # Six of (rows, columns): east, north, up in m and their rates in m/s, ownship less target.
    relative: tuple[FloatArray, ...]
    scan: IntArray | None = None  # which scan each row belongs to; by default, rows are scans
    # By default, columns are targets; -1 for a track that belongs to none.
    target: IntArray | None = None
    number: IntArray | None = None  # of tracks
    deviations: Deviations | None = None  # of (rows,)
    age_s: FloatArray | None = None  # (rows,) of the last measurement of each track


class BelievedPositions:
    """Remembers recent target positions, true or measured, and fits straight flights to them.

    Where they are fewer than two instants of a target, its last two count, as long as the later of
    them is not older than `keep_s` or than the time between them: however slowly a sensor looks,
    it lets a flight be known.
    """

    def __init__(self, keep_s: float, targets: int) -> None:
        self._keep_s, self._targets = keep_s, targets
        #: East, north, up (targets, 3, n); NaN where a target was not seen.
        self._seen = ReceivedRows.empty_with_columns(time_s=(), position_m=(targets, 3))
        #: How many, of how many, by run: sights without a range, and targets there without a
        #: velocity.
        self._rangeless, self._unmoving = np.zeros((2, 2, 0), dtype=np.int64)

    def failure_counts(self) -> dict[str, IntArray]:
        """Return cause → (2, runs) counts: targets that could not be judged for it, and cases."""
        return unjudged_counts_by_cause(self._rangeless, self._unmoving)

    def add_truth(self, came: RunTicks, time_s: FloatArray, position_m: FloatArray) -> None:
        """Store true target positions (n, targets, 3) at run times, and when each message came."""
        position = np.moveaxis(position_m, 0, -1)
        self._seen = self._seen.append(came, time_s=time_s, position_m=position)

    def add(self, arrived: Arrivals, own: OwnPoses, wake: Wake) -> None:
        """Store detections with a range as positions in level axes, by the own attitude then."""
        sights: Tracks | FusedDetections = arrived.message
        row = sights.row_of_entries
        new = sights.target >= 0
        if isinstance(sights, Tracks):
            new &= sights.updated  # others came with an earlier row
        with_range = np.isfinite(sights.range_m)
        run = arrived.instants.run[row]
        self._rangeless = counts_with_cases_added(self._rangeless, run[new & ~with_range], run[new])
        new &= with_range
        # The attitude of when it was measured, of those that have arrived.
        came = arrived.instants.take(row)
        pose = own.pose_index_at_measurement(RunTicks(came.run, sights.measured_tick), came, new)
        new &= pose >= 0
        row = row[new]
        yaw, pitch, roll = own.attitude_rad(pose[new])
        azimuth, elevation = sights.azimuth_rad[new], sights.elevation_rad[new]
        range_m = sights.range_m[new]
        level = range_m * np.cos(elevation)
        body = level * np.cos(azimuth), level * np.sin(azimuth), -range_m * np.sin(elevation)
        north, east, down = body_to_ned(*body, yaw, pitch, roll)
        # A row of its own for every instant of measurement.
        line, of, made = _group_by_row_and_tick(sights.tick, row, sights.measured_tick[new])
        position = np.full((len(made), self._targets, 3), np.nan)
        position[line, sights.target[new]] = np.stack([east, north, -down], axis=-1)
        self.add_truth(arrived.instants.take(of), made / wake.ticks_per_s, position)

    def forget(self, asked: RunTicks, times_s: FloatArray, wake: Wake) -> None:
        """Drop stored positions that no scan after those just judged can use."""
        kept = self._seen.time_s >= float(times_s.max()) - self._keep_s  # the next come later
        ends = self._seen.instants
        ends = ends.take(ends.last_position_of_runs)
        for last in self._last_two_rows(ends):
            kept[last[last >= 0]] = True
        self._seen = self._seen.take(kept & (self._seen.replica >= wake.first_run))

    def flights(
        self,
        asked: RunTicks,
        times_s: FloatArray,
        own: Mapping[str, FloatArray],
        poses: OwnPoses,
    ) -> BelievedFlights:
        """Return all targets' relative flights at some scans, from positions that came by then."""
        known, state = self._fitted_states(asked, times_s)
        # Positions count from the ownship: its own less theirs is the other way round.
        return BelievedFlights(known, tuple(-state))

    def _fitted_states(self, now: RunTicks, now_s: FloatArray) -> tuple[BoolArray, FloatArray]:
        """Return which flights are known (n, targets), position and velocity (6, n, targets) or 0.

        It is known from positions at two instants, not older than `keep_s`, else the last two.
        """
        came, time_s = self._seen.instants, self._seen.time_s
        first = first_position_in_runs(came, now.run)
        counts = np.maximum(last_position_at_or_before(came, now) + 1 - first, 0)
        of = np.repeat(np.arange(len(now)), counts)
        start = np.cumsum(counts) - counts
        line = np.arange(len(of)) + (first - start)[of]
        young = time_s[line] >= now_s[of] - self._keep_s
        of, line = of[young], line[young]
        counts = np.bincount(of, minlength=len(now))
        start = np.cumsum(counts) - counts
        known = np.zeros((len(now), self._targets), dtype=bool)
        state = np.zeros((6, len(now), self._targets))
        # Instants with as many positions are added up alike, each as it would be by itself.
        for count in np.flatnonzero(np.bincount(counts)).tolist():
            alike = np.flatnonzero(counts == count)
            if count < 2:
                continue
            lines = line[start[alike] + np.arange(count)[:, np.newaxis]]
            position = np.moveaxis(self._seen.position_m[:, :, lines], (0, 1), (2, 3))
            known[alike], state[:, alike] = _fit_lines(
                time_s[lines], np.ascontiguousarray(position), now_s[alike]
            )
        if not known.all() and len(time_s):
            self._fit_last_two_positions(now, now_s, known, state)
        self._unmoving = counts_with_cases_added(
            self._unmoving, NO_RUNS, now.run[known.nonzero()[0]]
        )
        return known, state

    def _fit_last_two_positions(
        self, now: RunTicks, now_s: FloatArray, known: BoolArray, state: FloatArray
    ) -> None:
        """Fill in unknown flights, in place, by a line through a target's last two positions."""
        scans = np.flatnonzero(~known.all(axis=1))
        time_s = self._seen.time_s
        last, before = self._last_two_rows(now.take(scans))
        apart_s = np.abs(time_s[last] - time_s[before])
        age_s = now_s[scans, np.newaxis] - np.maximum(time_s[last], time_s[before])
        slow = ~known[scans] & (before >= 0) & (age_s <= np.maximum(apart_s, self._keep_s))
        of, target = slow.nonzero()
        lines = np.array([before[of, target], last[of, target]])
        position = self._seen.position_m[target, :, lines][:, :, np.newaxis]
        found = _fit_lines(time_s[lines], position, now_s[scans[of]])
        known[scans[of], target] = found[0][:, 0]
        state[:, scans[of], target] = found[1][:, :, 0]
        there = (last >= 0) & (now_s[scans, np.newaxis] - time_s[last] <= self._keep_s)
        lacking = now.run[scans[(there & ~known[scans]).nonzero()[0]]]
        self._unmoving = counts_with_cases_added(self._unmoving, lacking, lacking)

    def _last_two_rows(self, now: RunTicks) -> tuple[IntArray, IntArray]:
        """Return the last two rows with a target's position, at different times, by each instant.

        Both are (n, targets), -1 where there is none.
        """
        came, time_s = self._seen.instants, self._seen.time_s
        seen = np.isfinite(self._seen.position_m[:, 0].T)
        # The last row up to each that has a position.
        up_to = np.maximum.accumulate(np.where(seen, np.arange(len(seen))[:, np.newaxis], -1))
        first = first_position_in_runs(came, now.run)[:, np.newaxis]
        target = np.arange(self._targets)

        def last_row_with_position(row: IntArray) -> IntArray:
            found = np.where(row >= first, up_to[np.maximum(row, 0), target], -1)
            return np.where(found >= first, found, -1)

        last = last_row_with_position(
            np.broadcast_to(
                last_position_at_or_before(came, now)[:, np.newaxis], (len(now), len(target))
            )
        )
        before = last_row_with_position(last - 1)
        while True:  # what several sensors see at one instant gives no velocity
            alike = (before >= 0) & (np.abs(time_s[last] - time_s[before]) <= _SHORTEST_S)
            if not alike.any():
                return last, before
            before = np.where(alike, last_row_with_position(before - 1), before)


def unjudged_counts_by_cause(rangeless: IntArray, unmoving: IntArray) -> dict[str, IntArray]:
    """Return cause, if it occurred, → (2, runs) counts of targets without range or velocity."""
    lacks = {
        "what it hears of has no range and is not judged": rangeless,
        "who is there has no velocity yet and is not judged": unmoving,
    }
    return {what: count for what, count in lacks.items() if count[1].any()}


def true_relative_positions_m(states: TrafficStates) -> FloatArray:
    """Return true positions east, north, up of own, m (rows, targets, 3), NaN where absent."""
    own = [np.radians(x)[:, np.newaxis] for x in (states.own_lat_deg, states.own_lon_deg)]
    east, north = east_north_m(np.radians(states.lat_deg), np.radians(states.lon_deg), *own)
    up = states.alt_m - states.own_alt_m[:, np.newaxis]
    position = np.full((len(states), len(states.roster), 3), np.nan)
    there = np.where(states.present[:, :, np.newaxis], np.stack([east, north, up], -1), np.nan)
    position[:, states.columns] = there
    return position


def _group_by_row_and_tick(
    tick: IntArray, row: IntArray, measured: IntArray
) -> tuple[IntArray, IntArray, IntArray]:
    """Return each entry's index among distinct (row, tick) pairs, and all pairs' rows and ticks.

    `tick` is of a message's rows, `row` and `measured` of its entries.
    """
    if np.array_equal(measured, tick[row]):
        return row, np.arange(len(tick)), tick
    # A row without entries has its line all the same, whatever other rows the wake brings.
    silent = np.flatnonzero(np.bincount(row, minlength=len(tick)) == 0)
    every = np.stack([np.concatenate([row, silent]), np.concatenate([measured, tick[silent]])])
    pairs, line = np.unique(every, axis=1, return_inverse=True)
    return line.reshape(-1)[: len(row)], pairs[0], pairs[1]


def _fit_lines(
    time_s: FloatArray, position_m: FloatArray, now_s: FloatArray
) -> tuple[BoolArray, FloatArray]:
    """Return whether a line fits (n, targets), and its state at `now_s` (6, n, targets), else 0."""
    seen = np.isfinite(position_m[..., 0])
    count = np.maximum(seen.sum(axis=0), 1)
    # Relative to now, so that clock readings do not cost digits.
    ago_s = np.where(seen, (time_s - now_s)[:, :, np.newaxis], 0.0)
    mean_s = _sum_over_positions(ago_s) / count
    off_s = np.where(seen, ago_s - mean_s, 0.0)
    spread = _sum_over_positions(off_s * off_s)
    known = np.asarray(spread > _SHORTEST_S**2)
    position = np.where(seen[..., np.newaxis], position_m, 0.0)
    mean_m = position.sum(axis=0) / count[..., np.newaxis]
    moved = np.where(seen[..., np.newaxis], position - mean_m, 0.0)
    slope = (off_s[..., np.newaxis] * moved).sum(axis=0)
    rate = slope / np.where(known, spread, 1.0)[..., np.newaxis]
    now_m = mean_m - rate * mean_s[..., np.newaxis]
    state = np.concatenate([np.moveaxis(now_m, -1, 0), np.moveaxis(rate, -1, 0)])
    return known, np.where(known, state, 0.0)


def _sum_over_positions(values: FloatArray) -> FloatArray:
    """Return sums over axis 0 of (positions, n, targets), bit-equal for one target or many.

    NumPy adds the numbers of a single target in pairs, and those of several one after the other.
    """
    if values.shape[2] != 1:
        return np.asarray(values.sum(axis=0))
    alone = np.ascontiguousarray(values[:, :, 0].T)
    return np.asarray(alone.sum(axis=1))[:, np.newaxis]
