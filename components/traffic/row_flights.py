"""The flights of replicas as each row of a message knows them: its own replica's, so far."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from copy import copy
from dataclasses import replace
from typing import Any, Self

import numpy as np

from components.geometry.state import TrajectoryState
from components.messages.known_flights import flat
from components.traffic.near_intervals import NearIntervals
from components.traffic.own_flights import OwnFlights
from dsa_des.arrays.types import AnyArray, FloatArray, IntArray


class RowFlights:
    """The flights of all aircraft as each row of a message knows them, for the truth.

    As `components.messages.known_flights.KnownFlights` of `TrueFlights`.

    Parameters
    ----------
    own : OwnFlights
    targets : Fleet
    width : int
        Targets of each replica.
    replica, known : (rows,) of int
        Each row's replica, and how many manoeuvres of its ownship it knows.
    """

    def __init__(
        self, own: OwnFlights, targets: Any, width: int, replica: IntArray, known: IntArray
    ) -> None:
        self._own, self._targets, self._width = own, targets, width
        self._replica, self._known = replica, known

    def __len__(self) -> int:
        return len(self._replica)

    def __call__(
        self, columns: IntArray, time_s: FloatArray
    ) -> tuple[TrajectoryState, TrajectoryState]:
        """Return the ownships' states (rows, 1) and the targets' (rows, n) at times (rows, 1)."""
        shape = len(time_s), len(columns)
        target = self._replica[:, np.newaxis] * self._width + columns
        times = np.repeat(time_s, len(columns), axis=1).reshape(-1)
        others = self._targets.each(target.reshape(-1), times).reshaped(shape)
        own = self._own.each(self._replica, time_s.reshape(-1), self._known)
        return own.reshaped(time_s.shape), others

    def take_rows(self, rows: slice | IntArray) -> Self:
        """Return the flights of some rows."""
        found = copy(self)
        found._replica, found._known = self._replica[rows], self._known[rows]
        return found

    @classmethod
    def join_rows(cls, parts: Sequence[Self]) -> Self:
        """Return the flights of the rows of all parts, in the order given."""
        found = copy(parts[0])
        found._replica = np.concatenate([part._replica for part in parts])
        found._known = np.concatenate([part._known for part in parts])
        return found


class AskedFlights(RowFlights):
    """The same for who must know other instants, each aircraft at a time of its own.

    As `components.messages.known_flights.KnownFlights` of a traffic source's flights.

    Parameters
    ----------
    own, targets, width, replica, known
        As for `RowFlights`.
    intervals : NearIntervals or None
        When targets may matter; they are not there otherwise.
    rates_hz : (replicas,) or None
        As often each replica's positions are published, if not always.
    """

    def __init__(
        self,
        *of_rows: Any,
        intervals: NearIntervals | None,
        rates_hz: FloatArray | None,
    ) -> None:
        super().__init__(*of_rows)
        self._intervals, self._rates_hz = intervals, rates_hz
        self._seen: tuple[Callable[..., Any], ...] = ()

    def __call__(self, columns: IntArray, time_s: FloatArray) -> Any:
        """Return what the flights give at times (rows, columns), as each row knows them."""
        row = np.repeat(np.arange(len(self)), time_s.shape[1])
        column = np.broadcast_to(columns, time_s.shape).reshape(-1)
        return self._states(row, column, time_s, 0.0)

    def each(
        self, row: IntArray, column: IntArray, time_s: FloatArray, ahead_s: FloatArray
    ) -> Mapping[str, AnyArray]:
        """Return what is seen of single targets, each as its own row knows it.

        See `KnownFlights.each`.
        """
        return flat(self._states(row, column, time_s[np.newaxis], ahead_s))

    def _states(
        self, row: IntArray, column: IntArray, time_s: FloatArray, ahead_s: FloatArray | float
    ) -> Any:
        """Return ownships and targets of rows and columns (n,) at times of as many elements."""
        replica = self._replica[row]
        if self._rates_hz is not None:
            rate = self._rates_hz[replica].reshape(time_s.shape)
            time_s = np.floor(time_s * rate) / rate
        time_s = time_s + ahead_s
        times = time_s.reshape(-1)
        target = replica * self._width + column
        others = self._targets.each(target, times)
        if self._intervals is not None:
            near = self._intervals.holds(target, times, times)
            others = replace(others, present=others.present & near)
        own = self._own.each(replica, times, self._known[row])
        found: Any = own.reshaped(time_s.shape), others.reshaped(time_s.shape)
        for seen in self._seen:
            found = seen(*found)
        return found

    def seen_by(self, seen: Callable[..., Mapping[str, AnyArray]]) -> AskedFlights:
        """Return the same for who looks at the states through `seen`, which takes both."""
        found = copy(self)
        found._seen = (*self._seen, seen)
        return found
