"""The flights that the traffic passes on with its rows, for who must know other instants.

What is known of a flight depends on when it is asked: an ownship that is steered will turn where
nobody expects it yet. So every row carries the flights as they are known at its own instant, and
keeps them whatever the other rows of its message know.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from components.traffic.state import TrajectoryState
from dsa_des.types import AnyArray, FloatArray, IntArray

#: Gives the states of the ownship and of some targets (columns of the roster) at times
#: (rows, columns), as arrays of that shape.
Flights = Callable[[IntArray, FloatArray], tuple[TrajectoryState, TrajectoryState]]


class KnownFlights:
    """The flights known at each row of a message.

    Parameters
    ----------
    flights : sequence of Flights
        As they are known at some row; each is there once.
    of_row : (rows,) of int
        Which of them each row knows.
    """

    def __init__(self, flights: Sequence[Flights], of_row: IntArray) -> None:
        self.flights, self.of_row = tuple(flights), of_row

    def __len__(self) -> int:
        return len(self.of_row)

    def __call__(
        self, columns: IntArray, time_s: FloatArray
    ) -> tuple[TrajectoryState, TrajectoryState]:
        """Return the ownship and some targets at times (rows, columns), as each row knows them."""
        if len(self.flights) == 1:
            return self.flights[0](columns, time_s)
        known = np.flatnonzero(np.bincount(self.of_row)).tolist()
        rows = [np.flatnonzero(self.of_row == number) for number in known]
        parts = [
            self.flights[number](columns, time_s[here])
            for number, here in zip(known, rows, strict=True)
        ]
        order = np.argsort(np.concatenate(rows), kind="stable")
        own, others = (_joined(states, order) for states in zip(*parts, strict=True))
        return own, others

    def take_rows(self, rows: slice | IntArray) -> KnownFlights:
        """Return the flights of some rows."""
        of_row = self.of_row[rows]
        if len(self.flights) == 1:
            return KnownFlights(self.flights, of_row)
        # Flights that no row knows any more are let go.
        used, place = np.unique(of_row, return_inverse=True)
        return KnownFlights([self.flights[number] for number in used.tolist()], place)

    @classmethod
    def join_rows(cls, parts: Sequence[KnownFlights]) -> KnownFlights:
        """Return the flights of the rows of all parts, in the order given."""
        flights: list[Flights] = []
        of_row = []
        for part in parts:
            for flight in part.flights:
                if flight not in flights:
                    flights.append(flight)
            place = np.array([flights.index(flight) for flight in part.flights], dtype=np.int64)
            of_row.append(place[part.of_row])
        return cls(flights, np.concatenate(of_row))


class Revisit:
    """The targets as seen from the ownship at other instants than those of the rows.

    Parameters
    ----------
    flights : KnownFlights
    seen : callable
        Gives, for states of the ownship and of targets (rows, columns), the fields
        (rows, columns) of `components.target_messages.RelativeTargets`.
    """

    def __init__(self, flights: KnownFlights, seen: Callable[..., dict[str, AnyArray]]) -> None:
        self.flights, self._seen = flights, seen

    def __call__(self, columns: IntArray, time_s: FloatArray) -> dict[str, AnyArray]:
        """Return the fields of some targets at times (rows, columns), one row per row here."""
        return self._seen(*self.flights(columns, time_s))

    def take_rows(self, rows: slice | IntArray) -> Revisit:
        """Return the same of some rows."""
        return Revisit(self.flights.take_rows(rows), self._seen)

    @classmethod
    def join_rows(cls, parts: Sequence[Revisit]) -> Revisit:
        """Return the same of the rows of all parts, in the order given."""
        return cls(KnownFlights.join_rows([part.flights for part in parts]), parts[-1]._seen)


def _joined(states: Sequence[Any], order: IntArray) -> TrajectoryState:
    columns = zip(*(state.arrays() for state in states), strict=True)
    return TrajectoryState(*(np.concatenate(arrays)[order] for arrays in columns))
