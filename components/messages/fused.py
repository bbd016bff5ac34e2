"""The message of fusion: one line of sight per target and instant, of several sensors.

Angles are in radians; azimuth is clockwise and elevation upward.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

from components.aircraft.aircraft import Roster
from components.messages.columns import (
    ERRING_POSE,
    MeasuredLine,
    StatedErrors,
    TrueLine,
    target_name_of_each_entry,
)
from components.messages.contributors import contributor_names_by_entry
from components.messages.looks import Looks
from dsa_des.arrays.types import FloatArray, IntArray
from dsa_des.block.message import Message, Text, column, columns, per_entry, per_row, static

#: What a block that takes fused detections requests if the ownship's pose is nothing to it.
WITHOUT_POSE = "without pose"


@dataclass(eq=False)
class FusedDetections(MeasuredLine, TrueLine, StatedErrors, Message):
    """One line of sight per target and instant, put together from the sensors.

    Parameters
    ----------
    contributors : (entries,) of int
        Bit i is set when ``sensors[i]`` contributed; of the type `mask_dtype_for_sensors` gives.
    angle_source, range_source : (entries,) of int
        Index into `sensors`; -1 for none.
    measured_tick : (entries,) of int
        When the angles were measured, whenever that came here: pose, variances of the angles and
        everything true are of this instant. By default that of the row.
    own_of_entries : dict of (entries,), or None
        The ownship's pose as it believed it to be then, by column (`POSE`); None where nobody asks.
    own_velocity : dict of (entries,), or None
        How the ownship moved (`OWN_VELOCITY`) when the range rate was measured; NaN where none
        was, None from a fusion of sensors that measure none.
    told_by_target : dict of (entries,), or None
        As `Detections` has it, of the sensor that the range is of; NaN where nothing is reported.
    measurements : FusedDetections or None
        What of these is new to a tracker and of one instant, at the same rows: each detection that
        some row takes values of, once. None where it is these themselves.
    looks : Looks or None
        Which sensors looked when, also in vain; None from a fusion that does not say.
    sensors : tuple of str
        Those with range first, each group by name.
    """

    entry_table = "fused"

    offsets: IntArray
    target: IntArray = column("", "", "name of the target", "text", value=target_name_of_each_entry)
    contributors: IntArray = column(
        "", "", "sensors that were fused, joined by +", "text",
        name="sensors", value=contributor_names_by_entry,
    )  # fmt: skip
    angle_source: IntArray = column(
        "", "", "sensor that the angles are of", "text",
        value=lambda message: Text(message.angle_source, message.sensors),
    )  # fmt: skip
    range_source: IntArray = column(
        "", "", "sensor that the range is of; null without one", "text",
        value=lambda message: Text(message.range_source, message.sensors),
    )  # fmt: skip
    roster: Roster = static()
    sensors: tuple[str, ...] = static()
    measured_tick: IntArray = column(
        "s", "", "when the angles were measured; all that is true is of then",
        name="measured_s", instant=True, default=None, kw_only=True,
    )  # fmt: skip
    ticks_per_s: int = static(default=10**9, kw_only=True)
    own_of_entries: dict[str, FloatArray] | None = per_entry(default=None, kw_only=True)
    own_velocity: dict[str, FloatArray] | None = per_entry(default=None, kw_only=True)
    told_by_target: dict[str, FloatArray] | None = per_entry(default=None, kw_only=True)
    looks: Looks | None = per_row(default=None, kw_only=True)
    measurements: "FusedDetections | None" = per_row(default=None, kw_only=True)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.measured_tick is None:
            self.measured_tick = self.tick.take(self.row_of_entries)

    def take_rows(self, rows: slice | IntArray) -> Self:
        """Return the fused detections of the given message rows."""
        return self.take(rows)

    @classmethod
    def join_rows(cls, parts: Sequence[Self]) -> Self:
        """Return one message with the rows of all parts, in order."""
        return cls.concatenate(parts)

    def pose_columns(self) -> dict[str, FloatArray]:
        """Return the ownship's believed pose at each entry, by column; empty without one."""
        return self.own_of_entries or {}


@dataclass(eq=False)
class FusedWithPose(FusedDetections):
    """Fused detections of a scene with navigation errors, recorded with the believed pose."""

    own_of_entries: dict[str, FloatArray] | None = columns(
        ERRING_POSE, value=lambda m: m.pose_columns(), default=None, kw_only=True
    )
