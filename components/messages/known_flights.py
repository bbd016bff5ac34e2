"""The flights that the traffic passes on with its rows, for who must know other instants.

What is known of a flight depends on when it is asked: an ownship that is steered will turn where
it is not expected yet. So every row says how many of its ownship's manoeuvres it knows, and goes by
these whatever the other rows of its message know.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol

import numpy as np

from components.geometry import TrajectoryState
from dsa_des.arrays.types import AnyArray, FloatArray, IntArray


class AllFlights(Protocol):
    """The flights of all aircraft of all runs, with all manoeuvres that came so far."""

    @property
    def manoeuvre_count(self) -> int:
        """How many these are: of two of one traffic, the one with more knows all of the other."""

    def states(
        self,
        run: IntArray,
        known: IntArray,
        columns: IntArray,
        time_s: FloatArray,
        ahead_s: FloatArray | float,
    ) -> tuple[TrajectoryState, TrajectoryState]:
        """Return states of ownships and of targets.

        Parameters
        ----------
        run, known : int, broadcastable to the times
            Whose flights, and how many manoeuvres of the ownship count.
        columns : int
            Targets of the roster; with the times they give the shape of what is asked.
        time_s : (rows, 1) or (rows, columns)
            The states of the ownships are of this shape.
        ahead_s : float
            So long after what is known at a time: where positions are published at a rate of their
            own, after the last publication.
        """


class KnownFlights:
    """The flights known at each row of a message.

    Parameters
    ----------
    flights : AllFlights
    run, known : (rows,) of int
        Of each row its run, and how many manoeuvres of the ownship it knows.
    seen : sequence of callables
        What makes of the states what is given (`seen_by`), one after the other.
    """

    def __init__(
        self,
        flights: AllFlights,
        run: IntArray,
        known: IntArray,
        seen: Sequence[Callable[..., Any]] = (),
    ) -> None:
        self.flights, self.run, self.known, self._seen = flights, run, known, tuple(seen)

    def __len__(self) -> int:
        return len(self.run)

    def __call__(self, columns: IntArray, time_s: FloatArray) -> Any:
        """Return what is seen of targets at times (rows, 1) or (rows, columns).

        The states of the ownship, of the times' shape, and of the targets (rows, columns); or what
        `seen_by` makes of them, arrays by name.
        """
        return self._at(self.run[:, np.newaxis], self.known[:, np.newaxis], columns, time_s, 0.0)

    def each(
        self, row: IntArray, column: IntArray, time_s: FloatArray, ahead_s: FloatArray
    ) -> Mapping[str, AnyArray]:
        """Return what is seen of single targets, each as its own row knows it.

        Parameters
        ----------
        row, column : (n,) of int
            Row of the message, and index of the target in the roster.
        time_s, ahead_s : (n,)
            See `AllFlights.states`.

        Returns
        -------
        dict of (n,) arrays
        """
        run, known = self.run[row][np.newaxis], self.known[row][np.newaxis]
        return _flat(self._at(run, known, column, time_s[np.newaxis], ahead_s[np.newaxis]))

    def _at(self, *asked: Any) -> Any:
        found: Any = self.flights.states(*asked)
        for seen in self._seen:
            found = seen(*found)
        return found

    def seen_by(self, seen: Callable[..., Mapping[str, AnyArray]]) -> KnownFlights:
        """Return the same for who looks at the states through `seen`, which takes both."""
        return KnownFlights(self.flights, self.run, self.known, (*self._seen, seen))

    def take_rows(self, rows: slice | IntArray) -> KnownFlights:
        """Return the flights of some rows."""
        return KnownFlights(self.flights, self.run[rows], self.known[rows], self._seen)

    @classmethod
    def join_rows(cls, parts: Sequence[KnownFlights]) -> KnownFlights:
        """Return the flights of the rows of all parts, in the order given."""
        newest = max(parts, key=lambda part: part.flights.manoeuvre_count)
        run, known = (
            np.concatenate([getattr(part, name) for part in parts]) for name in ("run", "known")
        )
        return cls(newest.flights, run, known, newest._seen)


def _flat(seen: Mapping[str, Any]) -> Mapping[str, AnyArray]:
    """Return the single row of what is seen of targets; what is in tables, with their names."""
    found = {name: values[0] for name, values in seen.items() if isinstance(values, np.ndarray)}
    for table, columns in seen.items():
        if isinstance(columns, Mapping):
            found |= {f"{table}_{name}": values[0] for name, values in columns.items()}
    return found
