"""Frames of columns, and groups of columns that several messages have."""

from dataclasses import dataclass
from typing import Any

from dsa_des.arrays.types import FloatArray
from dsa_des.block.message import Column, Text, column

BODY = "ownship's body axes: azimuth clockwise from the nose, elevation upward"
NED = "north-east-down at the ownship"
WGS84 = "WGS 84"
FRAME = "north-east-down at the frame's origin"
OWN_NED = "north-east-down at the aircraft itself"
TURNED = "north-east-down to body: yaw, pitch, roll"


@dataclass(eq=False, kw_only=True)
class MeasuredLine:
    """A measured line of sight, on the sensor's grid; range NaN where none is measured."""

    azimuth_rad: FloatArray = column("rad", BODY, "measured azimuth")
    elevation_rad: FloatArray = column("rad", BODY, "measured elevation")
    range_m: FloatArray = column("m", "", "measured slant range; null where none is measured")


@dataclass(eq=False, kw_only=True)
class TrueLine:
    """The true line of sight; NaN for a false alarm."""

    true_azimuth_rad: FloatArray = column("rad", BODY, "true azimuth")
    true_elevation_rad: FloatArray = column("rad", BODY, "true elevation")
    true_range_m: FloatArray = column("m", "", "true slant range")


@dataclass(eq=False, kw_only=True)
class StatedErrors:
    """Measured range rate (positive: opening) and the variances that the sensor states.

    A grid's is step²/12; the cut at the edge of a field of view is not in it. Where navigation has
    noise, that of the pose by which angles are turned, and of the position that a range is counted
    from, is. NaN where not given: not measured.
    """

    range_rate_m_s: FloatArray = column(
        "m/s", "", "measured range rate, positive when opening; null without one", default=None
    )
    azimuth_variance_rad2: FloatArray = column(
        "rad²", BODY, "mean square error of the azimuth, as stated", default=None
    )
    elevation_variance_rad2: FloatArray = column(
        "rad²", BODY, "mean square error of the elevation, as stated", default=None
    )
    range_variance_m2: FloatArray = column(
        "m²", "", "mean square error of the range; null where none is measured", default=None
    )
    range_rate_variance_m2_s2: FloatArray = column(
        "m²/s²", "", "mean square error of the range rate; null where none is measured",
        default=None,
    )  # fmt: skip


#: The fields of `StatedErrors`.
MEASURED = tuple(StatedErrors.__dataclass_fields__)


@dataclass(eq=False, kw_only=True)
class PositionAndVelocity:
    """Position and velocity north, east and down in the frame; NaN for a track without a range."""

    north_m: FloatArray = column("m", FRAME, "position north; null without a range")
    east_m: FloatArray = column("m", FRAME, "position east; null without a range")
    down_m: FloatArray = column("m", FRAME, "position down; null without a range")
    north_m_s: FloatArray = column("m/s", FRAME, "velocity north; null without a range")
    east_m_s: FloatArray = column("m/s", FRAME, "velocity east; null without a range")
    down_m_s: FloatArray = column("m/s", FRAME, "velocity down; null without a range")


@dataclass(eq=False, kw_only=True)
class FrameOrigin:
    """Geodetic origin of the north-east-down frame that positions are given in."""

    origin_lat_deg: FloatArray = column("deg", WGS84, "origin of the frame: latitude")
    origin_lon_deg: FloatArray = column("deg", WGS84, "its longitude")
    origin_alt_m: FloatArray = column("m", WGS84, "its height above the ellipsoid")


#: The fields of these two, and those of the ownship's position in the same frame (`StateTracks`).
STATE, ORIGIN = (tuple(g.__dataclass_fields__) for g in (PositionAndVelocity, FrameOrigin))
POSITION, VELOCITY = STATE[:3], STATE[3:]
OWN_POSITION = ("own_north_m", "own_east_m", "own_down_m")

#: The ownship's pose as it believes it to be: fields of `Detections`, columns of ``scans``.
POSE = {
    "own_lat_deg": Column("deg", WGS84, "where the ownship believes to be then: latitude"),
    "own_lon_deg": Column("deg", WGS84, "its longitude"),
    "own_alt_m": Column("m", WGS84, "its height above the ellipsoid"),
    "own_heading_rad": Column("rad", TURNED, "how it believes to be turned: nose, from north"),
    "own_pitch_rad": Column("rad", TURNED, "its pitch, nose up"),
    "own_roll_rad": Column("rad", TURNED, "its roll, right wing down"),
}
#: The same of what was put together or is held: only where navigation errs.
ERRING_POSE = {
    name: one._replace(meaning=f"{one.meaning}; there is such a column where navigation errs")
    for name, one in POSE.items()
}

#: The ownship's velocity over ground: what `Detections.own_velocity` holds.
OWN_VELOCITY = {
    "own_velocity_north_m_s": Column(
        "m/s", OWN_NED, "ownship's velocity over ground, north; null without a range rate"
    ),
    "own_velocity_east_m_s": Column("m/s", OWN_NED, "the same, east"),
    "own_velocity_down_m_s": Column("m/s", OWN_NED, "the same, down"),
}


#: The keys of `Detections.told_by_target`: the target's own velocity (m/s) and mean square errors
#: of what is new in it (m²/s²); the ownship's, where bearings are coarse; standard deviations
#: (`ToldError`) of the target's position along north and east each (m), its height and the height's
#: rounding, its vertical rate, its velocity along north and east each (m/s), a bearing (rad), the
#: delay of a transponder and ranges (m), and of by how long positions are late (s); how long a
#: position was carried on, and the age of the velocity (s); and the mean square error of all else
#: that is new in the position, along every axis (m²).
TOLD = (
    "north", "east", "down", "north_variance", "east_variance", "down_variance",
    "own_north", "own_east", "own_down", "place_deviation", "height_deviation",
    "rounding_deviation", "climb_deviation", "speed_deviation", "bearing_deviation",
    "delay_deviation", "range_deviation", "latency_deviation", "age_s", "velocity_age_s",
    "white_variance",
)  # fmt: skip


def target_name_of_each_entry(message: Any) -> Text:
    """Return the names of a message's targets, entry by entry."""
    return Text(message.target, message.roster.names)
