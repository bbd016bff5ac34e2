"""The message of trackers that estimate states: tracks of their own, with covariance."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from components.messages.columns import COVARIANCE, DESCRIBED
from components.messages.contributors import combination_text
from dsa_des.arrays.types import BoolArray, FloatArray, IntArray
from dsa_des.block.message import Message, Text, per_entry, static

#: What a track may be, in the order of its numbers.
STATUSES = ("tentative", "confirmed", "coasted", "deleted")
TENTATIVE, CONFIRMED, COASTED, DELETED = range(4)


#: What some models have besides.
EXTRAS = {
    "acceleration_north_m_s2": "float64",
    "acceleration_east_m_s2": "float64",
    "acceleration_down_m_s2": "float64",
    "turn_rate_rad_s": "float64",
    "probability_velocity": "float64",
    "probability_turn": "float64",
    "probability_acceleration": "float64",
}


@dataclass(eq=False)
class StateTracks(Message):
    """What a tracker estimates, at each instant at which something came to it.

    Parameters
    ----------
    offsets : (rows + 1,)
    track : (entries,) of int
        The tracker's own number, from 1, in the order in which tracks were started.
    track_status : (entries,) of int
        Index into `STATUSES`; a deleted track is told once, with its last state.
    existence : (entries,)
        Probability that there is something.
    north_m, east_m, down_m, north_m_s, east_m_s, down_m_s : (entries,)
        In the frame whose origin is told: north, east, down at the origin. NaN without a range.
    covariance : dict of (entries,)
        Of these six in this order, by column (`COVARIANCE`); NaN without a range.
    azimuth_rad, elevation_rad : (entries,)
        Direction from the ownship at its last look, in the frame's axes: clockwise from north,
        upward; all that a track without a range has.
    azimuth_variance_rad2, elevation_variance_rad2 : (entries,)
    has_range : (entries,) of bool
        Whether any range was measured.
    age_s : (entries,)
        Time since the track was started.
    state_s, updated_s : (entries,)
        The instant that the state speaks of, and that of the last measurement in it, since the
        start of the run.
    contributors, updated_by : (entries,) of int
        Sensors that ever updated it, and those of its last update, as in `FusedDetections`.
    own_north_m, own_east_m, own_down_m : (entries,)
        Where in the frame the ownship believed to be at that look.
    origin_lat_deg, origin_lon_deg, origin_alt_m : (entries,)
        Origin of the frame (WGS 84): where the ownship believed to be at its first look.
    extras : dict of (entries,)
        What some models have besides: `EXTRAS`.
    sensors : tuple of str
    nis : (entries,)
        Normalised innovations squared of the looks at the instant that the state speaks of, added
        up: how far the detections that updated the track lay from what was expected, by the
        covariance of both. NaN where none did, or where several were weighed; by default.
    nis_freedom : (entries,) of int
        How many quantities they are of: for each look 2 angles, 3 with range, 4 with range rate.
    """

    described = DESCRIBED
    entry_table = "state_tracks"

    offsets: IntArray
    track: IntArray = per_entry(column="int64")
    track_status: IntArray = per_entry(
        column="text", value=lambda m: Text(m.track_status, STATUSES)
    )
    existence: FloatArray = per_entry(column="float64")
    north_m: FloatArray = per_entry(column="float64")
    east_m: FloatArray = per_entry(column="float64")
    down_m: FloatArray = per_entry(column="float64")
    north_m_s: FloatArray = per_entry(column="float64")
    east_m_s: FloatArray = per_entry(column="float64")
    down_m_s: FloatArray = per_entry(column="float64")
    azimuth_rad: FloatArray = per_entry(column="float64")
    elevation_rad: FloatArray = per_entry(column="float64")
    azimuth_variance_rad2: FloatArray = per_entry(column="float64")
    elevation_variance_rad2: FloatArray = per_entry(column="float64")
    has_range: BoolArray = per_entry(column="bool")
    age_s: FloatArray = per_entry(column="float64")
    state_s: FloatArray = per_entry(column="float64")
    updated_s: FloatArray = per_entry(column="float64")
    contributors: IntArray = per_entry(
        column="text", value=lambda m: combination_text(m.contributors, m.sensors)
    )
    updated_by: IntArray = per_entry(
        column="text", value=lambda m: combination_text(m.updated_by, m.sensors)
    )
    own_north_m: FloatArray = per_entry(column="float64")
    own_east_m: FloatArray = per_entry(column="float64")
    own_down_m: FloatArray = per_entry(column="float64")
    origin_lat_deg: FloatArray = per_entry(column="float64")
    origin_lon_deg: FloatArray = per_entry(column="float64")
    origin_alt_m: FloatArray = per_entry(column="float64")
    covariance: dict[str, FloatArray] = per_entry(
        columns=dict.fromkeys(COVARIANCE.values(), "float64")
    )
    extras: dict[str, FloatArray] = per_entry(columns=EXTRAS)
    sensors: tuple[str, ...] = static()
    nis: FloatArray = per_entry(column="float64", default=None, kw_only=True)
    nis_freedom: IntArray = per_entry(column="int64", default=None, kw_only=True)

    def __post_init__(self) -> None:
        if self.nis is None:
            self.nis = np.full(len(self.track), np.nan)
            self.nis_freedom = np.zeros(len(self.track), dtype=np.int64)

    @classmethod
    def initial(cls, values: Mapping[str, object]) -> Self:
        """Return a message without tracks; the scene's table must be empty."""
        if values:
            raise ValueError("tracks before the first message can only be an empty table, {}")
        none, zero = np.empty(0), np.empty(0, dtype=np.int64)
        columns: dict[str, Any] = dict.fromkeys(_NUMBERS, none)
        columns |= dict.fromkeys(("track", "track_status", "contributors", "updated_by"), zero)
        return cls(
            tick=np.zeros(1, dtype=np.int64),
            offsets=np.zeros(2, dtype=np.int64),
            has_range=np.empty(0, dtype=bool),
            covariance=dict.fromkeys(COVARIANCE.values(), none),
            extras={},
            sensors=(),
            **columns,
        )


_NUMBERS = (
    "existence", "north_m", "east_m", "down_m", "north_m_s", "east_m_s", "down_m_s",
    "azimuth_rad", "elevation_rad", "azimuth_variance_rad2", "elevation_variance_rad2",
    "age_s", "state_s", "updated_s", "own_north_m", "own_east_m", "own_down_m",
    "origin_lat_deg", "origin_lon_deg", "origin_alt_m",
)  # fmt: skip
