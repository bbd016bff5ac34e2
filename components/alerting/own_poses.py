"""The ownship's own flight as an alerting block knows it: places, attitude, velocity."""

from typing import Any

import numpy as np

from components.geometry import east_north_m
from components.messages.targets import TrafficStates
from dsa_des.arrays.types import BoolArray, FloatArray, IntArray
from dsa_des.block.wake import Wake

_COLUMNS = ("_came", "_tick", "_place", "_attitude")


class OwnPoses:
    """What has come of the ownship's poses, of one run or of many; those of each run together."""

    def __init__(self, ticks_per_s: int) -> None:
        self._per_s = ticks_per_s
        self._came: IntArray = np.empty(0, dtype=np.int64)
        self._tick: IntArray = np.empty(0, dtype=np.int64)
        self._place: FloatArray = np.empty((0, 3))
        self._attitude: FloatArray = np.empty((0, 3))
        #: Poses that were set aside, by column.
        self._old: list[list[Any]] = []

    def add(self, came: IntArray, states: TrafficStates, wake: Wake) -> None:
        """Take in poses, and when they came."""
        place = np.radians(states.own_lat_deg), np.radians(states.own_lon_deg), states.own_alt_m
        angles = states.own_yaw_rad, states.own_pitch_rad, states.own_roll_rad
        self._came = np.concatenate([self._came, came])
        self._tick = np.concatenate([self._tick, states.tick])
        self._place = np.concatenate([self._place, np.stack(place, axis=1)])
        self._attitude = np.concatenate([self._attitude, np.stack(angles, axis=1)])
        if bool((self._came[1:] < self._came[:-1]).any()):
            self._keep(np.argsort(self._came, kind="stable"))
        # Of those that overtook each other on the way, the newest counts.
        self._tick = np.maximum.accumulate(self._tick)

    def _keep(self, which: slice | IntArray) -> None:
        for name in _COLUMNS:
            setattr(self, name, getattr(self, name)[which])

    def have_come(self, ticks: IntArray, begins: IntArray) -> BoolArray:
        """Return whether any has come by some instants, of runs that begin at others."""
        return np.asarray(self.last_known(ticks) >= self._first(begins))

    def last_known(self, ticks: IntArray) -> IntArray:
        """Return the last pose that had come at some instants, -1 for none."""
        return np.searchsorted(self._came, ticks, side="right") - 1

    def _first(self, begins: IntArray) -> IntArray:
        """Return the first pose of runs, given when they begin."""
        return np.searchsorted(self._came, begins)

    def pose_of(
        self, measured: IntArray, came: IntArray, begins: IntArray, asked: BoolArray
    ) -> IntArray:
        """Return the pose of when something was measured, of those that had come; -1 for none."""
        made = np.searchsorted(self._tick, measured, side="right") - 1
        place, first = np.minimum(made, self.last_known(came)), self._first(begins)
        if self._old and bool((asked & (place <= first)).any()):
            for number, name in enumerate(_COLUMNS):
                parts = [*(old[number] for old in self._old), getattr(self, name)]
                setattr(self, name, np.concatenate(parts))
            self._old = []
            self._keep(np.argsort(self._came, kind="stable"))
            return self.pose_of(measured, came, begins, asked)
        return np.where(place >= first, place, -1)

    def attitude_rad(self, place: IntArray) -> FloatArray:
        """Return heading, pitch and roll of some poses, (3, n)."""
        return self._attitude[place].T

    def place(self, ticks: IntArray) -> FloatArray:
        """Return latitude and longitude (rad) and height (m) as known at some instants, (3, n)."""
        return self._place[np.maximum(self.last_known(ticks), 0)].T

    def states(self, ticks: IntArray, begins: IntArray, over_s: float) -> dict[str, FloatArray]:
        """Return the altitude, and the mean velocity over the last seconds, at some instants."""
        earliest = self._first(begins)
        last = np.maximum(self.last_known(ticks), earliest)
        since = ticks - round(over_s * self._per_s)
        first = np.searchsorted(self._tick, since, side="left")
        first = np.maximum(np.minimum(first, last - 1), earliest)
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

    def set_aside(self, own_tick: int, wake: Wake, *, late_sights: bool) -> None:
        """Set poses aside that only what comes late asks for, and drop those of ended runs."""
        ended = int(np.searchsorted(self._came, wake.first_run * wake.span_ticks))
        if ended:
            self._keep(slice(ended, None))
            self._old = []
        run, own = wake.replica_of(self._came), wake.own_ticks(self._tick)
        changes = np.append(run[1:] != run[:-1], True)
        recent = own >= own_tick
        # The last two of each run, and the last one before the instant, are asked for as well.
        recent |= changes | np.append(changes[1:], True)
        recent[:-1] |= recent[1:] & ~changes[:-1]
        old = np.flatnonzero(~recent)
        if 2 * len(old) > len(recent):
            if late_sights:
                self._old.append([getattr(self, name)[old] for name in _COLUMNS])
            self._keep(np.flatnonzero(recent))


def run_begins(ticks: IntArray, wake: Wake) -> IntArray:
    """Return when the runs of some instants begin."""
    return ticks - wake.own_ticks(ticks) if wake.span_ticks else np.zeros_like(ticks)
