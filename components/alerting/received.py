"""Messages that an alerting block has received, and the ownship's flight as it believes it."""

from typing import Any, Self

import numpy as np

from components.geometry import east_north_m
from components.messages.targets import TrafficStates
from dsa_des.arrays.keyed_table import KeyedTable
from dsa_des.arrays.run_ticks import (
    RunTicks,
    first_position_in_run,
    last_position_in_run,
    next_position_in_run,
)
from dsa_des.arrays.types import BoolArray, FloatArray, IntArray
from dsa_des.block.wake import Wake


class ReceivedRows(KeyedTable):
    """Received rows, by run (``replica``) and then by the tick at which they ``came``."""

    @classmethod
    def without_rows(cls, *whole: str, **shapes: tuple[int, ...]) -> Self:
        """Return no rows, of columns of whole numbers, and of floats (with what shape)."""
        columns = dict.fromkeys(("replica", "came", *whole), int)
        return cls.empty({**columns, **dict.fromkeys(shapes, float)}, shapes)

    @property
    def instants(self) -> RunTicks:
        """When each came."""
        return RunTicks(self.replica, self.came)

    def append(self, came: RunTicks, **columns: Any) -> Self:
        """Return the rows with others appended that came later, or in other runs."""
        new = type(self)(replica=came.run, came=came.tick, **columns)
        every = self.concatenate([self, new])
        order = every.instants.order()
        return every if order is None else every.take(order)

    def last(self, asked: RunTicks) -> IntArray:
        """Return the row that came last by some instants; -1 for none."""
        return last_position_in_run(self.instants, asked)


class OwnPoses:
    """The ownship's poses received so far."""

    def __init__(self, ticks_per_s: int) -> None:
        self._per_s = ticks_per_s
        self._poses = ReceivedRows.without_rows("tick", place=(3,), attitude=(3,))
        #: Poses that were set aside.
        self._old: list[ReceivedRows] = []

    @property
    def _made_ticks(self) -> RunTicks:
        return RunTicks(self._poses.replica, self._poses.tick)

    def add(self, came: RunTicks, states: TrafficStates) -> None:
        """Store poses of the ownship, and when each came."""
        position = np.radians(states.own_lat_deg), np.radians(states.own_lon_deg), states.own_alt_m
        angles = states.own_yaw_rad, states.own_pitch_rad, states.own_roll_rad
        self._keep(
            self._poses.append(
                came, tick=states.tick, place=np.array(position), attitude=np.array(angles)
            )
        )

    def _keep(self, poses: ReceivedRows) -> None:
        # One that a newer one overtook on the way tells nothing any more.
        newest = RunTicks(poses.replica, poses.tick).newest()
        self._poses = poses.take(poses.tick >= newest.tick)

    def has_come(self, asked: RunTicks) -> BoolArray:
        """Return whether any row was received by each of some instants."""
        return np.asarray(self._poses.last(asked) >= 0)

    def pose_of(self, measured: RunTicks, came: RunTicks, asked: BoolArray) -> IntArray:
        """Return which received pose is of the instant of each measurement; -1 for none."""
        index = np.minimum(last_position_in_run(self._made_ticks, measured), self._poses.last(came))
        first = first_position_in_run(self._poses.instants, came.run)
        if self._old and bool((asked & (index <= first)).any()):
            every = ReceivedRows.concatenate([*self._old, self._poses])
            order = every.instants.order()
            self._keep(every if order is None else every.take(order))
            self._old = []
            return self.pose_of(measured, came, asked)
        return index

    def attitude_rad(self, place: IntArray) -> FloatArray:
        """Return heading, pitch and roll of some poses, (3, n)."""
        return np.asarray(self._poses.attitude[:, place])

    def place(self, asked: RunTicks) -> FloatArray:
        """Return latitude and longitude (rad) and height (m) as known at some instants, (3, n)."""
        return np.asarray(self._poses.place[:, np.maximum(self._poses.last(asked), 0)])

    def states(self, asked: RunTicks, over_s: float) -> dict[str, FloatArray]:
        """Return the altitude, and the mean velocity over the last seconds, at some instants."""
        earliest = first_position_in_run(self._poses.instants, asked.run)
        last = np.maximum(self._poses.last(asked), earliest)
        first = next_position_in_run(self._made_ticks, asked.later(-round(over_s * self._per_s)))
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
        """Keep poses that only late measurements need apart from the rest, and drop those of ended
        runs.
        """
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
