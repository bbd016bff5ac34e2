"""What an autopilot is told over MAVLink, and what it says: messages of the common dialect."""

import math
from collections.abc import Iterable
from typing import Any, NamedTuple

from components.formats.asterix_records import callsign_from_name
from dsa_des.errors.optional_libraries import import_extra

_E7, _MILLI, _CENTI = 1e7, 1e3, 1e2
_DIALECT = "pymavlink.dialects.v20.common"
#: Our numbers on the link: a system of our own, the component of an ADS-B receiver.
_SYSTEM, _COMPONENT = 255, 156
_ADSB_VALID = 1 | 2 | 4 | 8 | 16 | 128  # coordinates, altitude, heading, velocities, callsign
_MOST_CM_S = 65535
_MOST_AGE_S = 255


class Flying(NamedTuple):
    """The position, velocity and attitude of an aircraft.

    Parameters
    ----------
    number : int
        Its address; 0 for the ownship.
    name : str
    lat_deg, lon_deg, alt_m : float
    north_mps, east_mps, down_mps : float
    yaw_rad, pitch_rad, roll_rad : float
        An intruder has none of them that is known.
    age_s : float
        How old what is known of an intruder is.
    """

    number: int
    name: str
    lat_deg: float
    lon_deg: float
    alt_m: float
    north_mps: float
    east_mps: float
    down_mps: float
    yaw_rad: float = 0.0
    pitch_rad: float = 0.0
    roll_rad: float = 0.0
    age_s: float = 0.0

    @property
    def course_rad(self) -> float:
        """Direction over ground, from north."""
        return math.atan2(self.east_mps, self.north_mps)


class AutopilotSays(NamedTuple):
    """The flight that an autopilot has last reported; times (s) are by its own clock."""

    attitude_s: float = -math.inf
    position_s: float = -math.inf
    flying: Flying = Flying(0, "", *(math.nan,) * 9)


class Link:
    """Encodes and decodes the MAVLink datagrams of one connection."""

    def __init__(self) -> None:
        self._dialect = import_extra(_DIALECT, "mavlink", "foreign.mavlink")
        self._ours = self._dialect.MAVLink(None, _SYSTEM, _COMPONENT)

    def heartbeat(self) -> bytes:
        """Return a heartbeat message."""
        made = self._ours.heartbeat_encode(
            self._dialect.MAV_TYPE_ADSB, self._dialect.MAV_AUTOPILOT_INVALID, 0, 0,
            self._dialect.MAV_STATE_ACTIVE,
        )  # fmt: skip
        return bytes(made.pack(self._ours))

    def vehicles(self, others: Iterable[Flying]) -> list[bytes]:
        """Return each aircraft's ADSB_VEHICLE message: geometric heights, courses as headings."""
        found = []
        for one in others:
            name = (callsign_from_name(one.name) or "").encode()
            course = round(math.degrees(one.course_rad) * _CENTI) % 36000
            level = math.hypot(one.north_mps, one.east_mps)
            made = self._ours.adsb_vehicle_encode(
                one.number, _degrees_times_1e7(one.lat_deg), _degrees_times_1e7(one.lon_deg),
                self._dialect.ADSB_ALTITUDE_TYPE_GEOMETRIC, _clip_to_field(one.alt_m * _MILLI, 32),
                course, min(round(level * _CENTI), _MOST_CM_S),
                _clip_to_field(-one.down_mps * _CENTI, 16), name,
                self._dialect.ADSB_EMITTER_TYPE_NO_INFO, min(round(one.age_s), _MOST_AGE_S),
                _ADSB_VALID, 0,
            )  # fmt: skip
            found.append(bytes(made.pack(self._ours)))
        return found

    def own_state(self, time_s: float, own: Flying) -> bytes:
        """Return the HIL_STATE_QUATERNION of the ownship, without rates and accelerations."""
        speed = _clip_to_field(math.hypot(own.north_mps, own.east_mps, own.down_mps) * _CENTI, 16)
        made = self._ours.hil_state_quaternion_encode(
            round(time_s * 1e6), _quaternion(own.yaw_rad, own.pitch_rad, own.roll_rad), 0.0, 0.0,
            0.0, _degrees_times_1e7(own.lat_deg), _degrees_times_1e7(own.lon_deg),
            _clip_to_field(own.alt_m * _MILLI, 32),
            _clip_to_field(own.north_mps * _CENTI, 16), _clip_to_field(own.east_mps * _CENTI, 16),
            _clip_to_field(own.down_mps * _CENTI, 16), speed, speed, 0, 0, 0,
        )  # fmt: skip
        return bytes(made.pack(self._ours))

    def update(self, datagram: bytes, before: AutopilotSays) -> AutopilotSays:
        """Return the report updated by a datagram; unreadable or other messages change nothing."""
        says = before
        # A datagram is whole: what a broken one leaves over must not swallow the next.
        theirs = self._dialect.MAVLink(None)
        theirs.robust_parsing = True
        for one in theirs.parse_buffer(datagram) or ():
            says = _update_says(one, says)
        return says


def _update_says(one: Any, says: AutopilotSays) -> AutopilotSays:
    kind, flying = one.get_type(), says.flying
    if kind == "ATTITUDE":
        turned = flying._replace(yaw_rad=one.yaw, pitch_rad=one.pitch, roll_rad=one.roll)
        return says._replace(attitude_s=one.time_boot_ms / _MILLI, flying=turned)
    if kind == "GLOBAL_POSITION_INT":
        moved = flying._replace(
            lat_deg=one.lat / _E7, lon_deg=one.lon / _E7, alt_m=one.alt / _MILLI,
            north_mps=one.vx / _CENTI, east_mps=one.vy / _CENTI, down_mps=one.vz / _CENTI,
        )  # fmt: skip
        return says._replace(position_s=one.time_boot_ms / _MILLI, flying=moved)
    return says


def _degrees_times_1e7(angle_deg: float) -> int:
    return round(angle_deg * _E7)


def _clip_to_field(value: float, bits: int) -> int:
    """Return the nearest whole number that a field of so many bits holds."""
    most = 2 ** (bits - 1) - 1
    return max(-most, min(most, round(value)))


def _quaternion(yaw_rad: float, pitch_rad: float, roll_rad: float) -> list[float]:
    """Return w, x, y, z of the turn from north, east, down to body axes (yaw, pitch, roll)."""
    (cz, sz), (cy, sy), (cx, sx) = (
        (math.cos(0.5 * angle), math.sin(0.5 * angle)) for angle in (yaw_rad, pitch_rad, roll_rad)
    )
    return [
        cz * cy * cx + sz * sy * sx,
        cz * cy * sx - sz * sy * cx,
        cz * sy * cx + sz * cy * sx,
        sz * cy * cx - cz * sy * sx,
    ]
