"""Declaration of targets by m detections in n looks: at one target, or at one measured position.

Looks before the first one count as misses.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import chain
from typing import Any

import numpy as np

from components.geometry import body_to_ned, unit_vector
from components.messages.detections import REPORT, Detections, ReportTransform
from components.sensor.look import DECLARATION, Cells, Judging, Look
from dsa_des.arrays.run_ticks import RunTicks, first_position_at_or_after
from dsa_des.arrays.types import BoolArray, FloatArray, IntArray
from dsa_des.block.effect import Effect, Verdict


def empty_look_memory(n: int, targets: int) -> BoolArray:
    """Return the memory before any look, (targets, n - 1): all False, as after missed looks."""
    return np.zeros((targets, n - 1), dtype=bool)


def declare_looks(
    target: IntArray, detected: BoolArray, m: int, n: int, memory: BoolArray
) -> tuple[BoolArray, BoolArray]:
    """Return which looks declare their target by m of n, and the next memory (targets, n - 1).

    A target is declared at a look if m or more of its last n looks, this one included, detected
    it. Only looks count, each target's in order of time: a scan that did not look at a target
    neither helps nor ages its detections. The memory (targets, n - 1), oldest look first, is
    `empty_look_memory` or what the last call returned: any division into calls gives the same.
    """
    targets = len(memory)
    # Each target's memory and then its looks, one target after the other.
    order = np.argsort(target, kind="stable")
    looks = np.bincount(target, minlength=targets)
    length = looks + (n - 1)
    first = np.cumsum(length) - length
    position = np.empty(len(target), dtype=np.int64)
    rank = np.arange(len(target)) - np.repeat(np.cumsum(looks) - looks, looks)
    position[order] = np.repeat(first + (n - 1), looks) + rank
    line = np.zeros(int(length.sum()), dtype=np.int64)
    kept = first[:, np.newaxis] + np.arange(n - 1)
    line[kept] = memory
    line[position] = detected
    count = np.concatenate(([0], np.cumsum(line)))
    declared = count[position + 1] - count[position + 1 - n] >= m
    after = line[kept + looks[:, np.newaxis]].astype(bool)
    return declared, after


class DeclarationRule(Effect[Judging]):
    """Marks the detections of declared targets; without a rule every detection declares."""

    name = "declaration"
    acts_on = DECLARATION

    def verdict(self, block: Any) -> Verdict:
        """Return whether m of n declares: ``declare_m`` and ``declare_n`` set, not by position."""
        m, n = block.p.declare_m, block.p.declare_n
        if m is None:
            return Verdict(False, "declare_m and declare_n are not given")
        if block.p.declares_by_target_or_place == "place":
            return Verdict(False, "places are declared, not targets")
        return Verdict(True, f"declare_m is {m} and declare_n is {n}")

    def build(self, block: Any) -> Declarations:
        """Return the declaration rule of this sensor, 1 of 1 by default."""
        if (
            block.p.declares_by_target_or_place == "place"
        ):  # built all the same, it declares whatever is reported
            return Declarations(1, 1)
        return Declarations(block.p.declare_m or 1, block.p.declare_n or 1)


class Declarations:
    """Remembers each target's last n looks and when it was first declared.

    A look is a scan that had the target in reach: a scan that skipped it neither helps nor counts
    as a miss.
    """

    #: Goes on where the sensor changes (`Component.remembers`).
    remembers = ("_memory", "_first_tick", "_first_range_m", "names")

    def __init__(self, m: int, n: int) -> None:
        self.m, self.n = m, n
        self.names: tuple[str, ...] = ()
        #: Of all targets of the first run, of the second, and so on.
        self._memory: BoolArray = empty_look_memory(n, 0)
        self._first_tick: IntArray = np.empty(0, dtype=np.int64)
        self._first_range_m: FloatArray = np.empty(0)

    def __call__(self, cells: Cells, look: Look) -> Look:
        """Return the look with a column ``declared``."""
        self.names = cells.roster.names
        targets = cells.run * len(self.names) + cells.target
        runs = int(cells.run.max(initial=0)) + 1
        if len(self._memory) < runs * len(self.names):
            self._grow_memory(runs * len(self.names))
        declared, self._memory = declare_looks(targets, look.detected, self.m, self.n, self._memory)
        self._store_first_declarations(cells, targets, np.flatnonzero(declared))
        if self.m == 1:  # whatever is reported is declared, and a false alarm is like the others
            return look
        return replace(look, extras={**look.extras, "declared": declared})

    def _grow_memory(self, count: int) -> None:
        """Enlarge arrays per target to `count`; added targets start undetected and undeclared."""
        more = count - len(self._memory)
        self._memory = np.concatenate([self._memory, empty_look_memory(self.n, more)])
        self._first_tick = np.append(self._first_tick, np.full(more, -1))
        self._first_range_m = np.append(self._first_range_m, np.full(more, np.nan))

    def _store_first_declarations(
        self, cells: Cells, targets: IntArray, declared: IntArray
    ) -> None:
        target, index = np.unique(targets[declared], return_index=True)
        new = self._first_tick[target] < 0
        first = declared[index[new]]
        self._first_tick[target[new]] = cells.scan_ticks[cells.row[first]]
        self._first_range_m[target[new]] = cells.range_m[first]

    def first_declaration_tick_and_range(self) -> dict[str, tuple[int, float]]:
        """Return by name each declared target's first declaration tick and true range then, m."""
        firsts = zip(self._first_tick.tolist(), self._first_range_m.tolist(), strict=True)
        return {name: one for name, one in zip(self.names, firsts, strict=True) if one[0] >= 0}


#: How far apart two measurements of one position are taken to lie, in standard deviations.
GATE_DEVIATIONS = 3.0
# Pairs that are compared at a time: some 100 MB of intermediate arrays.
_MOST_PAIRS = 2_000_000
# Of more pairs those are left out first whose directions are too far apart. In the tree of
# all directions, scans are farther apart than any two directions.
_FEW_PAIRS, _SCANS_APART = 10_000, 10.0


@dataclass(frozen=True)
class SeenPlaces:
    """Table of detections for declaration by position, sorted by run and then by scan.

    `time_s` is when each was measured, `direction` (n, 3) a unit vector in one frame; a range is
    NaN where none is measured, and a variance of NaN counts as 0.
    """

    run: IntArray
    scan: IntArray
    time_s: FloatArray
    direction: FloatArray
    range_m: FloatArray
    angle_variance_rad2: FloatArray
    range_variance_m2: FloatArray

    def __len__(self) -> int:
        return len(self.scan)

    def take(self, which: IntArray | BoolArray) -> SeenPlaces:
        """Return a new table with the entries chosen by index or mask."""
        return SeenPlaces(*(values[which] for values in vars(self).values()))

    def append(self, later: SeenPlaces) -> SeenPlaces:
        """Return a new table with the entries of `later` added at the end."""
        both = zip(vars(self).values(), vars(later).values(), strict=True)
        return SeenPlaces(*(np.concatenate(pair) for pair in both))


def count_scans_with_neighbour(
    places: SeenPlaces, asked: IntArray, n: int, *, speed_m_s: float, rate_rad_s: float
) -> IntArray:
    """Return for each of `asked` how many of the last n scans (own included) detect its place.

    Of the entries that are `asked` about, 1 to n each. Two detections have one position where
    direction and, if both have one, range differ by no more than a target may have moved between
    them (`speed_m_s` along the line of sight, `rate_rad_s` across it), and three standard
    deviations of their difference.
    """
    count = np.ones(len(asked), dtype=np.int64)
    if len(places) == 0:
        return count
    neighbours: _Neighbours | None = None
    for lag in range(1, n):
        scans, wanted = RunTicks(places.run, places.scan), places.scan[asked] - lag
        first = first_position_at_or_after(scans, RunTicks(places.run[asked], wanted))
        number = first_position_at_or_after(scans, RunTicks(places.run[asked], wanted + 1)) - first
        pairs = _yield_pair_batches(first, number)
        if int(number.sum()) > _FEW_PAIRS:
            neighbours = neighbours or _Neighbours(places, rate_rad_s)
            pairs = neighbours.nearby_pairs(asked, first, number)
        for here, there in pairs:
            near = _is_same_place(places, asked[here], there, speed_m_s, rate_rad_s)
            count += np.bincount(here[near], minlength=len(asked)) > 0
    return count


def _yield_pair_batches(first: IntArray, number: IntArray) -> Iterator[tuple[IntArray, IntArray]]:
    """Yield, in batches that fit into memory, i and each of `number[i]` entries from `first[i]`."""
    start, most = 0, max(1, _MOST_PAIRS // max(1, int(number.max(initial=1))))
    while start < len(first):
        part = slice(start, start + most)
        here = np.repeat(np.arange(len(first))[part], number[part])
        start_of = np.cumsum(number[part]) - number[part]
        yield here, np.arange(len(here)) + np.repeat(first[part] - start_of, number[part])
        start += most


class _Neighbours:
    """Search tree that finds the detections of one scan whose direction is near a given one."""

    def __init__(self, places: SeenPlaces, rate_rad_s: float) -> None:
        from scipy.spatial import cKDTree

        new = (np.diff(places.run) != 0) | (np.diff(places.scan) != 0)
        self._scan = np.concatenate([[0], np.cumsum(new)])
        self._places, self._rate_rad_s = places, rate_rad_s
        begins = np.concatenate([[0], np.flatnonzero(new) + 1])
        #: Of each scan, the first and the last instant at which anything was measured.
        self._ends_s = [f.reduceat(places.time_s, begins) for f in (np.minimum, np.maximum)]
        self._variance = np.nan_to_num(places.angle_variance_rad2)
        self._tree = cKDTree(np.column_stack([places.direction, _SCANS_APART * self._scan]))

    def nearby_pairs(
        self, asked: IntArray, first: IntArray, number: IntArray
    ) -> Iterator[tuple[IntArray, IntArray]]:
        """Yield batches of index pairs: a position in `asked`, and an entry of the scan that starts
        at its `first` whose direction is near enough to compare.
        """
        some = np.flatnonzero(number)
        mine, scan = asked[some], self._scan[first[some]]
        time_s = self._places.time_s[mine]
        apart_s = np.max([np.abs(time_s - end_s[scan]) for end_s in self._ends_s], axis=0)
        gate_rad = self._rate_rad_s * apart_s
        gate_rad += GATE_DEVIATIONS * np.sqrt(self._variance[mine] + self._variance.max())
        # The chord of the widest gate, and a rounding more.
        radius = 2.0 * np.sin(np.minimum(0.5 * gate_rad, 0.5 * np.pi)) * (1.0 + 1e-9) + 1e-12
        points = np.column_stack([self._places.direction[mine], _SCANS_APART * scan])
        counts = self._tree.query_ball_point(points, radius, return_length=True)
        batch = np.cumsum(counts) // _MOST_PAIRS
        for rows in np.split(np.arange(len(some)), np.flatnonzero(np.diff(batch)) + 1):
            found = self._tree.query_ball_point(points[rows], radius[rows], return_sorted=True)
            there = np.fromiter(chain.from_iterable(found), np.int64, int(counts[rows].sum()))
            yield np.repeat(some[rows], counts[rows]), there


def _is_same_place(
    places: SeenPlaces, one: IntArray, other: IntArray, speed_m_s: float, rate_rad_s: float
) -> BoolArray:
    """Return which pairs may be one target, by direction and, if both have one, range (mask)."""
    apart_s = np.abs(places.time_s[one] - places.time_s[other])
    variance = np.nan_to_num(places.range_variance_m2)
    gate_m = speed_m_s * apart_s + GATE_DEVIATIONS * np.sqrt(variance[one] + variance[other])
    # Where either has no range the difference is NaN, and the gate is open.
    near: BoolArray = ~(np.abs(places.range_m[one] - places.range_m[other]) > gate_m)
    near_ones = np.flatnonzero(near)
    one, other = one[near_ones], other[near_ones]
    variance = np.nan_to_num(places.angle_variance_rad2)
    gate_rad = rate_rad_s * apart_s[near_ones]
    gate_rad += GATE_DEVIATIONS * np.sqrt(variance[one] + variance[other])
    chord = np.linalg.norm(places.direction[one] - places.direction[other], axis=-1)
    near[near_ones] = chord <= 2.0 * np.sin(np.minimum(0.5 * gate_rad, 0.5 * np.pi))
    return near


class DeclaredPlaces:
    """Remembers the last scans' detections, and when each target was first declared."""

    #: Goes on where the sensor changes (`Component.remembers`).
    remembers = ("_memory", "_first", "names")

    def __init__(self, block: Any) -> None:
        p = block.p
        self.m, self.n = p.declare_m, p.declare_n
        self._speed_m_s = p.declare_speed_m_s
        self._rate_rad_s = np.radians(p.declare_rate_deg_s)
        self._ticks_per_s = block.context.ticks_per_s
        self._memory: SeenPlaces | None = None
        self._first: dict[str, tuple[int, float]] = {}
        self.names: tuple[str, ...] = ()

    def __call__(self, detections: Detections, targets: Any, rows: Any) -> Detections:
        """Return the report with a column ``declared``."""
        new = self._places_of_detections(detections)
        known, asked = new, np.arange(len(new))
        if self._memory is not None:
            known = self._memory.append(new)
            asked = asked + len(self._memory)
            order = RunTicks(known.run, known.scan).sort_indices()
            if order is not None:  # runs come back one after the other
                known, asked = known.take(order), np.flatnonzero(order >= len(self._memory))
        company = count_scans_with_neighbour(
            known, asked, self.n, speed_m_s=self._speed_m_s, rate_rad_s=self._rate_rad_s
        )
        declared = company >= self.m
        if len(detections):
            self._memory = known.take(
                known.scan > self._last_run_scan_by_place(detections, known) - self.n + 1
            )
        self._store_first_declarations(
            detections, np.flatnonzero(declared & (detections.target >= 0))
        )
        return replace(detections, extras={**detections.extras, "declared": declared})

    def _last_run_scan_by_place(self, detections: Detections, known: SeenPlaces) -> IntArray:
        """Return, for each place in `known`, its run's last scan in the detections, or its own."""
        ends = detections.instants.last_position_of_runs
        runs, last = detections.run[ends], detections.scan[ends]
        index = np.minimum(np.searchsorted(runs, known.run), len(runs) - 1)
        return np.where(runs[index] == known.run, last[index], known.scan)

    def _places_of_detections(self, detections: Detections) -> SeenPlaces:
        counts = np.diff(detections.offsets)
        direction = unit_vector(detections.azimuth_rad, detections.elevation_rad)
        own = detections.pose_columns()
        if own:
            turned = (own[f"own_{name}_rad"] for name in ("heading", "pitch", "roll"))
            direction = body_to_ned(*direction, *turned)
        level = np.cos(detections.elevation_rad)
        return SeenPlaces(
            run=np.repeat(detections.run, counts),
            scan=np.repeat(detections.scan, counts),
            time_s=detections.measured_ticks() / self._ticks_per_s,
            direction=np.stack(direction, axis=-1),
            range_m=detections.range_m,
            angle_variance_rad2=detections.azimuth_variance_rad2 * level**2
            + detections.elevation_variance_rad2,
            range_variance_m2=detections.range_variance_m2,
        )

    def _store_first_declarations(self, detections: Detections, declared: IntArray) -> None:
        self.names = detections.roster.names
        row = detections.row_of_entries
        target, place = np.unique(detections.target[declared], return_index=True)
        for index, entry in zip(target.tolist(), declared[place].tolist(), strict=True):
            tick = int(detections.tick[row[entry]])
            self._first.setdefault(self.names[index], (tick, float(detections.true_range_m[entry])))

    def first_declaration_tick_and_range(self) -> dict[str, tuple[int, float]]:
        """Return by name each declared target's first declaration tick and true range then, m."""
        return self._first


class DeclarationByPlace(Effect[ReportTransform]):
    """Marks detections whose position had others in m of the last n scans, targets or false alarms.

    Nothing but measured values decides; places are compared in north-east-down by what the
    ownship believes of its attitude, so that its own turns move nothing.
    """

    name = "declaration by place"
    acts_on = REPORT
    builds = DeclaredPlaces
    outside_the_proof = "without it whatever is reported is declared"

    def verdict(self, block: Any) -> Verdict:
        """Return whether declaration counts detections per position, not target, and why."""
        p = block.p
        if p.declare_m is None:
            return Verdict(False, "declare_m and declare_n are not given")
        because = "the sensor has false alarms, and declare_by is not 'target'"
        if p.declare_by is not None:
            because = f"declare_by is '{p.declare_by}'"
        elif p.declares_by_target_or_place == "target":
            because = "without false alarms all that is detected are targets"
        return Verdict(p.declares_by_target_or_place == "place", because)
