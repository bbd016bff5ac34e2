"""Many flights of any kind asked together, and ownships that are steered while they are flown."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np

from components.flights.fleet import LegTable, fleet_of
from components.flights.steered_flight import (
    SteeredFlight,
    SteeredPart,
    flown_from,
    times_around_s,
)
from components.geometry.state import TrajectoryState
from components.messages.steering import Manoeuvre
from dsa_des.arrays.types import FloatArray, IntArray


class EachFlight(Protocol):
    """Flights that are asked each at times of its own."""

    def each(self, aircraft: IntArray, time_s: FloatArray) -> TrajectoryState:
        """Return states of aircraft (n,), each at a time (n,) of its own."""


class Fleet(EachFlight, Protocol):
    """The flights of many aircraft."""

    def at(self, time_s: Any) -> TrajectoryState:
        """Return their states, shape (times, aircraft)."""

    def subset(self, columns: IntArray) -> Fleet:
        """Return the flights of some of them, given by their indices, ascending."""


class OwnFlights:
    """What every ownship flies: its own flight, and after manoeuvres what each of them led to.

    As many `components.flights.steered_flight.SteeredFlight`, to the bit.
    """

    def __init__(self, flights: EachFlight, count: int) -> None:
        self._flights = flights
        #: Of each ownship: when its parts begin, in order, and which they are.
        self._start_s = np.full((count, 1), np.inf)
        self._part = np.zeros((count, 1), dtype=np.int64)
        #: How many parts each of them has.
        self.count = np.zeros(count, dtype=np.int64)
        self._parts: LegTable | None = None
        self._flown: list[SteeredPart] = []

    @classmethod
    def of(cls, steered: Sequence[SteeredFlight], flights: EachFlight) -> OwnFlights:
        """Return flights that were steered before."""
        made = cls(flights, len(steered))
        parts = [flight.parts for flight in steered]
        made.count[:] = [len(of_one) for of_one in parts]
        made._flown = [flight for of_one in parts for _, flight in of_one]
        if made._flown:
            made._parts = LegTable(made._flown)
        room = len(steered), int(made.count.max(initial=0)) + 1
        made._start_s, made._part = np.full(room, np.inf), np.zeros(room, dtype=np.int64)
        there = np.arange(room[1]) < made.count[:, np.newaxis]
        made._start_s[there] = [start_s for of_one in parts for start_s, _ in of_one]
        made._part[there] = np.arange(len(made._flown))
        return made

    def parts_of(self, ownship: int) -> tuple[tuple[float, SteeredPart], ...]:
        """Return what an ownship flies after each of its manoeuvres, and from when on, s."""
        columns = range(int(self.count[ownship]))
        return tuple(
            (float(self._start_s[ownship, k]), self._flown[self._part[ownship, k]]) for k in columns
        )

    def each(
        self, ownship: IntArray, time_s: FloatArray, known: IntArray | None = None
    ) -> TrajectoryState:
        """Return the states of ownships (n,), each at a time (n,) of its own, in s.

        `known` says how many of the ownship's manoeuvres count; all by default.
        """
        if self._parts is None:
            return self._flights.each(ownship, time_s)
        part = (self._start_s[ownship] <= time_s[:, np.newaxis]).sum(axis=1)
        if known is not None:
            part = np.minimum(part, known)
        steered = part > 0
        if not steered.any():
            return self._flights.each(ownship, time_s)
        which = self._part[ownship[steered], part[steered] - 1]
        steered_state = self._parts.state(which, time_s[steered])
        if steered.all():
            return steered_state
        own = self._flights.each(ownship[~steered], time_s[~steered])
        columns = []
        for alone, after in zip(own.arrays(), steered_state.arrays(), strict=True):
            column = np.empty(len(ownship), dtype=alone.dtype)
            column[~steered], column[steered] = alone, after
            columns.append(column)
        return TrajectoryState(*columns)

    def fastest_by(self, ownship: IntArray, time_s: FloatArray) -> FloatArray:
        """Return the largest speed of any manoeuvre begun by ownships (n,) by times (n,), or 0."""
        if not self._flown:
            return np.zeros(len(ownship))
        speeds = np.array([part.max_speed_mps for part in self._flown])[self._part[ownship]]
        begun = self._start_s[ownship] <= time_s[:, np.newaxis]
        return np.asarray(np.where(begun, speeds, 0.0).max(axis=1))

    def steer(self, ownship: IntArray, time_s: FloatArray, manoeuvres: Sequence[Manoeuvre]) -> None:
        """Let ownships (each once) fly manoeuvres from times on, none before an earlier one."""
        times_s = times_around_s(time_s)
        around = self.each(np.repeat(ownship, times_s.shape[1]), times_s.reshape(-1))
        around = around.reshaped(times_s.shape)
        before = [
            self._flown[self._part[own, self.count[own] - 1]] if self.count[own] else None
            for own in ownship.tolist()
        ]
        new = flown_from("ownship", around, time_s, manoeuvres, before)
        table = LegTable(new)
        self._parts = table if self._parts is None else LegTable.joined(self._parts, table)
        if int(self.count[ownship].max()) + 1 >= self._start_s.shape[1]:
            room = self._start_s.shape
            self._start_s = np.concatenate([self._start_s, np.full(room, np.inf)], axis=1)
            self._part = np.concatenate([self._part, np.zeros(room, dtype=np.int64)], axis=1)
        place = self.count[ownship]
        self._start_s[ownship, place] = time_s
        self._part[ownship, place] = len(self._flown) + np.arange(len(new))
        self.count[ownship] += 1
        self._flown += new


class ManyFlights:
    """Many flights, to the bit as each would be alone.

    Those of a kind that can be put into one table are; others are asked one by one.
    """

    def __init__(self, flights: Sequence[Any]) -> None:
        by_kind: dict[type, list[int]] = {}
        for number, flight in enumerate(flights):
            by_kind.setdefault(type(flight), []).append(number)
        self._fleets: list[Any] = []
        self._fleet, self._place = np.empty((2, len(flights)), dtype=np.int64)
        for kind, numbers in by_kind.items():
            self._fleet[numbers] = len(self._fleets)
            self._place[numbers] = np.arange(len(numbers))
            self._fleets.append(_fleet_of(kind, [flights[number] for number in numbers]))

    def each(self, flight: IntArray, time_s: FloatArray) -> TrajectoryState:
        """Give single flights' states (n,), each at a time (n,) of its own, in s."""
        fleet, place = self._fleet[flight], self._place[flight]
        asked = np.flatnonzero(np.bincount(fleet, minlength=1)).tolist()
        if len(asked) == 1:
            alone: TrajectoryState = self._fleets[asked[0]].each(place, time_s)
            return alone
        rows = [np.flatnonzero(fleet == number) for number in asked]
        return _in_order(
            rows,
            [self._fleets[k].each(place[r], time_s[r]) for k, r in zip(asked, rows, strict=True)],
        )


class _OneByOne:
    def __init__(self, flights: Sequence[Any]) -> None:
        self._flights = flights

    def each(self, flight: IntArray, time_s: FloatArray) -> TrajectoryState:
        asked = np.flatnonzero(np.bincount(flight, minlength=1)).tolist()
        rows = [np.flatnonzero(flight == number) for number in asked]
        states = [self._flights[k].at(time_s[r]) for k, r in zip(asked, rows, strict=True)]
        return _in_order(rows, states)


def _fleet_of(kind: type, flights: list[Any]) -> EachFlight:
    if kind is SteeredFlight:
        return OwnFlights.of(flights, ManyFlights([flight.flight for flight in flights]))
    return fleet_of(flights) or _OneByOne(flights)


def _in_order(rows: list[IntArray], states: list[TrajectoryState]) -> TrajectoryState:
    """Return states put together, those of each part in the rows that it has."""
    if not states:
        none = np.empty(0)
        return TrajectoryState(*(none,) * 6, np.empty(0, dtype=np.bool_))
    order = np.argsort(np.concatenate(rows), kind="stable")
    columns = zip(*(state.arrays() for state in states), strict=True)
    return TrajectoryState(*(np.concatenate(parts)[order] for parts in columns))
