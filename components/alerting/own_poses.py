"""Where the ownship was, and how it was turned, as far as an alerting block has been told."""

import numpy as np

from components.geometry.daidalus_sphere import east_north_m
from dsa_des.arrays.types import BoolArray, FloatArray, IntArray
from dsa_des.block.wake import Wake

# So many are remembered beyond the last scan: for sights that come late.
_KEPT = 10_000
_COLUMNS = ("came", "tick", "pose")


class OwnPoses:
    """The poses that have come, of one run or of many; those of each run together.

    Parameters
    ----------
    span_ticks : int
        Over so much time the ownship's velocity is taken.
    """

    def __init__(self, span_ticks: int) -> None:
        self._span = span_ticks
        #: When each came, and of which instant it is.
        self.came: IntArray = np.empty(0, dtype=np.int64)
        self.tick: IntArray = np.empty(0, dtype=np.int64)
        #: Latitude, longitude (rad), altitude (m); yaw, pitch, roll (rad).
        self.pose: FloatArray = np.empty((0, 6))
        #: Columns of poses that were set aside.
        self._old: list[tuple[IntArray, IntArray, FloatArray]] = []

    def add(self, came: IntArray, tick: IntArray, pose: FloatArray, wake: Wake) -> None:
        """Take in poses (n, 6) of instants, and when they came."""
        self.came = np.concatenate([self.came, came])
        self.tick = np.concatenate([self.tick, tick])
        self.pose = np.concatenate([self.pose, pose])
        if wake.side_by_side:
            self._keep(np.argsort(self.came, kind="stable"))
        # Of those that overtook each other on the way, the newest counts.
        self.tick = np.maximum.accumulate(self.tick)

    def _keep(self, which: slice | IntArray) -> None:
        for name in _COLUMNS:
            setattr(self, name, getattr(self, name)[which])

    def have_come(self, begins: IntArray, ticks: IntArray) -> BoolArray:
        """Return whether any has come by some instants of runs that begin at others."""
        place = np.minimum(np.searchsorted(self.came, begins), len(self.came) - 1)
        return (self.came[place] >= begins) & (self.came[place] <= ticks)

    def known(
        self, measured: IntArray, arrived: IntArray, begins: IntArray, asked: BoolArray
    ) -> tuple[IntArray, IntArray]:
        """Return the pose of some instants among those that had come by others.

        Parameters
        ----------
        measured, arrived, begins : (n,) of int
            Instants, those by which a pose must have come, and when each one's run begins.
        asked : (n,) of bool
            Which of them count.

        Returns
        -------
        place, first : (n,) of int
            Which pose it is, and the first one of the run; below that none is known.
        """
        place = np.minimum(
            np.searchsorted(self.tick, measured, side="right"),
            np.searchsorted(self.came, arrived, side="right"),
        )
        first = np.searchsorted(self.came, begins)
        if self._old and bool((asked & (place <= first)).any()):
            for number, name in enumerate(_COLUMNS):
                parts = [*(old[number] for old in self._old), getattr(self, name)]
                setattr(self, name, np.concatenate(parts))
            self._old = []
            self._keep(np.argsort(self.came, kind="stable"))
            return self.known(measured, arrived, begins, asked)
        return place - 1, first

    def attitude(self, place: IntArray) -> FloatArray:
        """Return yaw, pitch and roll of some poses, (3, n), rad."""
        return np.asarray(self.pose[place, 3:].T)

    def states(self, ticks: IntArray, begins: IntArray, ticks_per_s: int) -> dict[str, FloatArray]:
        """Return the ownship's altitude and its mean velocity over the last seconds.

        Parameters
        ----------
        ticks, begins : (n,) of int
            Instants, and when their runs begin.
        ticks_per_s : int
        """
        place = np.searchsorted(self.came, begins)
        last = np.maximum(np.searchsorted(self.came, ticks, side="right") - 1, place)
        first = np.maximum(np.searchsorted(self.tick, ticks - self._span, side="left"), place)
        first = np.minimum(first, last)
        now, then = self.pose[last], self.pose[first]
        time_s = (self.tick[last] - self.tick[first]) / ticks_per_s
        time_s = np.where(time_s > 0.0, time_s, np.nan)
        east, north = east_north_m(then[:, 0], then[:, 1], now[:, 0], now[:, 1])
        return {
            "alt_m": now[:, 2],
            "east_mps": -east / time_s,
            "north_mps": -north / time_s,
            "climb_mps": (now[:, 2] - then[:, 2]) / time_s,
        }

    def forget_before(self, tick: int, begin: int) -> None:
        """Drop poses that neither the velocity at an instant nor a late sight asks for.

        Parameters
        ----------
        tick : int
        begin : int
            When its run begins; those of earlier runs are dropped too.
        """
        old = int(np.searchsorted(self.tick, tick - self._span, side="left"))
        keep = max(min(old, len(self.tick) - _KEPT), 0)
        self._keep(slice(max(keep, int(np.searchsorted(self.came, begin))), None))

    def set_aside(self, own_tick: int, wake: Wake) -> None:
        """Set those of runs side by side aside that only what comes late asks for.

        Parameters
        ----------
        own_tick : int
            Of the earliest of the latest scans, since the start of its run.
        wake : Wake
        """
        run = wake.replica_of(self.came)
        recent = wake.own_ticks(self.tick) >= own_tick - 2 * self._span
        recent |= np.append(run[1:] != run[:-1], True)  # the last one of each
        old = np.flatnonzero(~recent)
        if 2 * len(old) > len(recent):
            self._old.append((self.came[old], self.tick[old], self.pose[old]))
            self._keep(np.flatnonzero(recent))
