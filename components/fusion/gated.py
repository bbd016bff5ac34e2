"""Gated fusion: detections that lie close in time and place belong together (``fusion.gated``)."""

import math
from collections.abc import Callable
from fractions import Fraction
from typing import Any

import numpy as np
from pydantic import Field

from components.fusion.fusion_block import FUSION_LADDER, Fusion, how_late_s, poses
from components.geometry import (
    angle_by_haversine,
    body_angles,
    body_to_ned,
    line_of_sight_ned,
    ned_to_body,
    unit_vector_unchecked,
)
from components.messages.false_detections import FALSE_TARGET
from components.messages.fused import FusedDetections
from dsa_des.arrays.run_ticks import RunTicks, last_of_run, next_of_run, no_runs
from dsa_des.arrays.types import FloatArray, IntArray
from dsa_des.block.component import NonNegativeRational, Parameters
from dsa_des.block.wake import Arrivals, Wake


class Carrier:
    """Carries detections of one sensor to the instants of another one's.

    What is known of the time between is how the ownship turned and moved, by the poses that it
    believed itself to have, and how the range changed, where its rate was measured. A target's
    own motion across the line of sight is not: the gates are there for it. A detection without
    a range is taken to be as far away as the one that it is compared with.
    """

    def __init__(
        self,
        one: Any,
        one_ticks: IntArray,
        one_pose: FloatArray,
        other: Any,
        other_ticks: IntArray,
        other_pose: FloatArray,
        ticks_per_s: int,
    ) -> None:
        self._one, self._other = one, other
        self._ticks = one_ticks, other_ticks
        self._poses = one_pose, other_pose
        self._ticks_per_s = ticks_per_s

    def __call__(
        self, mine: IntArray, theirs: IntArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return azimuth, elevation and range of entries `theirs` at the instants of `mine`."""
        other = self._other
        azimuth, elevation = other.azimuth_rad[theirs], other.elevation_rad[theirs]
        range_m = other.range_m[theirs]
        before, after = self._poses[1][:, theirs], self._poses[0][:, mine]
        ticks = self._ticks[0][mine] - self._ticks[1][theirs]
        known = np.isfinite(before).all(axis=0) & np.isfinite(after).all(axis=0)
        moved = np.flatnonzero((ticks != 0) & known)
        if len(moved) == 0:
            return azimuth, elevation, range_m
        before, after = before[:, moved], after[:, moved]
        line = unit_vector_unchecked(azimuth[moved], elevation[moved])
        seen = np.stack(body_to_ned(*line, *before[3:]))
        reach = range_m[moved]
        away = np.where(np.isnan(reach), self._one.range_m[mine[moved]], reach)
        step = np.stack(line_of_sight_ned(*before[:3], *after[:3], validate=False))
        # Without any range the parallax is not known.
        vector = np.where(np.isnan(away), seen, away * seen - step)
        length = np.sqrt((vector**2).sum(axis=0))
        ahead = ned_to_body(*(vector / np.maximum(length, 1e-9)), *after[3:])
        azimuth[moved], elevation[moved] = body_angles(*ahead)
        by_rate = reach + other.range_rate_m_s[theirs[moved]] * ticks[moved] / self._ticks_per_s
        by_step = np.where(np.isnan(reach), np.nan, length)
        range_m[moved] = np.where(np.isnan(by_rate), by_step, by_rate)
        return azimuth, elevation, range_m


#: Given entries of one sensor and of another, pair by pair: azimuth, elevation and range of the
#: other one at the instant of the first.
Carried = Callable[[IntArray, IntArray], tuple[FloatArray, FloatArray, FloatArray]]


def nearest_in_gate(
    one: Any,
    anchors: IntArray,
    anchor_ticks: IntArray,
    other: Any,
    other_ticks: IntArray,
    *,
    gate_ticks: int,
    angle_gate_rad: float,
    range_gate_m: float,
    anchor_came: IntArray | None = None,
    other_came: IntArray | None = None,
    keep_ticks: int | None = None,
    carried: Carried | None = None,
    runs: tuple[IntArray, IntArray] | None = None,
) -> IntArray:
    """Return for each anchor the entry of the other sensor that belongs to it, or -1.

    `runs` are those of the anchors and of the other entries, where there are several.
    Of the entries in the gates those nearest in time count, of these the one nearest in angle,
    then in range. Nothing but measured values decides.
    """
    best = np.full(len(anchors), -1, dtype=np.int64)
    if len(other_ticks) == 0:
        return best
    here = anchor_ticks if anchor_came is None else anchor_came
    there = other_ticks if other_came is None else other_came
    if runs is None:
        runs = no_runs(len(anchors)), no_runs(len(other_ticks))
    asked, others = RunTicks(runs[0], anchor_ticks), RunTicks(runs[1], other_ticks)
    order = others.order()
    in_time = np.arange(len(others)) if order is None else order
    others = others.take(in_time)
    first = next_of_run(others, asked.later(-gate_ticks))
    counts = next_of_run(others, asked.later(gate_ticks + 1)) - first
    which = np.repeat(np.arange(len(anchors)), counts)
    start = np.repeat(np.cumsum(counts) - counts, counts)
    candidate = in_time[np.arange(len(which)) - start + np.repeat(first, counts)]
    known = there[candidate] <= here[which]
    if keep_ticks is not None:
        known &= there[candidate] >= here[which] - keep_ticks
    which, candidate = which[known], candidate[known]
    mine = anchors[which]
    azimuth, elevation, range_m = (
        (other.azimuth_rad[candidate], other.elevation_rad[candidate], other.range_m[candidate])
        if carried is None
        else carried(mine, candidate)
    )
    apart_rad = angle_by_haversine(
        one.azimuth_rad[mine], one.elevation_rad[mine], azimuth, elevation
    )
    apart_m = np.abs(one.range_m[mine] - range_m)
    # Where either has no range the difference is NaN, and the range gate is open.
    inside = np.flatnonzero((apart_rad <= angle_gate_rad) & ~(apart_m > range_gate_m))
    late = np.abs(other_ticks[candidate[inside]] - anchor_ticks[which[inside]])
    # The first of each anchor counts. A sensor's own order would tell who is who, so that alike
    # ones are told apart by what was measured of them, as long as that differs.
    order = np.lexsort(
        (
            candidate[inside],
            range_m[inside],
            elevation[inside],
            azimuth[inside],
            apart_m[inside],
            apart_rad[inside],
            late,
            which[inside],
        )
    )
    chosen = inside[order]
    anchor, place = np.unique(which[chosen], return_index=True)
    best[anchor] = candidate[chosen[place]]
    return best


class GatedParameters(Parameters):
    """Parameters of gated fusion."""

    time_gate_s: NonNegativeRational = Field(
        default=Fraction(1, 10),
        description="Farthest apart in time of measurements that belong together, s.",
    )
    angle_gate_deg: float = Field(
        default=2.0, gt=0, le=180, description="Largest angle between lines of sight, deg."
    )
    range_gate_m: float = Field(
        default=300.0, gt=0, description="Largest difference where both measure range, m."
    )


class Gated(Fusion):
    """Puts detections of different sensors together that lie within gates of time and place.

    Nothing is known of who was detected: two aircraft in one gate may be mixed, and a false alarm
    may join a detection, as in a real system. At every instant the sensors that report are taken
    best angles first; each of their detections gathers the nearest detection of every other sensor
    in its gates. One gathered at the same instant makes no row of its own; one detection may be
    gathered by two others. What was measured at another instant is first carried to that of the
    detection that gathers it (`components.fusion.gated`); what a row records is as it was
    measured, of the instants at which it was. The row bears the target of the best sensor whose
    detection has one; that is for the record, neither what is fused nor its order rests on it.
    """

    Parameters = GatedParameters
    lockstep = True
    ladders = (FUSION_LADDER,)

    def window_s(self) -> Any:
        """Return ``time_gate_s``."""
        return self.p.time_gate_s

    def setup(self) -> None:
        """Rank the sensors, and learn how late their detections may come."""
        super().setup()
        latest_s = max((how_late_s(producer) for producer in self.context.producers), default=0)
        self.keep_ticks = self.gate_ticks + math.ceil(latest_s * self.context.ticks_per_s)

    def run(self, wake: Wake) -> FusedDetections | None:
        """Put together what was measured within the gates of what has come."""
        reported = {new.source: new for new in wake.arrivals("detections")}
        if not reported:
            return None
        since = {name: int(new.tick.min()) for name, new in reported.items()}
        arrivals = self.with_recent(reported, wake)
        best_first = [self.sensors[index] for index in reversed(self.by_angles)]
        order = [name for name in best_first if name in arrivals]
        rows_of = {name: _rows_of_entries(arrivals[name]) for name in order}
        came = {name: arrivals[name].tick[rows_of[name]] for name in order}
        runs = {name: arrivals[name].message.run[rows_of[name]] for name in order}
        made = {name: arrivals[name].message.measured_ticks() for name in order}
        pose = {name: poses(arrivals[name].message) for name in order}
        # What came before this wake was reported then; it can only be gathered now.
        free = {
            name: came[name] >= since[name]
            if name in since
            else np.zeros(len(came[name]), dtype=bool)
            for name in order
        }
        rows: list[IntArray] = []
        anchors: list[tuple[str, IntArray]] = []
        gathered: dict[str, list[IntArray]] = {name: [] for name in order}
        for anchor in order:
            mine = np.flatnonzero(free[anchor])
            instants = arrivals[anchor].instants.take(rows_of[anchor][mine])
            rows.append(last_of_run(wake.instants, instants))
            anchors.append((anchor, mine))
            for other in order:
                if other == anchor:
                    gathered[other].append(mine)
                    continue
                one, two = arrivals[anchor].message, arrivals[other].message
                entry = nearest_in_gate(
                    one,
                    mine,
                    made[anchor][mine],
                    two,
                    made[other],
                    gate_ticks=self.gate_ticks,
                    angle_gate_rad=np.radians(self.p.angle_gate_deg),
                    range_gate_m=self.p.range_gate_m,
                    anchor_came=came[anchor][mine],
                    other_came=came[other],
                    keep_ticks=self.keep_ticks,
                    runs=(runs[anchor][mine], runs[other]),
                    carried=Carrier(
                        one, made[anchor], pose[anchor], two, made[other], pose[other],
                        self.context.ticks_per_s,
                    ),
                )  # fmt: skip
                together = np.flatnonzero(entry >= 0)
                same = came[other][entry[together]] == came[anchor][mine[together]]
                free[other][entry[together][same]] = False
                gathered[other].append(entry)
        in_order = self._in_order(rows, anchors, arrivals)
        row = np.concatenate(rows)[in_order]
        entries = {name: np.concatenate(parts)[in_order] for name, parts in gathered.items()}
        target = self._targets(entries, arrivals, order)
        return self.combine(wake.instants, row, target, arrivals, entries)

    def _in_order(
        self,
        rows: list[IntArray],
        anchors: list[tuple[str, IntArray]],
        arrivals: dict[str, Arrivals],
    ) -> IntArray:
        """Return the order of fused detections: by instant, sensor and what was measured."""
        taken = [(arrivals[name].message, mine) for name, mine in anchors]
        measured = [
            np.concatenate([getattr(message, column)[mine] for message, mine in taken])
            for column in ("range_m", "elevation_rad", "azimuth_rad")
        ]
        rank = np.repeat(np.arange(len(anchors)), [len(mine) for _, mine in anchors])
        return np.lexsort((*measured, rank, np.concatenate(rows)))

    def _targets(
        self, entries: dict[str, IntArray], arrivals: dict[str, Arrivals], order: list[str]
    ) -> IntArray:
        """Return the target of each fused detection, for the record: nothing here rests on it."""
        target = np.full(len(next(iter(entries.values()))), FALSE_TARGET, dtype=np.int64)
        for name in reversed(order):
            entry = entries[name]
            found = np.flatnonzero(entry >= 0)
            seen = arrivals[name].message.target[entry[found]]
            target[found[seen >= 0]] = seen[seen >= 0]
        return target


def _rows_of_entries(arrivals: Arrivals) -> IntArray:
    return np.repeat(np.arange(len(arrivals.tick)), np.diff(arrivals.message.offsets))
