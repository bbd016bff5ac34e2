"""The message that tells sensors where to look: cue cones."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from components.messages.columns import DESCRIBED
from dsa_des.arrays.types import BoolArray, FloatArray, IntArray
from dsa_des.block.message import Message, per_entry


@dataclass(eq=False)
class CueCones(Message):
    """Where targets are thought to be, at each instant at which that is told.

    A sensor carries a cone with a range on with its velocity; one without keeps its direction.

    Parameters
    ----------
    offsets : (rows + 1,)
    track : (entries,) of int
        Number of the track that it comes from.
    azimuth_rad, elevation_rad : (entries,)
        Axis of the cone as the ownship saw it at `state_s`, in the frame's axes.
    half_angle_rad : (entries,)
        That holds the target until `until_s`.
    has_range : (entries,) of bool
    north_m, east_m, down_m, north_m_s, east_m_s, down_m_s : (entries,)
        Of the target in the frame; NaN without a range.
    origin_lat_deg, origin_lon_deg, origin_alt_m : (entries,)
        Origin of the frame (WGS 84).
    state_s, until_s : (entries,)
        The instant that it speaks of, and the last at which it counts, since the start of the run.
    """

    described = DESCRIBED
    entry_table = "cues"

    offsets: IntArray
    track: IntArray = per_entry(column="int64")
    azimuth_rad: FloatArray = per_entry(column="float64")
    elevation_rad: FloatArray = per_entry(column="float64")
    half_angle_rad: FloatArray = per_entry(column="float64")
    has_range: BoolArray = per_entry(column="bool")
    north_m: FloatArray = per_entry(column="float64")
    east_m: FloatArray = per_entry(column="float64")
    down_m: FloatArray = per_entry(column="float64")
    north_m_s: FloatArray = per_entry(column="float64")
    east_m_s: FloatArray = per_entry(column="float64")
    down_m_s: FloatArray = per_entry(column="float64")
    origin_lat_deg: FloatArray = per_entry(column="float64")
    origin_lon_deg: FloatArray = per_entry(column="float64")
    origin_alt_m: FloatArray = per_entry(column="float64")
    state_s: FloatArray = per_entry(column="float64")
    until_s: FloatArray = per_entry(column="float64")

    @classmethod
    def initial(cls, values: Mapping[str, object]) -> Self:
        """Return a message without cones; the scene's table must be empty."""
        if values:
            raise ValueError("cues before the first message can only be an empty table, {}")
        columns: dict[str, Any] = dict.fromkeys(NUMBERS, np.empty(0))
        return cls(
            tick=np.zeros(1, dtype=np.int64),
            offsets=np.zeros(2, dtype=np.int64),
            track=np.empty(0, dtype=np.int64),
            has_range=np.empty(0, dtype=bool),
            **columns,
        )


#: Columns of cones that are numbers.
NUMBERS = (
    "azimuth_rad", "elevation_rad", "half_angle_rad", "north_m", "east_m", "down_m", "north_m_s",
    "east_m_s", "down_m_s", "origin_lat_deg", "origin_lon_deg", "origin_alt_m", "state_s",
    "until_s",
)  # fmt: skip
