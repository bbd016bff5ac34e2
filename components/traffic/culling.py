"""The targets that need moving: those that a sensor may look at during a window."""

from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np

from components.traffic.flight_limits import intervals_present_s, max_speeds_mps
from components.traffic.near_intervals import NearIntervals, near_intervals, range_between
from dsa_des.arrays.types import BoolArray, FloatArray, IntArray


class Culling:
    """The targets that can come within a range of the ownship, by intervals of entry and exit.

    The intervals are found once, for all targets together; which targets a window needs is then
    a look at them, so the answer for an instant does not depend on how instants are grouped.

    Parameters
    ----------
    own, targets : objects with `at(time_s)`, `max_speed_mps` and `interval_present()`
    fleet : object with `each(aircraft, time_s)` and `subset(columns)`
        All targets.
    reach_m : float
        Farthest range at which any sensor looks.
    end_s : float
        Length of the run.
    lasts_s : float
        How long a look lasts: a sweeping beam sees targets where they are later in the scan.
    """

    def __init__(
        self,
        own: Any,
        targets: Sequence[Any],
        fleet: Any,
        reach_m: float,
        end_s: float,
        lasts_s: float = 0.0,
    ) -> None:
        self._fleet, self.lasts_s = fleet, lasts_s
        self.reach_m = reach_m
        there = intervals_present_s(targets)
        first, last = own.interval_present()
        self.intervals: NearIntervals = near_intervals(
            partial(range_between, own.at, fleet.each),
            closing_speed_mps=max_speeds_mps(targets) + own.max_speed_mps,
            present_s=(np.maximum(there[:, 0], first), np.minimum(there[:, 1], last)),
            reach_m=reach_m,
            end_s=end_s + lasts_s,
        )
        self._last: tuple[IntArray, Any] | None = None

    def active(self, first_s: float, last_s: float) -> tuple[IntArray, Any]:
        """Return the targets that may come in reach between two times, and a fleet of them.

        Parameters
        ----------
        first_s, last_s : float
            Both included.

        Returns
        -------
        columns : ndarray of int
            Indices into the targets, ascending.
        fleet : object with `at(time_s)`
        """
        columns = self.intervals.during(first_s, last_s + self.lasts_s)
        if self._last is None or not np.array_equal(columns, self._last[0]):
            self._last = columns, self._fleet.subset(columns)
        return self._last

    def cut(self, time_s: FloatArray) -> tuple[IntArray, Any, BoolArray]:
        """Return the targets that may come in reach, a fleet of them, and at which times (rows, n).

        Parameters
        ----------
        time_s : (rows,)
        """
        columns, fleet = self.active(float(time_s.min()), float(time_s.max()))
        return columns, fleet, self.near(columns, time_s)

    def near(self, columns: IntArray, time_s: FloatArray) -> BoolArray:
        """Return which targets may come in reach during a look from each time on.

        A window holds targets that are near at some of its instants; this says at which, so that
        what is counted does not depend on the window.

        Parameters
        ----------
        columns : (targets,) of int
            As from `active`.
        time_s : (rows,)

        Returns
        -------
        (rows, targets) of bool
        """
        last_s = float(time_s.max())
        if self.intervals.throughout(float(time_s.min()) + self.lasts_s, last_s) == len(columns):
            return np.ones((len(time_s), len(columns)), dtype=bool)
        if bool((time_s[1:] >= time_s[:-1]).all()):
            return self.intervals.at_each(columns, time_s, time_s + self.lasts_s)
        order = np.argsort(time_s, kind="stable")  # replicas, one after the other
        near: BoolArray = np.empty((len(time_s), len(columns)), dtype=bool)
        near[order] = self.near(columns, time_s[order])
        return near
