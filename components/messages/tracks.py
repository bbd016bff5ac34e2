"""The message of a tracker that holds measurements: one entry per target and instant.

Angles are in radians; azimuth is clockwise and elevation upward.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Self

import numpy as np

from components.aircraft.aircraft import Roster
from components.messages.columns import DESCRIBED
from components.messages.contributors import contributor_names
from components.messages.detections import POSE, target_names
from dsa_des.arrays.types import BoolArray, FloatArray, IntArray
from dsa_des.block.message import Message, per_entry, per_entry_tick, static


@dataclass(eq=False)
class Tracks(Message):
    """What a tracker holds of each target, at each instant it was updated.

    Parameters
    ----------
    offsets : (rows + 1,)
    target : (entries,) of int
    azimuth_rad, elevation_rad, range_m : (entries,)
        Held measurement, ownship's body axes; range NaN when it had none.
    age_s : (entries,)
        Time since what is held was measured.
    contributors : (entries,) of int
        Sensors of the last update, as in `FusedDetections`.
    roster : Roster
    sensors : tuple of str
    measured_tick : (entries,) of int
        When it was measured. By default the row's tick.
    updated : (entries,) of bool
        Whether it came at this row's instant; others were held. By default what has no age.
    """

    described = DESCRIBED
    entry_table = "tracks"

    offsets: IntArray
    target: IntArray = per_entry(column="text", value=target_names)
    azimuth_rad: FloatArray = per_entry(column="float64")
    elevation_rad: FloatArray = per_entry(column="float64")
    range_m: FloatArray = per_entry(column="float64")
    age_s: FloatArray = per_entry(column="float64")
    contributors: IntArray = per_entry(column="text", name="updated_by", value=contributor_names)
    roster: Roster = static()
    sensors: tuple[str, ...] = static()
    measured_tick: IntArray = per_entry_tick(name="measured_s", default=None, kw_only=True)
    ticks_per_s: int = static(default=10**9, kw_only=True)
    updated: BoolArray = per_entry(default=None, kw_only=True)

    def __post_init__(self) -> None:
        if self.measured_tick is None:
            self.measured_tick = np.repeat(self.tick, np.diff(self.offsets))
        if self.updated is None:
            self.updated = self.age_s <= 0.0

    @classmethod
    def initial(cls, values: Mapping[str, object]) -> Self:
        """Return a message without tracks; the scene's table must be empty."""
        if values:
            raise ValueError("tracks before the first message can only be an empty table, {}")
        none, zero = np.empty(0), np.empty(0, dtype=np.int64)
        offsets = np.zeros(2, dtype=np.int64)
        return cls(
            np.zeros(1, dtype=np.int64), offsets, zero, none, none, none, none, zero,
            Roster.of([]), (),
        )  # fmt: skip


@dataclass(eq=False)
class TracksWithPose(Tracks):
    """The same where navigation errs.

    Parameters
    ----------
    own_of_entries : dict of (entries,)
        The ownship's pose as it believed it to be when what is held was measured.
    """

    own_of_entries: dict[str, FloatArray] = per_entry(columns=POSE, kw_only=True)
