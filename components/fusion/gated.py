"""Gated fusion: detections that lie close in time and place belong together (``fusion.gated``)."""

import math
from fractions import Fraction
from typing import Any, ClassVar, NamedTuple

import numpy as np
from pydantic import Field

from components.fusion.fusion_block import Fusion, largest_delay_s, ownship_poses_of_entries
from components.fusion.ladder import FUSION_LADDER
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
from dsa_des.arrays.run_ticks import (
    RunTicks,
    first_position_at_or_after,
    last_position_at_or_before,
)
from dsa_des.arrays.types import FloatArray, IntArray
from dsa_des.block.component import NonNegativeRational, Parameters
from dsa_des.block.wake import Arrivals, Wake


class Entries(NamedTuple):
    """One sensor's detections by entry, with their runs, times and the ownship's poses."""

    message: Any  # What was measured: azimuth, elevation, range and its rate
    run: IntArray
    made: IntArray  # Tick of the measurement, and that at which it came
    came: IntArray
    pose: FloatArray  # (6, entries), believed by the ownship; NaN where not stated

    @classmethod
    def from_arrivals(cls, arrivals: Arrivals) -> "Entries":
        """Return the entries of all detections that arrived from a sensor."""
        message, row = arrivals.message, arrivals.message.row_of_entries
        made = message.measured_ticks()
        return cls(
            message, message.run[row], made, arrivals.tick[row], ownship_poses_of_entries(message)
        )


class Gates(NamedTuple):
    """How far apart detections that belong together may be."""

    ticks: int  # Of the measurements
    came_ticks: int  # How much earlier another one may have come
    angle_rad: float
    range_m: float
    ticks_per_s: int


def extrapolate_entries(
    one: Entries, mine: IntArray, other: Entries, theirs: IntArray, ticks_per_s: int
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return azimuth, elevation (rad), range (m) of ``theirs`` moved to the times of ``mine``.

    What is known of the time between is how the ownship turned and moved, by the poses that it
    believed itself to have, and how the range changed, where its rate was measured. A target's
    own motion across the line of sight is not: the gates are there for it. A detection without
    a range is taken to be as far away as the one that it is compared with.
    """
    message = other.message
    azimuth, elevation = message.azimuth_rad[theirs], message.elevation_rad[theirs]
    range_m = message.range_m[theirs]
    before, after = other.pose[:, theirs], one.pose[:, mine]
    ticks = one.made[mine] - other.made[theirs]
    known = np.isfinite(before).all(axis=0) & np.isfinite(after).all(axis=0)
    moved = np.flatnonzero((ticks != 0) & known)
    if len(moved) == 0:
        return azimuth, elevation, range_m
    before, after = before[:, moved], after[:, moved]
    line = unit_vector_unchecked(azimuth[moved], elevation[moved])
    seen = np.stack(body_to_ned(*line, *before[3:]))
    reach = range_m[moved]
    away = np.where(np.isnan(reach), one.message.range_m[mine[moved]], reach)
    step = np.stack(line_of_sight_ned(*before[:3], *after[:3], validate=False))
    # Without any range the parallax is not known.
    vector = np.where(np.isnan(away), seen, away * seen - step)
    length = np.sqrt((vector**2).sum(axis=0))
    ahead = ned_to_body(*(vector / np.maximum(length, 1e-9)), *after[3:])
    azimuth[moved], elevation[moved] = body_angles(*ahead)
    by_rate = reach + message.range_rate_m_s[theirs[moved]] * ticks[moved] / ticks_per_s
    by_step = np.where(np.isnan(reach), np.nan, length)
    range_m[moved] = np.where(np.isnan(by_rate), by_step, by_rate)
    return azimuth, elevation, range_m


def nearest_in_gate(one: Entries, anchors: IntArray, other: Entries, gates: Gates) -> IntArray:
    """Return for each anchor in ``one`` the index of its entry of ``other``, or -1.

    Of the entries in the gates those nearest in time count, of these the one nearest in angle,
    then in range. Nothing but measured values decides.
    """
    best = np.full(len(anchors), -1, dtype=np.int64)
    if len(other.made) == 0:
        return best
    asked = RunTicks(one.run[anchors], one.made[anchors])
    others = RunTicks(other.run, other.made)
    order = others.sort_indices()
    in_time = np.arange(len(others)) if order is None else order
    others = others.take(in_time)
    first = first_position_at_or_after(others, asked.add_ticks(-gates.ticks))
    counts = first_position_at_or_after(others, asked.add_ticks(gates.ticks + 1)) - first
    which = np.repeat(np.arange(len(anchors)), counts)
    start = np.repeat(np.cumsum(counts) - counts, counts)
    candidate = in_time[np.arange(len(which)) - start + np.repeat(first, counts)]
    waited = one.came[anchors[which]] - other.came[candidate]
    known = (waited >= 0) & (waited <= gates.came_ticks)
    which, candidate = which[known], candidate[known]
    mine = anchors[which]
    azimuth, elevation, range_m = extrapolate_entries(
        one, mine, other, candidate, gates.ticks_per_s
    )
    apart_rad = angle_by_haversine(
        one.message.azimuth_rad[mine], one.message.elevation_rad[mine], azimuth, elevation
    )
    apart_m = np.abs(one.message.range_m[mine] - range_m)
    # Where either has no range the difference is NaN, and the range gate is open.
    inside = np.flatnonzero((apart_rad <= gates.angle_rad) & ~(apart_m > gates.range_m))
    late = np.abs(other.made[candidate] - one.made[mine])
    # The first of each anchor counts. A sensor's own order would tell who is who, so that alike
    # ones are told apart by what was measured of them, as long as that differs.
    keys = (candidate, range_m, elevation, azimuth, apart_m, apart_rad, late, which)
    chosen = inside[np.lexsort([key[inside] for key in keys])]
    anchor, index = np.unique(which[chosen], return_index=True)
    best[anchor] = candidate[chosen[index]]
    return best


class GatedParameters(Parameters):
    """Parameters of gated fusion."""

    may_change: ClassVar[tuple[str, ...]] = ("angle_gate_deg", "range_gate_m")

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
    """Combines different sensors' detections within gates of time, direction and range.

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
    ladders = (FUSION_LADDER,)

    def window_s(self) -> Any:
        """Return ``time_gate_s``, the age (s) up to which detections can be fused with new ones."""
        return self.p.time_gate_s

    def setup(self) -> None:
        """Rank the sensors, and learn how late their detections may come."""
        super().setup()
        latest_s = max(
            (largest_delay_s(producer) for producer in self.context.producers), default=0
        )
        self.keep_ticks = self.gate_ticks + math.ceil(latest_s * self.context.ticks_per_s)

    def run(self, wake: Wake) -> FusedDetections | None:
        """Fuse detections whose measurements lie within each other's gates."""
        reported = {new.source: new for new in wake.arrivals("detections")}
        if not reported:
            return None
        since = {name: int(new.tick.min()) for name, new in reported.items()}
        arrivals = self.merge_recent(reported, wake)
        best_first = [self.sensors[index] for index in reversed(self.by_angles)]
        order = [name for name in best_first if name in arrivals]
        seen = {name: Entries.from_arrivals(arrivals[name]) for name in order}
        gates = Gates(
            self.gate_ticks, self.keep_ticks, float(np.radians(self.p.angle_gate_deg)),
            self.p.range_gate_m, self.context.ticks_per_s,
        )  # fmt: skip
        # What came before this wake was reported then; it can only be gathered now.
        free = {
            name: one.came >= since[name] if name in since else np.zeros(len(one.came), dtype=bool)
            for name, one in seen.items()
        }
        rows: list[IntArray] = []
        anchors: list[tuple[str, IntArray]] = []
        gathered: dict[str, list[IntArray]] = {name: [] for name in order}
        for anchor in order:
            mine, one = np.flatnonzero(free[anchor]), seen[anchor]
            rows.append(
                last_position_at_or_before(wake.instants, RunTicks(one.run[mine], one.came[mine]))
            )
            anchors.append((anchor, mine))
            for other in order:
                if other == anchor:
                    gathered[other].append(mine)
                    continue
                entry = nearest_in_gate(one, mine, seen[other], gates)
                together = np.flatnonzero(entry >= 0)
                same = seen[other].came[entry[together]] == one.came[mine[together]]
                free[other][entry[together][same]] = False
                gathered[other].append(entry)
        in_order = self._sort_order(rows, anchors, arrivals)
        row = np.concatenate(rows)[in_order]
        entries = {name: np.concatenate(parts)[in_order] for name, parts in gathered.items()}
        target = self._true_targets(entries, arrivals, order)
        return self.combine(wake.instants, row, target, arrivals, entries)

    def _sort_order(
        self,
        rows: list[IntArray],
        anchors: list[tuple[str, IntArray]],
        arrivals: dict[str, Arrivals],
    ) -> IntArray:
        """Return the indices that sort fused detections by instant, sensor and measured values."""
        taken = [(arrivals[name].message, mine) for name, mine in anchors]
        measured = [
            np.concatenate([getattr(message, column)[mine] for message, mine in taken])
            for column in ("range_m", "elevation_rad", "azimuth_rad")
        ]
        rank = np.repeat(np.arange(len(anchors)), [len(mine) for _, mine in anchors])
        return np.lexsort((*measured, rank, np.concatenate(rows)))

    def _true_targets(
        self, entries: dict[str, IntArray], arrivals: dict[str, Arrivals], order: list[str]
    ) -> IntArray:
        """Return each fused detection's true target, which is recorded but decides nothing."""
        target = np.full(len(next(iter(entries.values()))), FALSE_TARGET, dtype=np.int64)
        for name in reversed(order):
            entry = entries[name]
            some = np.flatnonzero(entry >= 0)
            seen = arrivals[name].message.target[entry[some]]
            target[some[seen >= 0]] = seen[seen >= 0]
        return target
