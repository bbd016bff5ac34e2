"""The flights that the traffic passes on with its rows, for who must know other instants.

What is known of a flight depends on when it is asked: an ownship that is steered will turn where
it is not expected yet. So every row says how many of its ownship's manoeuvres it knows, and goes by
these whatever the other rows of its message know.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple, Protocol

import numpy as np

from components.geometry import TrajectoryState
from dsa_des.arrays.types import AnyArray, FloatArray, IntArray


class AllFlights(Protocol):
    """The flights of all aircraft of all runs, with all manoeuvres that came so far."""

    @property
    def manoeuvre_count(self) -> int:
        """How many these are: of two of one traffic, the one with more knows all of the other."""

    @property
    def traffic(self) -> object:
        """The same for all flights of one traffic, whatever came since."""

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


class _Source(NamedTuple):
    """The flights of one traffic, and what makes of their states what is given, in turn."""

    flights: AllFlights
    seen: tuple[Callable[..., Any], ...] = ()

    @property
    def key(self) -> Any:
        """The same for sources that differ by the manoeuvres alone that came so far."""
        return id(self.flights.traffic), self.seen

    def at(self, *asked: Any) -> Any:
        found: Any = self.flights.states(*asked)
        for seen in self.seen:
            found = seen(*found)
        return found


class KnownFlights:
    """The flights known at each row of a message.

    Rows of runs that are split have flights of one traffic each.

    Parameters
    ----------
    flights : AllFlights
    run, known : (rows,) of int
        Of each row its run, and how many manoeuvres of the ownship it knows.
    """

    def __init__(self, flights: AllFlights, run: IntArray, known: IntArray) -> None:
        self.run, self.known = run, known
        self._sources: tuple[_Source, ...] = (_Source(flights),)
        self._of_row: IntArray = np.zeros(len(run), dtype=np.int64)

    def __len__(self) -> int:
        return len(self.run)

    def __call__(self, columns: IntArray, time_s: FloatArray) -> Any:
        """Return what is seen of targets at times (rows, 1) or (rows, columns).

        The states of the ownship, of the times' shape, and of the targets (rows, columns); or what
        `seen_by` makes of them, arrays by name.
        """

        def of(source: _Source, here: Any) -> Any:
            run, known = self.run[here][:, np.newaxis], self.known[here][:, np.newaxis]
            return source.at(run, known, columns, time_s[here], 0.0)

        return self._by_source(self._of_row, of)

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

        def of(source: _Source, here: Any) -> Any:
            run, known = self.run[row[here]][np.newaxis], self.known[row[here]][np.newaxis]
            times, ahead = time_s[here][np.newaxis], ahead_s[here][np.newaxis]
            return _flat(source.at(run, known, column[here], times, ahead))

        found: Mapping[str, AnyArray] = self._by_source(self._of_row[row], of)
        return found

    def _by_source(self, which: IntArray, of: Callable[[_Source, Any], Any]) -> Any:
        if len(self._sources) == 1:
            return of(self._sources[0], slice(None))
        numbers = np.flatnonzero(np.bincount(which)).tolist()
        rows = [np.flatnonzero(which == number) for number in numbers]
        parts = [of(self._sources[n], here) for n, here in zip(numbers, rows, strict=True)]
        return _joined(parts, np.argsort(np.concatenate(rows), kind="stable"))

    def _with(
        self, sources: tuple[_Source, ...], of_row: IntArray, run: IntArray, known: IntArray
    ) -> KnownFlights:
        found = KnownFlights(sources[0].flights, run, known)
        found._sources, found._of_row = sources, of_row
        return found

    def seen_by(self, seen: Callable[..., Mapping[str, AnyArray]]) -> KnownFlights:
        """Return the same for who looks at the states through `seen`, which takes both."""
        sources = tuple(one._replace(seen=(*one.seen, seen)) for one in self._sources)
        return self._with(sources, self._of_row, self.run, self.known)

    def take_rows(self, rows: slice | IntArray) -> KnownFlights:
        """Return the flights of some rows."""
        return self._with(self._sources, self._of_row[rows], self.run[rows], self.known[rows])

    @classmethod
    def join_rows(cls, parts: Sequence[KnownFlights]) -> KnownFlights:
        """Return the flights of the rows of all parts, in the order given."""
        newest: dict[Any, _Source] = {}  # of each traffic and who sees it, as they first appear
        for one in (source for part in parts for source in part._sources):
            other = newest.setdefault(one.key, one)
            if one.flights.manoeuvre_count > other.flights.manoeuvre_count:
                newest[one.key] = one
        place = {key: number for number, key in enumerate(newest)}
        of_row = [
            np.array([place[one.key] for one in part._sources])[part._of_row] for part in parts
        ]
        run, known = (
            np.concatenate([getattr(part, name) for part in parts]) for name in ("run", "known")
        )
        return parts[0]._with(tuple(newest.values()), np.concatenate(of_row), run, known)


def _joined(parts: Sequence[Any], order: IntArray) -> Any:
    """Join what several traffics gave for rows of their own, and put the rows in order."""
    first = parts[0]
    if isinstance(first, Mapping):
        return {name: _joined([part[name] for part in parts], order) for name in first}
    if isinstance(first, TrajectoryState):
        columns = zip(*(state.arrays() for state in parts), strict=True)
        return TrajectoryState(*(_joined(arrays, order) for arrays in columns))
    if isinstance(first, tuple):
        return tuple(_joined(states, order) for states in zip(*parts, strict=True))
    return np.concatenate(parts)[order]


def _flat(seen: Mapping[str, Any]) -> Mapping[str, AnyArray]:
    """Return the single row of what is seen of targets; what is in tables, with their names."""
    found = {name: values[0] for name, values in seen.items() if isinstance(values, np.ndarray)}
    for table, columns in seen.items():
        if isinstance(columns, Mapping):
            found |= {f"{table}_{name}": values[0] for name, values in columns.items()}
    return found
