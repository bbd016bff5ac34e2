"""Pick-best fusion: radar gives range, optics give the angles (``fusion.pick_best``, §3.6)."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from typing import Any

import numpy as np
from pydantic import Field

from components.fusion.fusion_block import (
    FUSION_LADDER,
    Fusion,
    latest_in_gate,
    poses,
    velocities,
)
from components.messages.columns import MEASURED, OWN_VELOCITY, POSE
from components.messages.contributors import mask_type
from components.messages.false_detections import FALSE_TARGET, true_entries
from components.messages.fused import FusedDetections
from dsa_des.arrays.run_ticks import last_of_run
from dsa_des.arrays.sorted_union import sorted_union
from dsa_des.arrays.types import IntArray
from dsa_des.block.component import NonNegativeRational, Parameters
from dsa_des.block.wake import Arrivals, Wake


def pass_false_alarms(
    fused: FusedDetections, arrivals: Mapping[str, Arrivals], ranging: Sequence[str]
) -> FusedDetections:
    """Return fused detections with the false alarms of each instant after them."""
    rows: list[IntArray] = [fused.row_of_entries]
    columns: dict[str, list[Any]] = {
        name: [getattr(fused, name)]
        for name in (
            "target", "azimuth_rad", "elevation_rad", "range_m", "contributors", "angle_source",
            "range_source", "true_azimuth_rad", "true_elevation_rad", "true_range_m",
            "measured_tick", *MEASURED,
        )
    }  # fmt: skip
    own = [np.stack(list(fused.pose_columns().values()))] if fused.pose_columns() else None
    known = fused.own_velocity
    moves = None if known is None else [np.stack(list(known.values()))]
    for index, name in enumerate(fused.sensors):
        if name not in arrivals:
            continue
        new = arrivals[name]
        false = np.flatnonzero(new.message.target == FALSE_TARGET)
        if len(false) == 0:
            continue
        row = last_of_run(fused.instants, new.instants)
        rows.append(row[new.message.row_of_entries[false]])
        for column in ("azimuth_rad", "elevation_rad", "range_m"):
            columns[column].append(getattr(new.message, column)[false])
            columns[f"true_{column}"].append(np.full(len(false), np.nan))
        for column in MEASURED:
            columns[column].append(getattr(new.message, column)[false])
        columns["measured_tick"].append(new.message.measured_ticks()[false])
        if own is not None:
            own.append(poses(new.message)[:, false])
        if moves is not None:
            moves.append(velocities(new.message)[:, false])
        for column, value in (
            ("target", FALSE_TARGET),
            ("contributors", 1 << index),
            ("angle_source", index),
            ("range_source", index if name in ranging else -1),
        ):
            kind = mask_type(len(fused.sensors)) if column == "contributors" else np.int64
            columns[column].append(np.full(len(false), value, dtype=kind))
    if len(rows) == 1:
        return fused
    joined = np.concatenate(rows)
    # Stable: fused detections first, then sensor by sensor.
    order = np.argsort(joined, kind="stable")
    values: dict[str, Any] = {name: np.concatenate(parts)[order] for name, parts in columns.items()}
    offsets = np.searchsorted(joined[order], np.arange(len(fused) + 1))
    if own is not None:
        pose = np.concatenate(own, axis=1)[:, order]
        values["own_of_entries"] = dict(zip(POSE, pose, strict=True))
    if moves is not None:
        velocity = np.concatenate(moves, axis=1)[:, order]
        values["own_velocity"] = dict(zip(OWN_VELOCITY, velocity, strict=True))
    return replace(fused, offsets=offsets, **values)


class PickBestParameters(Parameters):
    """Parameters of pick-best fusion."""

    coincidence_s: NonNegativeRational = Field(
        default=Fraction(0),
        description="How old another sensor's detection may be and still count as the same "
        "look, s; 0 fuses detections of the same instant only (Fig. 4.22).",
    )


class PickBest(Fusion):
    """Puts together, per target, the best of what the sensors report.

    Range comes from a sensor that measures it, angles from one that does not (an optical one)
    where there is one; among equals the finest angular resolution wins, then the name. What is
    missing is taken from what there is. Output comes at every instant a sensor reports, for the
    targets detected then. False alarms pass through alone: only a target ties detections together.
    """

    Parameters = PickBestParameters
    lockstep = True
    ladders = (FUSION_LADDER,)

    def left_out(self) -> list[str]:
        """Say what decides here which detections belong together."""
        return [
            "association by truth: detections of the same target are put together, whatever was "
            "measured, and a false alarm with none (fusion.gated goes by measured values alone)"
        ]

    def window_s(self) -> Any:
        """Return ``coincidence_s``."""
        return self.p.coincidence_s

    def run(self, wake: Wake) -> FusedDetections | None:
        """Fuse the detections of every instant."""
        reported = {new.source: new for new in wake.arrivals("detections")}
        if not reported:
            return None
        arrivals = reported
        true = {name: true_entries(new.message) for name, new in reported.items()}
        all_true = all(true[name] is new.message for name, new in reported.items())
        if not all_true:
            arrivals = {n: Arrivals(n, new.instants, true[n]) for n, new in reported.items()}
        roster = next(iter(arrivals.values())).message.roster
        width = max(1, len(roster))
        keys = [_keys(new, wake, width) for new in arrivals.values()]
        union, positions = sorted_union(keys)
        row = union // width
        target = union - row * width
        if self.gate_ticks:
            arrivals = self.with_recent(arrivals, wake)
            entries = {
                name: latest_in_gate(new, wake.instants.take(row), target, self.gate_ticks)
                for name, new in arrivals.items()
            }
        else:
            entries = {name: np.full(len(union), -1, dtype=np.int64) for name in arrivals}
            for entry, at in zip(entries.values(), positions, strict=True):
                entry[at] = np.arange(len(at))
        fused = self.combine(wake.instants, row, target, arrivals, entries)
        if all_true:
            return fused
        return pass_false_alarms(fused, reported, [self.sensors[i] for i in self.by_range])


def _keys(new: Arrivals, wake: Wake, width: int) -> IntArray:
    """Return instant · width + target of every detection."""
    row = last_of_run(wake.instants, new.instants)  # they are among them
    return row.take(new.message.row_of_entries) * width + new.message.target
