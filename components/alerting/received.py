"""Messages that an alerting block has received, and the ownship's flight as it believes it."""

from typing import Any, Self

import numpy as np

from components.geometry import east_north_m
from components.messages.targets import TrafficStates
from dsa_des.arrays.keyed_table import KeyedTable
from dsa_des.arrays.run_ticks import (
    RunTicks,
    first_position_at_or_after,
    first_position_in_runs,
    last_position_at_or_before,
)
from dsa_des.arrays.types import BoolArray, FloatArray, IntArray
from dsa_des.block.wake import Wake


class ReceivedRows(KeyedTable):
    """Received rows, by run (``replica``) and then by the tick at which they ``came``."""

    @classmethod
    def empty_with_columns(cls, *whole: str, **shapes: tuple[int, ...]) -> Self:
        """Return a table of no rows, with integer columns `whole` and floats of these `shapes`."""
        columns = dict.fromkeys(("replica", "came", *whole), int)
        return cls.empty({**columns, **dict.fromkeys(shapes, float)}, shapes)

    @property
    def instants(self) -> RunTicks:
        """Run and tick at which each row came."""
        return RunTicks(self.replica, self.came)

    def append(self, came: RunTicks, **columns: Any) -> Self:
        """Return these rows and newly received ones, sorted by run and tick of arrival."""
        new = type(self)(replica=came.run, came=came.tick, **columns)
        every = self.concatenate([self, new])
        order = every.instants.sort_indices()
        return every if order is None else every.take(order)

    def last_row_index(self, asked: RunTicks) -> IntArray:
        """Return the index of the last row up to each given instant, in its run; -1 for none."""
        return last_position_at_or_before(self.instants, asked)


class OwnPoses:
    """Remembers the ownship's poses received so far, and looks them up by instant."""

    def __init__(self, ticks_per_s: int) -> None:
        self._per_s = ticks_per_s
        self._poses = ReceivedRows.empty_with_columns("tick", place=(3,), attitude=(3,))
        #: Poses that were set aside.
        self._old: list[ReceivedRows] = []

    @property
    def _pose_ticks(self) -> RunTicks:
        return RunTicks(self._poses.replica, self._poses.tick)

    def add(self, came: RunTicks, states: TrafficStates) -> None:
        """Store the ownship's poses of a traffic message, and when each of its rows came."""
        position = np.radians(states.own_lat_deg), np.radians(states.own_lon_deg), states.own_alt_m
        angles = states.own_yaw_rad, states.own_pitch_rad, states.own_roll_rad
        self._store_not_overtaken_poses(
            self._poses.append(
                came, tick=states.tick, place=np.array(position), attitude=np.array(angles)
            )
        )

    def _store_not_overtaken_poses(self, poses: ReceivedRows) -> None:
        # One that a newer one overtook on the way tells nothing any more.
        newest = RunTicks(poses.replica, poses.tick).running_largest_tick()
        self._poses = poses.take(poses.tick >= newest.tick)

    def has_pose_by(self, asked: RunTicks) -> BoolArray:
        """Return whether any pose had been received by each of the given instants."""
        return np.asarray(self._poses.last_row_index(asked) >= 0)

    def pose_index_at_measurement(
        self, measured: RunTicks, came: RunTicks, asked: BoolArray
    ) -> IntArray:
        """Return the index of the newest pose by each measurement, received by `came`, or -1."""
        index = np.minimum(
            last_position_at_or_before(self._pose_ticks, measured), self._poses.last_row_index(came)
        )
        first = first_position_in_runs(self._poses.instants, came.run)
        if self._old and bool((asked & (index <= first)).any()):
            every = ReceivedRows.concatenate([*self._old, self._poses])
            order = every.instants.sort_indices()
            self._store_not_overtaken_poses(every if order is None else every.take(order))
            self._old = []
            return self.pose_index_at_measurement(measured, came, asked)
        return index

    def attitude_rad(self, place: IntArray) -> FloatArray:
        """Return heading, pitch and roll, (3, n), of the poses with these indices."""
        return np.asarray(self._poses.attitude[:, place])

    def position_known_at(self, asked: RunTicks) -> FloatArray:
        """Return lat, lon (rad), height (m), (3, n), of the last pose received by each instant."""
        return np.asarray(self._poses.place[:, np.maximum(self._poses.last_row_index(asked), 0)])

    def altitude_and_mean_velocity(self, asked: RunTicks, over_s: float) -> dict[str, FloatArray]:
        """Return the altitude and the mean velocity over the last `over_s` seconds, by name, as
        known at each instant; NaN without two poses.
        """
        earliest = first_position_in_runs(self._poses.instants, asked.run)
        last = np.maximum(self._poses.last_row_index(asked), earliest)
        first = first_position_at_or_after(
            self._pose_ticks, asked.add_ticks(-round(over_s * self._per_s))
        )
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

    def set_aside_old_poses(self, tick: int, wake: Wake, *, late_sights: bool) -> None:
        """Set aside poses before a tick (drop without `late_sights`); drop those of ended runs."""
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
