"""An autopilot's simulation beside a scene, over MAVLink and UDP (``foreign.mavlink``)."""

import math
import socket
import time
import weakref
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np
from pydantic import Field, field_validator

from components.arguments.units import STANDARD_GRAVITY_M_S2
from components.estimation.frame import vectors_in_frame
from components.foreign.mavlink_messages import AutopilotSays, Flying, Link
from components.geometry import POSITION_FIELDS, enu_to_geodetic, line_of_sight_ned
from components.messages.columns import OWN_NED, TURNED, WGS84
from components.messages.detections import joined_names_if_all_rangeless
from components.messages.state_tracks import COASTED, CONFIRMED, STALE_S, StateTracks
from components.messages.steering import SLOWEST_TURN_DEG_S, Manoeuvre, Manoeuvres
from components.messages.targets import TrafficStates
from dsa_des.arrays.types import FloatArray
from dsa_des.block.component import (
    ClockedParameters,
    Component,
    Input,
    NonNegativeRational,
    Output,
)
from dsa_des.block.message import PER_ROW, Message, column
from dsa_des.block.wake import Wake
from dsa_des.running.pacing import Pacer

_LONGEST_DATAGRAM = 65_535
_VERTICAL_ACCELERATION_MPS2 = 0.25 * STANDARD_GRAVITY_M_S2


class MavlinkParameters(ClockedParameters):
    """Parameters of an autopilot's simulation."""

    address: str = Field(
        default="127.0.0.1:14550", description="Where it listens for datagrams: HOST:PORT."
    )
    local_port: int = Field(
        default=0, ge=0, le=65535, description="Where we listen for its own; 0 for any free port."
    )
    pace: float = Field(
        default=1.0, ge=0, le=1000, description="Simulated seconds per second; 0 for no waiting."
    )
    answer_s: float = Field(
        default=0.0, ge=0, le=60,
        description="Wait so long for its answer to each instant, s of the wall; 0 takes what "
        "has come.",
    )  # fmt: skip
    lost_s: float = Field(
        default=5.0, gt=0, le=600,
        description="Without a word for so long, s of the wall clock, it is lost and the run ends.",
    )  # fmt: skip
    least_turn_deg: float = Field(
        default=2.0, gt=0, le=90, description="The ownship follows turns of at least this, deg."
    )
    least_climb_mps: float = Field(
        default=1.0, gt=0, description="And changes of vertical speed of at least this, m/s."
    )
    rate_deg_s: float = Field(
        default=3.0, ge=SLOWEST_TURN_DEG_S, description="How fast the ownship turns, deg/s."
    )
    pause_s: NonNegativeRational = Field(
        default=Fraction(5),
        description="Shortest time from the end of a manoeuvre to the next, s: the wire's delay "
        "and an interval of ours at least.",
    )

    @field_validator("address")
    @classmethod
    def _host_and_port(cls, value: str) -> str:
        host, _, port = value.rpartition(":")
        if not host or not port.isdecimal() or not 0 < int(port) < 65536:
            raise ValueError(f"is {value!r}: must be HOST:PORT, such as 127.0.0.1:14550")
        return value


@dataclass(eq=False)
class AutopilotStates(Message):
    """What an autopilot reports of its flight, as known at each instant; NaN before the first.

    Parameters
    ----------
    attitude_s, position_s : (rows,)
        Its own times of the two, since it was started.
    """

    row_table = "autopilot"

    attitude_s: FloatArray = column("s", "", "its own time of the attitude", of=PER_ROW)
    position_s: FloatArray = column("s", "", "its own time of the position", of=PER_ROW)
    lat_deg: FloatArray = column("deg", WGS84, "latitude", of=PER_ROW)
    lon_deg: FloatArray = column("deg", WGS84, "longitude", of=PER_ROW)
    alt_m: FloatArray = column("m", "", "altitude, above what it calls sea level", of=PER_ROW)
    velocity_north_m_s: FloatArray = column("m/s", OWN_NED, "velocity, north", of=PER_ROW)
    velocity_east_m_s: FloatArray = column("m/s", OWN_NED, "east", of=PER_ROW)
    velocity_down_m_s: FloatArray = column("m/s", OWN_NED, "down", of=PER_ROW)
    heading_rad: FloatArray = column("rad", TURNED, "where its nose points", of=PER_ROW)
    pitch_rad: FloatArray = column("rad", TURNED, "pitch, nose up", of=PER_ROW)
    roll_rad: FloatArray = column("rad", TURNED, "roll, right wing down", of=PER_ROW)


class UdpLink:
    """A UDP socket that exchanges datagrams with one address and ignores those from others."""

    def __init__(self, address: str, local_port: int) -> None:
        host, _, port = address.rpartition(":")
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        # Sooner or later: a run that ends has no other end than that of its blocks.
        self.close = weakref.finalize(self, self._socket.close)
        try:
            self._peer = socket.getaddrinfo(host, int(port), socket.AF_INET)[0][4]
            local = "127.0.0.1" if str(self._peer[0]).startswith("127.") else ""
            self._socket.bind((local, local_port))
        except OSError as error:
            self.close()
            raise ValueError(f"address {address}, local_port {local_port}: {error}") from None

    def send(self, datagrams: list[bytes]) -> None:
        """Send datagrams; nothing is raised if nobody listens."""
        for datagram in datagrams:
            try:
                self._socket.sendto(datagram, self._peer)
            except ConnectionRefusedError:
                continue

    def receive(self, wait_s: float) -> bytes | None:
        """Return the next datagram from the peer, or None if none arrives within ``wait_s``."""
        until = time.monotonic() + wait_s
        while True:
            self._socket.settimeout(max(0.0, until - time.monotonic()))
            try:
                datagram, sender = self._socket.recvfrom(_LONGEST_DATAGRAM)
            except ConnectionRefusedError:  # of an earlier one that nobody took
                continue
            except (BlockingIOError, TimeoutError):
                return None
            if sender == self._peer:
                return datagram


class Mavlink(Component):
    """Flies the ownship as an autopilot's simulation does, to which it sends the traffic.

    At each instant it sends ADSB_VEHICLE of every track with states that has a range, or of every
    aircraft that is there where no tracker is wired, then HIL_STATE_QUATERNION of the ownship, and
    once a second HEARTBEAT. ATTITUDE and GLOBAL_POSITION_INT come back: where the autopilot's
    course or vertical speed differ from the ownship's, the ownship is told to change its own.
    """

    inputs = {
        "states": Input(TrafficStates, "sampled", "Where all aircraft are."),
        "estimates": Input(StateTracks, "sampled", "Tracks with states.", required=False),
    }
    outputs = {
        "manoeuvres": Output(Manoeuvres, "What the ownship is told to fly."),
        "autopilot": Output(AutopilotStates, "What the autopilot says of itself."),
    }
    Parameters = MavlinkParameters

    def setup(self) -> None:
        """Open the link; what is missing or wrong shows before the run."""
        self._link = Link()
        self._udp = UdpLink(self.p.address, self.p.local_port)
        self._pacer = Pacer(self.p.pace) if self.p.pace > 0.0 else None
        self._says = AutopilotSays()
        self._last_word_s = time.monotonic()
        self._begun = False
        self._before: tuple[float, TrafficStates] | None = None
        self._free_from, self._next_beat_s = 0, -math.inf
        #: How many tracks had no range, of how many.
        self._rangeless = self._heard = 0

    def warnings(self) -> list[str]:
        """Return a warning if a producer measures no range, as only tracks with one are sent."""
        blind = joined_names_if_all_rangeless(
            one for one in self.context.producers if one.port == "estimates"
        )
        return [f"{blind} measures no range: no track is sent"] if blind else []

    def failure_counts(self) -> dict[str, tuple[int, int]]:
        """Return how many tracks were not sent because they had no range, of how many received."""
        if not self._heard:
            return {}
        return {"a track has no range and is not sent": (self._rangeless, self._heard)}

    def run(self, wake: Wake) -> dict[str, Message] | None:
        """Send the traffic to the autopilot, and receive its state."""
        states: TrafficStates | None = wake["states"]
        if states is None:
            return None
        time_s = float(wake.time_s[0])
        if not self._begun:
            self._begun, self._last_word_s = True, time.monotonic()
            if self._pacer is not None:
                self._pacer = Pacer(self.p.pace)
        if self._pacer is not None:
            self._pacer(time_s)
        before, self._before = self._before, (time_s, states)
        if before is None:  # a velocity needs two positions
            return None
        own, others = _ownship_and_targets(states, before[1], time_s - before[0])
        held = wake.held("estimates")
        if "estimates" in {producer.port for producer in self.context.producers}:
            others = []
            if held is not None and held[1][0] >= 0:
                message, row = held[0], int(held[1][0])
                of_row = slice(int(message.offsets[row]), int(message.offsets[row + 1]))
                self._heard += len(message.has_range[of_row])
                self._rangeless += int(np.count_nonzero(~message.has_range[of_row]))
                others = _extrapolated_ranged_tracks(*held, time_s)
        datagrams = [*self._link.vehicles(others), self._link.own_state(time_s, own)]
        if time_s >= self._next_beat_s:
            self._next_beat_s = time_s + 1.0
            datagrams.insert(0, self._link.heartbeat())
        self._udp.send(datagrams)
        self._read_until_reply(time_s)
        told = self._manoeuvre_to_follow(int(wake.ticks[0]), own)
        found: dict[str, Message] = {"autopilot": _row(wake, self._says)}
        if told is not None:
            found["manoeuvres"] = Manoeuvres.of([int(wake.ticks[0])], [told])
        return found

    def _read_until_reply(self, time_s: float) -> None:
        """Read all datagrams that have arrived, waiting up to ``answer_s`` for the reply to this
        time; TimeoutError after a long silence.
        """
        # Its own times are whole milliseconds.
        wanted_s = math.floor(1e3 * time_s) / 1e3
        until = time.monotonic() + self.p.answer_s
        while True:
            answered = min(self._says.attitude_s, self._says.position_s) >= wanted_s
            left_s = 0.0 if answered else max(0.0, until - time.monotonic())
            datagram = self._udp.receive(left_s)
            if datagram is None:
                break
            says = self._link.update(datagram, self._says)
            if says is not self._says:
                self._says, self._last_word_s = says, time.monotonic()
        silent_s = time.monotonic() - self._last_word_s
        if silent_s > self.p.lost_s:
            raise TimeoutError(
                f"the autopilot at {self.p.address} has said neither ATTITUDE nor "
                f"GLOBAL_POSITION_INT for {silent_s:.1f} s (lost_s = {self.p.lost_s:g}): is it "
                "running, and does it send to the port from which it hears us?"
            )

    def _manoeuvre_to_follow(self, tick: int, own: Flying) -> Manoeuvre | None:
        """Return the manoeuvre the autopilot flies; None if none is needed or one is under way."""
        flown = self._says.flying
        if tick < self._free_from or not math.isfinite(self._says.position_s):
            return None
        lasts_s, found = 0.0, None
        turn = math.remainder(flown.course_rad - own.course_rad, 2.0 * math.pi)
        climb_mps = own.down_mps - flown.down_mps
        rate = math.radians(self.p.rate_deg_s)
        if math.hypot(flown.north_mps, flown.east_mps) > 1.0 and abs(turn) >= math.radians(
            self.p.least_turn_deg
        ):
            found = Manoeuvre(turn_rad=turn, rate_rad_s=rate)
            lasts_s = abs(turn) / rate
        elif abs(climb_mps) >= self.p.least_climb_mps:
            lasts_s = abs(climb_mps) / _VERTICAL_ACCELERATION_MPS2
            found = Manoeuvre(
                vertical_speed_mps=climb_mps,
                vertical_acceleration_mps2=_VERTICAL_ACCELERATION_MPS2,
            )
        if found is not None:
            ticks = (lasts_s + float(self.p.pause_s)) * self.context.ticks_per_s
            self._free_from = tick + math.ceil(ticks)
        return found


def _row(wake: Wake, says: AutopilotSays) -> AutopilotStates:
    flying = says.flying
    times = (t if math.isfinite(t) else math.nan for t in (says.attitude_s, says.position_s))
    return AutopilotStates(wake.ticks, *(np.array([v]) for v in (*times, *flying[2:11])))


def _ownship_and_targets(
    now: TrafficStates, before: TrafficStates, elapsed_s: float
) -> tuple[Flying, list[Flying]]:
    """Return the ownship and targets present, with velocities by displacement since last time."""

    def moved(prefix: str, k: Any) -> FloatArray:
        places = [
            np.atleast_1d(getattr(state, f"{prefix}{name}")[k])
            for state in (before, now)
            for name in POSITION_FIELDS
        ]
        return np.concatenate(line_of_sight_ned(*places)) / elapsed_s

    places = [float(getattr(now, f"own_{name}")[0]) for name in POSITION_FIELDS]
    turned = (float(getattr(now, f"own_{name}_rad")[0]) for name in ("yaw", "pitch", "roll"))
    own = Flying(0, "", *places, *moved("own_", 0).tolist(), *turned)
    at = {number: k for k, number in enumerate(before.columns.tolist())}
    others = []
    for k, number in enumerate(now.columns.tolist()):
        if not now.present[0, k]:
            continue
        place = [float(getattr(now, name)[0, k]) for name in POSITION_FIELDS]
        if k == at.get(number) and before.present[0, k]:
            speeds = moved("", (0, k)).tolist()
            others.append(Flying(number + 1, now.roster.names[number], *place, *speeds))
    return own, others


def _extrapolated_ranged_tracks(message: StateTracks, rows: Any, time_s: float) -> list[Flying]:
    """Return confirmed and coasted tracks with a range, moved at constant velocity to a time.

    One without a detection for `STALE_S` is none.
    """
    row = int(rows[0])
    found = []
    for k in range(int(message.offsets[row]), int(message.offsets[row + 1])):
        if not message.has_range[k] or message.track_status[k] not in (CONFIRMED, COASTED):
            continue
        if (age_s := time_s - float(message.updated_s[k])) > STALE_S:
            continue
        speeds = [float(getattr(message, f"{axis}_m_s")[k]) for axis in ("north", "east", "down")]
        ahead_s = time_s - float(message.state_s[k])
        north, east, down = (
            float(getattr(message, f"{axis}_m")[k]) + ahead_s * speed
            for axis, speed in zip(("north", "east", "down"), speeds, strict=True)
        )
        lat, lon, alt = enu_to_geodetic(
            east, north, -down,
            reference_lat_deg=message.origin_lat_deg[k],
            reference_lon_deg=message.origin_lon_deg[k],
            reference_alt_m=message.origin_alt_m[k],
        )  # fmt: skip
        number = int(message.track[k])
        place = float(np.squeeze(lat)), float(np.squeeze(lon)), float(np.squeeze(alt))
        # A track's velocity is along the axes of its frame, an ADS-B report's along those there.
        origin = message.origin_lat_deg[k : k + 1], message.origin_lon_deg[k : k + 1]
        here = np.array(place[:2]).reshape(2, 1)
        along = vectors_in_frame(here, np.array(origin), np.array(speeds).reshape(3, 1))
        one = Flying(number, f"T{number}", *place, *along[:, 0].tolist())
        found.append(one._replace(age_s=max(age_s, 0.0)))
    return found
