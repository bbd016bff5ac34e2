"""The way of a sensor's false alarms through fusion: alone, with the sensor's name on them.

Fusion knows which detections belong together by their targets, and a false alarm has none. So it
is never merged, neither with a detection nor with another false alarm, not even of the same cell.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from components.fusion.fusion_block import poses, velocities
from components.messages.columns import MEASURED, OWN_VELOCITY, POSE
from components.messages.contributors import mask_type
from components.messages.false_detections import FALSE_TARGET
from components.messages.fused import FusedDetections
from dsa_des.arrays.types import IntArray
from dsa_des.block.wake import Arrivals


def pass_false_alarms(
    fused: FusedDetections, arrivals: Mapping[str, Arrivals], ranging: Sequence[str]
) -> FusedDetections:
    """Return fused detections with the false alarms of each instant after them.

    Parameters
    ----------
    fused : FusedDetections
    arrivals : mapping of Arrivals
        What sensors reported, by name.
    ranging : sequence of str
        Sensors that measure range.

    Returns
    -------
    FusedDetections
        `fused` itself when there is no false alarm. Of one instant they are in the order of the
        fused message's sensors, and of each sensor as it reported them.
    """
    rows: list[IntArray] = [np.repeat(np.arange(len(fused)), np.diff(fused.offsets))]
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
        row = np.searchsorted(fused.tick, new.tick)
        rows.append(np.repeat(row, np.diff(new.message.offsets))[false])
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
