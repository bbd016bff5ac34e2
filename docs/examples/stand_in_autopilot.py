"""A small autopilot in place of a real one: it keeps its course until an aircraft comes near.

What passes within 600 m (and 150 m in height) in the next minute makes it turn right by 45 degrees,
once in two minutes. ``python stand_in_autopilot.py 14550`` listens at that port of this machine; a
scene's `foreign.mavlink` talks to it.
"""

import math
import socket
import sys

from pymavlink.dialects.v20 import common

NEAR_M, LEVEL_M, AHEAD_S, TURN, PAUSE_S = 600.0, 150.0, 60.0, math.radians(45.0), 120.0


class StandIn:
    def __init__(self):
        self.link = common.MAVLink(None, 1, 1)
        self.others, self.course, self.free_from_s = {}, None, 0.0

    def answers(self, datagram):
        """Return the datagrams that answer one; each state of the ownship is answered."""
        found = []
        for message in self.link.parse_buffer(datagram) or []:
            if message.get_type() == "ADSB_VEHICLE":
                self.others[message.ICAO_address] = message
            elif message.get_type() == "HIL_STATE_QUATERNION":
                found += self.fly(message)
                self.others = {}
        return found

    def fly(self, own):
        speed = math.hypot(own.vx, own.vy) / 100
        if self.course is None:
            self.course = math.atan2(own.vy, own.vx)
        time_s = own.time_usec / 1e6
        if time_s >= self.free_from_s and any(self.near(own, one) for one in self.others.values()):
            self.course, self.free_from_s = self.course + TURN, time_s + PAUSE_S
        ms = own.time_usec // 1000
        yaw = math.remainder(self.course, 2 * math.pi)
        north, east = round(100 * speed * math.cos(yaw)), round(100 * speed * math.sin(yaw))
        attitude = self.link.attitude_encode(ms, 0.0, 0.0, yaw, 0.0, 0.0, 0.0)
        place = self.link.global_position_int_encode(
            ms, own.lat, own.lon, own.alt, 0, north, east, own.vz,
            round(math.degrees(yaw) * 100) % 36000,
        )  # fmt: skip
        return [bytes(one.pack(self.link)) for one in (attitude, place)]

    def near(self, own, one):
        per_deg = 111_200.0 / 1e7
        east = (one.lon - own.lon) * per_deg * math.cos(math.radians(own.lat / 1e7))
        north = (one.lat - own.lat) * per_deg
        track = math.radians(one.heading / 100)
        closing_north = (one.hor_velocity * math.cos(track) - own.vx) / 100
        closing_east = (one.hor_velocity * math.sin(track) - own.vy) / 100
        squared = closing_north**2 + closing_east**2
        time_s = -(north * closing_north + east * closing_east) / squared if squared else 0.0
        time_s = min(max(time_s, 0.0), AHEAD_S)
        miss = math.hypot(north + time_s * closing_north, east + time_s * closing_east)
        return miss < NEAR_M and abs(one.altitude - own.alt) / 1000 < LEVEL_M


def serve(port, limit_s, senders):
    """Answer whoever sends, until nothing has come for so long, or nothing at all is sent."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as end:
        end.bind(("127.0.0.1", port))
        end.settimeout(limit_s)
        autopilot = StandIn()
        while True:
            try:
                datagram, sender = end.recvfrom(65535)
            except TimeoutError:
                return
            if not datagram:
                return
            senders.add(sender)
            for answer in autopilot.answers(datagram):
                end.sendto(answer, sender)


if __name__ == "__main__":
    serve(int(sys.argv[1]), 60.0, set())
