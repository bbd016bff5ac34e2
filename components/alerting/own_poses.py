"""The ownship's own flight as an alerting block knows it: places, attitude, velocity."""

import numpy as np

from components.geometry.daidalus_sphere import east_north_m
from components.messages.targets import TrafficStates
from dsa_des.arrays.types import FloatArray, IntArray

# Poses of the ownship that are remembered beyond the last scan: for sights that come late.
_KEPT_POSES = 10_000


class OwnPoses:
    """What has come of the ownship's poses.

    Parameters
    ----------
    ticks_per_s : int
    """

    def __init__(self, ticks_per_s: int) -> None:
        self._per_s = ticks_per_s
        self._came: IntArray = np.empty(0, dtype=np.int64)
        self._tick: IntArray = np.empty(0, dtype=np.int64)
        self._place: FloatArray = np.empty((0, 3))
        self._attitude: FloatArray = np.empty((0, 3))

    def add(self, came: IntArray, states: TrafficStates) -> None:
        """Take in poses, and when they came."""
        place = np.radians(states.own_lat_deg), np.radians(states.own_lon_deg), states.own_alt_m
        angles = states.own_yaw_rad, states.own_pitch_rad, states.own_roll_rad
        self._came = np.concatenate([self._came, came])
        # Of those that overtook each other on the way, the newest counts.
        self._tick = np.maximum.accumulate(np.concatenate([self._tick, states.tick]))
        self._place = np.concatenate([self._place, np.stack(place, axis=1)])
        self._attitude = np.concatenate([self._attitude, np.stack(angles, axis=1)])

    def last_known(self, ticks: IntArray) -> IntArray:
        """Return the last pose that had come at some instants, -1 for none."""
        return np.searchsorted(self._came, ticks, side="right") - 1

    def pose_of(self, measured: IntArray, came: IntArray) -> IntArray:
        """Return the pose of when something was measured, of those that had come; -1 for none."""
        made = np.searchsorted(self._tick, measured, side="right") - 1
        return np.minimum(made, self.last_known(came))

    def attitude_rad(self, place: IntArray) -> FloatArray:
        """Return heading, pitch and roll of some poses, (3, n)."""
        return self._attitude[place].T

    def place(self, ticks: IntArray) -> FloatArray:
        """Return latitude and longitude (rad) and height (m) as known at some instants, (3, n)."""
        return self._place[np.maximum(self.last_known(ticks), 0)].T

    def states(self, ticks: IntArray, over_s: float) -> dict[str, FloatArray]:
        """Return the altitude, and the mean velocity over the last seconds, at some instants.

        Parameters
        ----------
        ticks : (n,)
        over_s : float
            At least the last two poses count.

        Returns
        -------
        dict of (n,)
            ``alt_m``, ``east_mps``, ``north_mps``, ``climb_mps``; NaN where one pose is all.
        """
        last = np.maximum(self.last_known(ticks), 0)
        since = ticks - round(over_s * self._per_s)
        first = np.minimum(np.searchsorted(self._tick, since, side="left"), np.maximum(last - 1, 0))
        now, then = self._place[last], self._place[first]
        time_s = (self._tick[last] - self._tick[first]) / self._per_s
        time_s = np.where(time_s > 0.0, time_s, np.nan)
        east, north = east_north_m(then[:, 0], then[:, 1], now[:, 0], now[:, 1])
        return {
            "alt_m": now[:, 2],
            "east_mps": -east / time_s,
            "north_mps": -north / time_s,
            "climb_mps": (now[:, 2] - then[:, 2]) / time_s,
        }

    def forget_before(self, tick: int) -> None:
        """Drop poses that neither a velocity from an instant on nor a late sight asks for."""
        old = int(np.searchsorted(self._tick, tick, side="left")) - 1
        keep = max(min(old, len(self._tick) - _KEPT_POSES), 0)
        for name in ("_came", "_tick", "_place", "_attitude"):
            setattr(self, name, getattr(self, name)[keep:])
