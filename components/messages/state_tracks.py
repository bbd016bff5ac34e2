"""The message of trackers that estimate states: tracks of their own, with covariance."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from components.messages.columns import FRAME, FrameOrigin, PositionAndVelocity
from components.messages.contributors import (
    contributor_names_by_entry,
    joined_sensor_names_of_masks,
)
from dsa_des.arrays.types import BoolArray, FloatArray, IntArray
from dsa_des.block.message import Column, Message, Text, column, columns, static

#: What a track may be, in the order of its numbers.
STATUSES = ("tentative", "confirmed", "coasted", "deleted")
TENTATIVE, CONFIRMED, COASTED, DELETED = range(4)
#: Who acts on a track refuses it when its last detection is older than this, s: its tracker no
#: longer reports, or its reports no longer come.
STALE_S = 30.0
#: Statuses of tracks that are believed in.
HELD = STATUSES[CONFIRMED], STATUSES[COASTED]


def is_confirmed_or_coasted(status: Text) -> BoolArray:
    """Return a mask of the rows (True) whose track status is confirmed or coasted."""
    return np.isin(status.codes, [k for k, name in enumerate(status.names) if name in HELD])


_UNITS = (("m²", ""), ("m²/s", "_s"), ("m²/s²", "_s2"))
#: Column of every element of the covariance's upper triangle, row by row.
COVARIANCE = {
    (i, j): f"covariance_{i}{j}_m2{_UNITS[(i > 2) + (j > 2)][1]}"
    for i in range(6)
    for j in range(i, 6)
}


def covariance_matrices(columns: Mapping[str, Any], rows: Any, size: int = 6) -> FloatArray:
    """Return some rows' covariances, (size, size, rows), symmetric, from columns `COVARIANCE`."""
    return np.stack(
        [
            np.stack([columns[COVARIANCE[min(i, j), max(i, j)]][rows] for j in range(size)])
            for i in range(size)
        ]
    )


_COVARIANCE = {
    name: Column(
        _UNITS[(i > 2) + (j > 2)][0],
        FRAME,
        f"covariance of {names[i]} with {names[j]}; null without a range",
    )
    for names in [tuple(PositionAndVelocity.__dataclass_fields__)]
    for (i, j), name in COVARIANCE.items()
}

#: What some models have besides.
EXTRAS = {
    "acceleration_north_m_s2": Column("m/s²", FRAME, "estimated acceleration north"),
    "acceleration_east_m_s2": Column("m/s²", FRAME, "estimated acceleration east"),
    "acceleration_down_m_s2": Column("m/s²", FRAME, "estimated acceleration down"),
    "turn_rate_rad_s": Column("rad/s", FRAME, "estimated rate of turn, positive to the right"),
    "probability_velocity": Column("", "", "of the model of constant velocity"),
    "probability_turn": Column("", "", "of the model of a coordinated turn"),
    "probability_acceleration": Column("", "", "of the model of constant acceleration"),
}


@dataclass(eq=False)
class StateTracks(PositionAndVelocity, FrameOrigin, Message):
    """What a tracker estimates, at each instant at which something came to it.

    Directions are in the frame's axes: clockwise from north, upward; all that a track without a
    range has.

    Parameters
    ----------
    track : (entries,) of int
        From 1, in the order in which tracks were started.
    track_status : (entries,) of int
        Index into `STATUSES`; a deleted track is reported once, with its last state.
    covariance : dict of (entries,)
        Of the state of six in its order, by column (`COVARIANCE`); NaN without a range.
    contributors, updated_by : (entries,) of int
        Bit masks of `sensors`, as in `FusedDetections`.
    nis, nis_freedom : (entries,)
        How far the detections that updated the track lay from what was expected, by the covariance
        of both: for each look 2 quantities, 3 with range, 4 with range rate. NaN where none did,
        or where several were weighed; by default.
    """

    entry_table = "state_tracks"

    offsets: IntArray
    track: IntArray = column("", "", "the tracker's own number of the track, from 1", "int64")
    track_status: IntArray = column(
        "", "", "tentative, confirmed, coasted, or deleted (told once)", "text",
        value=lambda m: Text(m.track_status, STATUSES),
    )  # fmt: skip
    existence: FloatArray = column("", "", "probability that there is something")
    azimuth_rad: FloatArray = column(
        "rad", FRAME, "direction from the ownship at its last look, from north"
    )
    elevation_rad: FloatArray = column("rad", FRAME, "its elevation, upward")
    azimuth_variance_rad2: FloatArray = column("rad²", FRAME, "variance of that azimuth")
    elevation_variance_rad2: FloatArray = column("rad²", FRAME, "variance of that elevation")
    has_range: BoolArray = column(
        "", "", "whether its range is known: measured, or by the ownship's manoeuvres", "bool"
    )
    age_s: FloatArray = column("s", "", "time since the track was started")
    state_s: FloatArray = column("s", "", "the instant that the state speaks of")
    updated_s: FloatArray = column("s", "", "when the last measurement in it was made")
    contributors: IntArray = column(
        "",
        "",
        "sensors that ever updated it, joined by +",
        "text",
        value=contributor_names_by_entry,
    )
    updated_by: IntArray = column(
        "", "", "sensors of its last update, joined by +", "text",
        value=lambda m: joined_sensor_names_of_masks(m.updated_by, m.sensors),
    )  # fmt: skip
    own_north_m: FloatArray = column("m", FRAME, "where the ownship believed to be then, north")
    own_east_m: FloatArray = column("m", FRAME, "where the ownship believed to be then, east")
    own_down_m: FloatArray = column("m", FRAME, "where the ownship believed to be then, down")
    covariance: dict[str, FloatArray] = columns(_COVARIANCE)
    extras: dict[str, FloatArray] = columns(EXTRAS)
    sensors: tuple[str, ...] = static()
    nis: FloatArray = column(
        "", "", "normalised innovations squared at that instant, added up; null without",
        default=None, kw_only=True,
    )  # fmt: skip
    nis_freedom: IntArray = column(
        "", "", "how many measured quantities they are of", "int64", default=None, kw_only=True
    )

    @classmethod
    def make_initial(cls, values: Mapping[str, object]) -> Self:
        """Return a message without tracks; the scene's table must be empty."""
        if values:
            raise ValueError("tracks before the first message can only be an empty table, {}")
        return cls.empty(extras={}, sensors=())
