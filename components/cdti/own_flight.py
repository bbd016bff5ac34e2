"""Where the ownship was lately, in a plane, for what was measured from it then."""

import math
from dataclasses import dataclass

import numpy as np

from components.display.picture import TangentPlane
from components.messages.targets import TrafficStates
from dsa_des.arrays.types import FloatArray, IntArray

_KEPT = 600
_SPEED_OVER_S = 0.5


@dataclass(frozen=True)
class OwnNow:
    """The ownship at the latest instant that is known."""

    east_m: float
    north_m: float
    alt_m: float
    heading_rad: float
    pitch_rad: float
    roll_rad: float
    speed_mps: float
    climb_mps: float


class OwnFlight:
    """The ownship's latest positions and attitudes, in order of time."""

    def __init__(self) -> None:
        self.now: OwnNow | None = None
        self.plane: TangentPlane | None = None
        self._tick: IntArray = np.empty(0, dtype=np.int64)
        # East, north, altitude, yaw, pitch, roll.
        self._pose: FloatArray = np.empty((0, 6))

    def take(self, states: TrafficStates, ticks_per_s: int) -> None:
        """Take in new positions."""
        if self.plane is None:
            self.plane = TangentPlane(float(states.own_lat_deg[0]), float(states.own_lon_deg[0]))
        east, north = self.plane.east_north_m(
            states.own_lat_deg, states.own_lon_deg, states.own_alt_m
        )
        new = np.stack([
            east, north, states.own_alt_m, states.own_yaw_rad, states.own_pitch_rad,
            states.own_roll_rad,
        ], axis=1)  # fmt: skip
        keep = self._tick < states.tick[0]
        self._tick = np.concatenate([self._tick[keep], states.tick])[-_KEPT:]
        self._pose = np.concatenate([self._pose[keep], new])[-_KEPT:]
        then = int(np.searchsorted(self._tick, self._tick[-1] - _SPEED_OVER_S * ticks_per_s))
        then = min(then, max(len(self._tick) - 2, 0))
        apart_s = (self._tick[-1] - self._tick[then]) / ticks_per_s
        moved = self._pose[-1] - self._pose[then]
        speed, climb = 0.0, 0.0
        if apart_s > 0.0:
            speed, climb = math.hypot(moved[0], moved[1]) / apart_s, float(moved[2]) / apart_s
        east_m, north_m, alt_m, yaw, pitch, roll = self._pose[-1].tolist()
        self.now = OwnNow(east_m, north_m, alt_m, yaw, pitch, roll, speed, climb)

    def poses(self, tick: IntArray) -> FloatArray:
        """Return the last poses not after some instants, (n, 6); the first one before it."""
        place = np.searchsorted(self._tick, tick, side="right") - 1
        return self._pose[np.maximum(place, 0)]
