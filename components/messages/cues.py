"""The message that tells sensors where to look: cue cones."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Self

from components.messages.columns import FRAME, FrameOrigin, PositionAndVelocity
from dsa_des.arrays.types import BoolArray, FloatArray, IntArray
from dsa_des.block.message import Message, column


@dataclass(eq=False)
class CueCones(PositionAndVelocity, FrameOrigin, Message):
    """Cones in which targets are expected, sent to sensors as cues by a tracker.

    A sensor carries a cone with a range on with its velocity; one without keeps its direction. The
    axis is as the ownship saw it at `state_s`; the cone holds the target until `until_s`, both in s
    since the start of the run.
    """

    entry_table = "cues"

    offsets: IntArray
    track: IntArray = column("", "", "number of the track that it comes from", "int64")
    azimuth_rad: FloatArray = column(
        "rad", FRAME, "axis of the cone as seen from the ownship, from north"
    )
    elevation_rad: FloatArray = column("rad", FRAME, "its elevation, upward")
    half_angle_rad: FloatArray = column("rad", "", "half angle of the cone")
    has_range: BoolArray = column("", "", "whether the track has a range", "bool")
    state_s: FloatArray = column("s", "", "the instant that it speaks of")
    until_s: FloatArray = column("s", "", "the last instant at which it counts")

    @classmethod
    def make_initial(cls, values: Mapping[str, object]) -> Self:
        """Return a message without cones; the scene's table must be empty."""
        if values:
            raise ValueError("cues before the first message can only be an empty table, {}")
        return cls.empty()
