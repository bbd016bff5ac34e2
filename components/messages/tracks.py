"""The message of a tracker that holds measurements: one entry per target and instant.

Angles are in radians; azimuth is clockwise and elevation upward.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Self

from components.aircraft.aircraft import Roster
from components.messages.columns import ERRING_POSE, MeasuredLine, target_name_of_each_entry
from components.messages.contributors import contributor_names_by_entry
from dsa_des.arrays.types import BoolArray, FloatArray, IntArray
from dsa_des.block.message import Message, column, columns, per_entry, static


@dataclass(eq=False)
class Tracks(MeasuredLine, Message):
    """The tracks of a tracker after each update, one entry per target.

    The held line of sight is in the ownship's body axes.

    Parameters
    ----------
    contributors : (entries,) of int
        Sensors of the last update, as in `FusedDetections`.
    measured_tick : (entries,) of int
        When what is held was measured. By default the row's tick.
    updated : (entries,) of bool
        Whether it came at this row's instant; others were held. By default what has no age.
    """

    entry_table = "tracks"

    offsets: IntArray
    target: IntArray = column("", "", "name of the target", "text", value=target_name_of_each_entry)
    age_s: FloatArray = column("s", "", "time since what is held was measured")
    contributors: IntArray = column(
        "", "", "sensors of that update, joined by +", "text",
        name="updated_by", value=contributor_names_by_entry,
    )  # fmt: skip
    roster: Roster = static()
    sensors: tuple[str, ...] = static()
    measured_tick: IntArray = column(
        "s", "", "when it was measured", name="measured_s", instant=True, default=None,
        kw_only=True,
    )  # fmt: skip
    ticks_per_s: int = static(default=10**9, kw_only=True)
    updated: BoolArray = per_entry(default=None, kw_only=True)

    def __post_init__(self) -> None:
        if self.measured_tick is None:
            self.measured_tick = self.tick.take(self.row_of_entries)
        if self.updated is None:
            self.updated = self.age_s <= 0.0

    @classmethod
    def make_initial(cls, values: Mapping[str, object]) -> Self:
        """Return a message without tracks; the scene's table must be empty."""
        if values:
            raise ValueError("tracks before the first message can only be an empty table, {}")
        return cls.empty(roster=Roster.from_pairs([]), sensors=(), measured_tick=None)


@dataclass(eq=False)
class TracksWithPose(Tracks):
    """Tracks of a scene with navigation errors, with the believed pose at each measurement."""

    own_of_entries: dict[str, FloatArray] = columns(ERRING_POSE, kw_only=True)
