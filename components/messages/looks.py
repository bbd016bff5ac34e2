"""Looks of sensors, also those in vain: what a fused row knows of them, and the table ``looks``."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any, ClassVar, Self

import numpy as np

from components.messages.columns import TrueLine
from dsa_des.arrays.entries import selected_offsets_and_indices
from dsa_des.arrays.types import AnyArray, FloatArray, IntArray
from dsa_des.block.message import (
    Column,
    Columns,
    Message,
    Text,
    columns_of_dataclass,
    tick_and_replica_columns,
)


@dataclass(frozen=True, eq=False)
class Looks:
    """The looks behind the rows of a message, also those in which nothing was detected.

    Looks ``offsets[i]:offsets[i + 1]`` belong to row i.
    """

    offsets: IntArray  # (rows + 1,)
    sensor: IntArray  # (looks,): index into the message's `sensors`
    age_ticks: IntArray  # (looks,): how long before its row's tick each was made
    # (6, looks): the ownship's, as believed then (`Detections`); NaN from a sensor without
    pose: FloatArray

    def __len__(self) -> int:
        return len(self.offsets) - 1

    def take_rows(self, rows: slice | IntArray) -> Self:
        """Return the looks of some rows."""
        offsets, which = selected_offsets_and_indices(self.offsets, rows)
        return type(self)(offsets, self.sensor[which], self.age_ticks[which], self.pose[:, which])

    @classmethod
    def join_rows(cls, parts: Sequence[Self]) -> Self:
        """Return the looks of the rows of all parts, in order."""
        counts = [np.diff(part.offsets) for part in parts]
        joined = {
            item.name: np.concatenate([getattr(part, item.name) for part in parts], axis=-1)
            for item in fields(cls)
            if item.name != "offsets"
        }
        return cls(offsets=np.concatenate(([0], np.cumsum(np.concatenate(counts)))), **joined)


_TRUE = TrueLine.__dataclass_fields__
_NUMBERS = (*_TRUE, "confidence", "snr_db", "detection_probability", "pixels")


@dataclass(eq=False)
class EveryLook(Message):
    """Recorded table of all of a sensor's looks, detected or not; not sent to other blocks."""

    recorded: ClassVar[Mapping[str, Mapping[str, Column]]] = {
        "looks": {
            "scan": Column("", "", "number of the scan", "int64"),
            "target": Column("", "", "name of the target", "text"),
            "evaluated": Column(
                "", "", "whether its physics was evaluated: all else is null without", "bool"
            ),
            "detected": Column("", "", "whether it was detected", "bool"),
            **columns_of_dataclass(TrueLine),
            "confidence": Column(
                "dB or signature", "", "margin that decided, by the kind of sensor"
            ),
            "snr_db": Column(
                "dB", "", "mean signal-to-noise ratio of a radar, or that of a sampled RCS"
            ),
            "detection_probability": Column(
                "", "", "probability with which the detection was drawn"
            ),
            "pixels": Column("pixels", "", "pixels that the target covers in a camera"),
        }
    }


def look_arrays_scans_by_targets(cells: Any, look: Any, scans: int) -> dict[str, AnyArray]:
    """Return cells and look as arrays (scans, targets) by name; NaN or False if not evaluated."""
    shape = (scans, len(cells.roster))
    cell = (cells.row, cells.target)
    looks: dict[str, AnyArray] = {}
    for name, values in (("evaluated", True), ("detected", look.detected)):
        looks[name] = np.zeros(shape, dtype=bool)
        looks[name][cell] = values
    known = {
        "true_azimuth_rad": cells.body_azimuth_rad,
        "true_elevation_rad": cells.body_elevation_rad,
        "true_range_m": cells.range_m,
        "confidence": look.confidence,
        **look.extras,
    }
    for name in _NUMBERS:
        looks[name] = np.full(shape, np.nan)
        if name in known:
            looks[name][cell] = known[name]
    return looks


def look_columns(detections: Any) -> Columns:
    """Return the recorded table of looks, with one row per scan and target."""
    count = len(detections.roster)
    row = np.repeat(np.arange(len(detections)), count)
    columns: Columns = {
        **tick_and_replica_columns(detections, row),
        "scan": detections.scan.take(row),
        "target": Text(np.tile(np.arange(count), len(detections)), detections.roster.names),
    }
    columns.update({name: values.reshape(-1) for name, values in detections.looks.items()})
    return columns
