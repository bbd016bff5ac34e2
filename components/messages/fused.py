"""The message of fusion: one line of sight per target and instant, of several sensors.

Angles are in radians; azimuth is clockwise and elevation upward.
"""

from dataclasses import dataclass

import numpy as np

from components.aircraft.aircraft import Roster
from components.messages.columns import DESCRIBED
from components.messages.contributors import contributor_names
from components.messages.detections import POSE, fill_measured, measured_column, target_names
from components.messages.looks import Looks
from dsa_des.arrays.types import FloatArray, IntArray
from dsa_des.block.message import Message, Text, per_entry, per_entry_tick, per_row, static

#: What a block that takes fused detections requests if the ownship's pose is nothing to it.
WITHOUT_POSE = "without pose"


@dataclass(eq=False)
class FusedDetections(Message):
    """One line of sight per target and instant, put together from the sensors.

    Parameters
    ----------
    offsets : (rows + 1,)
    target : (entries,) of int
    azimuth_rad, elevation_rad : (entries,)
        In the ownship's body axes.
    range_m : (entries,)
        NaN when no contributing sensor measures range.
    contributors : (entries,) of int
        Bit i is set when ``sensors[i]`` contributed; of the type `mask_type` gives.
    angle_source, range_source : (entries,) of int
        Index into `sensors`; -1 for none.
    true_azimuth_rad, true_elevation_rad, true_range_m : (entries,)
    measured_tick : (entries,) of int
        When the angles were measured, whenever that came here: pose, variances of the angles and
        everything true are of this instant. By default that of the row.
    own_of_entries : dict of (entries,), or None
        The ownship's pose as it believed it to be then, by column (`POSE`); None where nobody asks.
    range_rate_m_s, azimuth_variance_rad2, elevation_variance_rad2, range_variance_m2, \
    range_rate_variance_m2_s2 : (entries,)
        As the sensors that gave the values stated them; NaN where they did not.
    own_velocity : dict of (entries,), or None
        How the ownship moved (`OWN_VELOCITY`) when the range rate was measured; NaN where none
        was, None from a fusion of sensors that measure none.
    looks : Looks or None
        Which sensors looked when, also in vain; None from a fusion that does not say.
    roster : Roster
    sensors : tuple of str
        Those with range first, each group by name.
    """

    described = DESCRIBED
    entry_table = "fused"

    offsets: IntArray
    target: IntArray = per_entry(column="text", value=target_names)
    contributors: IntArray = per_entry(column="text", name="sensors", value=contributor_names)
    azimuth_rad: FloatArray = per_entry(column="float64")
    elevation_rad: FloatArray = per_entry(column="float64")
    range_m: FloatArray = per_entry(column="float64")
    angle_source: IntArray = per_entry(
        column="text", value=lambda message: Text(message.angle_source, message.sensors)
    )
    range_source: IntArray = per_entry(
        column="text", value=lambda message: Text(message.range_source, message.sensors)
    )
    true_azimuth_rad: FloatArray = per_entry(column="float64")
    true_elevation_rad: FloatArray = per_entry(column="float64")
    true_range_m: FloatArray = per_entry(column="float64")
    roster: Roster = static()
    sensors: tuple[str, ...] = static()
    measured_tick: IntArray = per_entry_tick(name="measured_s", default=None, kw_only=True)
    ticks_per_s: int = static(default=10**9, kw_only=True)
    own_of_entries: dict[str, FloatArray] | None = per_entry(default=None, kw_only=True)
    range_rate_m_s: FloatArray = measured_column()
    azimuth_variance_rad2: FloatArray = measured_column()
    elevation_variance_rad2: FloatArray = measured_column()
    range_variance_m2: FloatArray = measured_column()
    range_rate_variance_m2_s2: FloatArray = measured_column()
    own_velocity: dict[str, FloatArray] | None = per_entry(default=None, kw_only=True)
    looks: Looks | None = per_row(default=None, kw_only=True)

    def __post_init__(self) -> None:
        fill_measured(self)
        if self.measured_tick is None:
            self.measured_tick = np.repeat(self.tick, np.diff(self.offsets))

    def pose_columns(self) -> dict[str, FloatArray]:
        """Return the ownship's believed pose at each entry, by column; empty where none is told."""
        return self.own_of_entries or {}


@dataclass(eq=False)
class FusedWithPose(FusedDetections):
    """The same where navigation errs: the ownship's believed pose is recorded beside each line."""

    own_of_entries: dict[str, FloatArray] | None = per_entry(
        columns=POSE, value=lambda m: m.pose_columns(), default=None, kw_only=True
    )
