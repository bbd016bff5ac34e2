"""The flights that the traffic passes on with its rows, for who must know other instants.

What is known of a flight depends on when it is asked: an ownship that is steered will turn where
it is not expected yet. So every row carries the flights as they are known at its own instant, and
keeps them whatever the other rows of its message know.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from components.geometry import TrajectoryState
from dsa_des.arrays.types import AnyArray, FloatArray, IntArray

#: Gives the states of the ownship and of some targets (columns of the roster) at times
#: (rows, columns), and so many seconds after what is known of them then, if a third argument says
#: so: as two `TrajectoryState` with arrays of that shape; or what was made of them
#: (`KnownFlights.seen_by`), as arrays of that shape by name.
Flights = Callable[..., Any]


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

    def __call__(self, columns: IntArray, time_s: FloatArray) -> Any:
        """Return what the flights give at times (rows, columns), as each row knows them."""
        if len(self.flights) == 1:
            return self.flights[0](columns, time_s)
        known = np.flatnonzero(np.bincount(self.of_row)).tolist()
        rows = [np.flatnonzero(self.of_row == number) for number in known]
        parts = [
            self.flights[number](columns, time_s[here])
            for number, here in zip(known, rows, strict=True)
        ]
        return _joined(parts, np.argsort(np.concatenate(rows), kind="stable"))

    def each(
        self, row: IntArray, column: IntArray, time_s: FloatArray, ahead_s: FloatArray
    ) -> Mapping[str, AnyArray]:
        """Return what is seen of single targets, each as its own row knows it.

        Parameters
        ----------
        row, column : (n,) of int
            Row of the message, and index of the target in the roster.
        time_s, ahead_s : (n,)
            So long after what is known at a time: where positions are published at a rate of their
            own, after the last publication.

        Returns
        -------
        dict of (n,) arrays
        """
        known = self.of_row[row]
        numbers = np.unique(known).tolist()
        if len(numbers) == 1:
            return flat(self.flights[numbers[0]](column, time_s[np.newaxis], ahead_s[np.newaxis]))
        places = [np.flatnonzero(known == number) for number in numbers]
        parts = [
            flat(self.flights[number](column[of], time_s[np.newaxis, of], ahead_s[np.newaxis, of]))
            for number, of in zip(numbers, places, strict=True)
        ]
        joined: Mapping[str, AnyArray] = _joined(
            parts, np.argsort(np.concatenate(places), kind="stable")
        )
        return joined

    def seen_by(self, seen: Callable[..., Mapping[str, AnyArray]]) -> KnownFlights:
        """Return the same for who looks at the states through `seen`, which takes both."""
        return KnownFlights([_Seen(flight, seen) for flight in self.flights], self.of_row)

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
        places: dict[Flights, int] = {}
        of_row = []
        for part in parts:
            place = [places.setdefault(flight, len(places)) for flight in part.flights]
            of_row.append(np.array(place, dtype=np.int64)[part.of_row])
        return cls(list(places), np.concatenate(of_row))


@dataclass(frozen=True)
class _Seen:
    """Flights as an onlooker sees them; equal where the flights and the onlooker are."""

    flight: Flights
    seen: Callable[..., Mapping[str, AnyArray]]

    def __call__(
        self, columns: IntArray, time_s: FloatArray, *ahead_s: FloatArray
    ) -> Mapping[str, AnyArray]:
        return self.seen(*self.flight(columns, time_s, *ahead_s))


def flat(seen: Mapping[str, Any]) -> Mapping[str, AnyArray]:
    """Return the single row of what is seen of targets; what is in tables, with their names."""
    found = {name: values[0] for name, values in seen.items() if isinstance(values, np.ndarray)}
    for table, columns in seen.items():
        if isinstance(columns, Mapping):
            found |= {f"{table}_{name}": values[0] for name, values in columns.items()}
    return found


def _joined(parts: Sequence[Any], order: IntArray) -> Any:
    """Join what several flights gave for rows of their own, and put the rows in order."""
    first = parts[0]
    if isinstance(first, Mapping):
        return {name: _joined([part[name] for part in parts], order) for name in first}
    if isinstance(first, TrajectoryState):
        columns = zip(*(state.arrays() for state in parts), strict=True)
        return TrajectoryState(*(_joined(arrays, order) for arrays in columns))
    if isinstance(first, tuple):
        return tuple(_joined(states, order) for states in zip(*parts, strict=True))
    return np.concatenate(parts)[order]
