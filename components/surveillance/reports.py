"""The message of cooperative sensors: what aircraft say of themselves, beside lines of sight."""

from dataclasses import dataclass

import numpy as np

from components.messages.columns import OWN_NED, WGS84
from components.messages.detections import EXTRAS, Detections
from dsa_des.arrays.types import AnyArray
from dsa_des.block.message import Column, columns

#: What an aircraft says; null, or -1 of a category, where it does not.
REPORTED = {
    "address": Column(
        "",
        "",
        "24-bit ICAO address; -1 of a Mode C reply; 0 of other sensors, as nacp to nic",
        "int64",
    ),
    "reported_lat_deg": Column("deg", WGS84, "latitude as decoded, at reported_s"),
    "reported_lon_deg": Column("deg", WGS84, "longitude as decoded, at reported_s"),
    "reported_alt_m": Column("m", "pressure altitude", "altitude as reported, in 25 or 100 ft"),
    "reported_height_m": Column("m", WGS84, "height above the ellipsoid as reported, if it is"),
    "reported_north_m_s": Column("m/s", OWN_NED, "velocity over ground as decoded, north"),
    "reported_east_m_s": Column("m/s", OWN_NED, "the same, east"),
    "reported_climb_m_s": Column("m/s", OWN_NED, "vertical rate, upward"),
    "reported_s": Column("s", "", "when the position was received, which it is taken to be of"),
    "velocity_s": Column("s", "", "when the velocity was received; null without one"),
    "nacp": Column("", "", "navigation accuracy category of position; -1 for none", "int64"),
    "nacv": Column("", "", "that of velocity; -1 for none", "int64"),
    "nic": Column("", "", "navigation integrity category; -1 for none", "int64"),
}
_WHOLE = ("address", "nacp", "nacv", "nic")


@dataclass(eq=False)
class CooperativeReports(Detections):
    """Reports of cooperative sensors: identity, position, velocity and their quality (`REPORTED`).

    The line of sight is the one that follows from the report and the ownship's own belief of where
    it is and how it is turned, at the row's instant; so all that takes `Detections` takes these.
    """

    extras: dict[str, AnyArray] = columns({**EXTRAS, **REPORTED}, value=lambda m: m.extra_columns())


def empty_report_columns(count: int) -> dict[str, AnyArray]:
    """Return the report columns of `count` cells without reception: integers -1, others NaN."""
    return {
        name: np.full(count, -1) if name in _WHOLE else np.full(count, np.nan) for name in REPORTED
    }
