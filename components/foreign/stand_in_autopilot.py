"""A small autopilot in place of a real one: it keeps its course until an aircraft comes near.

What passes within 600 m, and 150 m in height, in the next minute makes it turn right by 45 degrees,
once in two minutes. ``python -m components.foreign.stand_in_autopilot 14550`` listens at that port
of this machine, where a scene's `foreign.mavlink` reaches it.
"""

import math
import socket
import sys
from typing import Any

from dsa_des.errors.optional_libraries import import_extra

_NEAR_M, _LEVEL_M, _AHEAD_S, _TURN_RAD, _PAUSE_S = 600.0, 150.0, 60.0, math.radians(45.0), 120.0
_M_PER_E7 = 111_200.0 / 1e7
_SILENT_S = 60.0


class StandIn:
    """A simulated autopilot: answers each received ownship state with attitude and position."""

    def __init__(self) -> None:
        dialect = import_extra("pymavlink.dialects.v20.common", "mavlink", "the stand-in autopilot")
        self._link = dialect.MAVLink(None, 1, 1)
        self._link.robust_parsing = True
        self._others: list[Any] = []
        self._course_rad: float | None = None
        self._free_from_s = 0.0

    def reply(self, datagram: bytes) -> list[bytes]:
        """Return the datagrams with which the autopilot answers a datagram."""
        found = []
        for message in self._link.parse_buffer(datagram) or []:
            if message.get_type() == "ADSB_VEHICLE":
                self._others.append(message)
            elif message.get_type() == "HIL_STATE_QUATERNION":
                found += self._reply_to_state(message)
                self._others = []
        return found

    def _reply_to_state(self, own: Any) -> list[bytes]:
        time_s, level = own.time_usec / 1e6, math.hypot(own.vx, own.vy)
        if self._course_rad is None:
            self._course_rad = math.atan2(own.vy, own.vx)
        if time_s >= self._free_from_s and any(_passes_near(own, one) for one in self._others):
            self._course_rad, self._free_from_s = self._course_rad + _TURN_RAD, time_s + _PAUSE_S
        yaw, ms = math.remainder(self._course_rad, 2.0 * math.pi), own.time_usec // 1000
        north, east = round(level * math.cos(yaw)), round(level * math.sin(yaw))
        heading = round(math.degrees(yaw) * 100) % 36000
        made = (
            self._link.attitude_encode(ms, 0.0, 0.0, yaw, 0.0, 0.0, 0.0),
            self._link.global_position_int_encode(
                ms, own.lat, own.lon, own.alt, 0, north, east, own.vz, heading
            ),
        )
        return [bytes(one.pack(self._link)) for one in made]


def _passes_near(own: Any, one: Any) -> bool:
    """Return whether an aircraft passes near, if both fly straight on; in a plane."""
    apart_deg = math.remainder(one.lon - own.lon, 3_600_000_000)
    east = apart_deg * _M_PER_E7 * math.cos(math.radians(own.lat / 1e7))
    north = (one.lat - own.lat) * _M_PER_E7
    track = math.radians(one.heading / 100.0)
    north_mps = (one.hor_velocity * math.cos(track) - own.vx) / 100.0
    east_mps = (one.hor_velocity * math.sin(track) - own.vy) / 100.0
    squared = north_mps**2 + east_mps**2
    time_s = -(north * north_mps + east * east_mps) / squared if squared else 0.0
    time_s = min(max(time_s, 0.0), _AHEAD_S)
    miss_m = math.hypot(north + time_s * north_mps, east + time_s * east_mps)
    return miss_m < _NEAR_M and abs(one.altitude - own.alt) / 1000.0 < _LEVEL_M


def answer_and_list_senders(port: int) -> set[Any]:
    """Answer datagrams at a local port by stand-in autopilots; finally return senders' addresses.

    It ends by an empty datagram, or when nothing has come for a minute.
    """
    autopilots: dict[Any, StandIn] = {}
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as end:
        end.bind(("127.0.0.1", port))
        end.settimeout(_SILENT_S)
        while True:
            try:
                datagram, sender = end.recvfrom(65_535)
            except TimeoutError:
                return set(autopilots)
            if not datagram:
                return set(autopilots)
            autopilot = autopilots.setdefault(sender, StandIn())
            for answer in autopilot.reply(datagram):
                end.sendto(answer, sender)


if __name__ == "__main__":
    answer_and_list_senders(int(sys.argv[1]))
