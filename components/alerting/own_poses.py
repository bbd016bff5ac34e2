"""The ownship's own flight as an alerting block knows it: places, attitude, velocity."""

import numpy as np

from components.geometry import east_north_m
from components.messages.targets import TrafficStates
from dsa_des.arrays.keyed_table import KeyedTable
from dsa_des.arrays.run_ticks import RunTicks, first_of_run, last_of_run, next_of_run
from dsa_des.arrays.types import BoolArray, FloatArray, IntArray
from dsa_des.block.wake import Wake


class OwnPoses:
    """What has come of the ownship's poses; those of each run together, as they came."""

    def __init__(self, ticks_per_s: int) -> None:
        self._per_s = ticks_per_s
        types = {"replica": int, "came": int, "tick": int, "place": float, "attitude": float}
        self._poses = KeyedTable.empty(types, {"place": (3,), "attitude": (3,)})
        #: Poses that were set aside.
        self._old: list[KeyedTable] = []

    @property
    def _came(self) -> RunTicks:
        return RunTicks(self._poses.replica, self._poses.came)

    @property
    def _made(self) -> RunTicks:
        return RunTicks(self._poses.replica, self._poses.tick)

    def add(self, came: RunTicks, states: TrafficStates) -> None:
        """Take in poses, and when they came."""
        place = np.radians(states.own_lat_deg), np.radians(states.own_lon_deg), states.own_alt_m
        angles = states.own_yaw_rad, states.own_pitch_rad, states.own_roll_rad
        new = KeyedTable(
            replica=came.run, came=came.tick, tick=states.tick,
            place=np.stack(place), attitude=np.stack(angles),
        )  # fmt: skip
        self._poses = KeyedTable.joined([self._poses, new])
        self._sort()

    def _sort(self) -> None:
        if (order := self._came.order()) is not None:
            self._poses = self._poses.take(order)
        # Of those that overtook each other on the way, the newest counts.
        self._poses = self._poses.with_columns(tick=self._made.newest().tick)

    def have_come(self, asked: RunTicks) -> BoolArray:
        """Return whether any has come by some instants."""
        return np.asarray(last_of_run(self._came, asked) >= 0)

    def pose_of(self, measured: RunTicks, came: RunTicks, asked: BoolArray) -> IntArray:
        """Return the pose of when something was measured, of those that had come; -1 for none."""
        place = np.minimum(last_of_run(self._made, measured), last_of_run(self._came, came))
        first = first_of_run(self._came, came.run)
        if self._old and bool((asked & (place <= first)).any()):
            self._poses = KeyedTable.joined([*self._old, self._poses])
            self._old = []
            self._sort()
            return self.pose_of(measured, came, asked)
        return place

    def attitude_rad(self, place: IntArray) -> FloatArray:
        """Return heading, pitch and roll of some poses, (3, n)."""
        return np.asarray(self._poses.attitude[:, place])

    def place(self, asked: RunTicks) -> FloatArray:
        """Return latitude and longitude (rad) and height (m) as known at some instants, (3, n)."""
        return np.asarray(self._poses.place[:, np.maximum(last_of_run(self._came, asked), 0)])

    def states(self, asked: RunTicks, over_s: float) -> dict[str, FloatArray]:
        """Return the altitude, and the mean velocity over the last seconds, at some instants."""
        earliest = first_of_run(self._came, asked.run)
        last = np.maximum(last_of_run(self._came, asked), earliest)
        first = next_of_run(self._made, asked.later(-round(over_s * self._per_s)))
        first = np.maximum(np.minimum(first, last - 1), earliest)
        now, then = self._poses.place[:, last], self._poses.place[:, first]
        time_s = (self._poses.tick[last] - self._poses.tick[first]) / self._per_s
        time_s = np.where(time_s > 0.0, time_s, np.nan)
        east, north = east_north_m(then[0], then[1], now[0], now[1])
        return {
            "alt_m": now[2],
            "east_mps": -east / time_s,
            "north_mps": -north / time_s,
            "climb_mps": (now[2] - then[2]) / time_s,
        }

    def set_aside(self, tick: int, wake: Wake, *, late_sights: bool) -> None:
        """Set poses aside that only what comes late asks for, and drop those of ended runs."""
        if len(self._poses) and self._poses.replica[0] < wake.first_run:
            self._poses = self._poses.take(self._poses.replica >= wake.first_run)
            self._old = []
        run = self._poses.replica
        changes = np.append(run[1:] != run[:-1], True)
        recent = self._poses.tick >= tick
        # The last two of each run, and the last one before the instant, are asked for as well.
        recent |= changes | np.append(changes[1:], True)
        recent[:-1] |= recent[1:] & ~changes[:-1]
        if 2 * int(np.count_nonzero(~recent)) > len(recent):
            if late_sights:
                self._old.append(self._poses.take(~recent))
            self._poses = self._poses.take(recent)
