"""Flights of any kinds, asked together: each at times of its own."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from components.geometry.state import TrajectoryState
from components.traffic.fleet import SampledFleet, ScriptedFleet
from components.traffic.legs import ScriptedTrajectory
from components.traffic.own_flights import OwnFlights
from components.traffic.steered_flight import SteeredFlight
from components.traffic.trajectory import SampledTrajectory
from dsa_des.arrays.types import FloatArray, IntArray


class ManyFlights:
    """Many flights, to the bit as each would be alone.

    Those of a kind that can be put into one table are; others are asked one by one.

    Parameters
    ----------
    flights : sequence of objects with `at(time_s)`
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


def _fleet_of(kind: type, flights: list[Any]) -> Any:
    if kind is SampledTrajectory:
        return SampledFleet(flights)
    if kind is ScriptedTrajectory:
        return ScriptedFleet(flights)
    if kind is SteeredFlight:
        return OwnFlights.of(flights, ManyFlights([flight.flight for flight in flights]))
    return _OneByOne(flights)


def _in_order(rows: list[IntArray], states: list[TrajectoryState]) -> TrajectoryState:
    """Return states put together, those of each part in the rows that it has."""
    if not states:
        none = np.empty(0)
        return TrajectoryState(*(none,) * 6, np.empty(0, dtype=np.bool_))
    order = np.argsort(np.concatenate(rows), kind="stable")
    columns = zip(*(state.arrays() for state in states), strict=True)
    return TrajectoryState(*(np.concatenate(parts)[order] for parts in columns))
