"""The flights that the traffic passes on with its rows, for who must know other instants.

What is known of a flight depends on when it is asked: an aircraft that is steered will turn where
it is not expected yet. So every row says how many manoeuvres of each platform it knows, and goes by
these whatever the other rows of its message know.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol

import numpy as np

from components.geometry import TrajectoryState
from dsa_des.arrays.types import AnyArray, FloatArray, IntArray
from dsa_des.replicas.split_block import NotInLockStep


class AllFlights(Protocol):
    """The flights of all aircraft of all runs, with all manoeuvres that came so far."""

    @property
    def manoeuvre_count(self) -> int:
        """Return the number of manoeuvres; of two messages the larger knows all of the other."""

    @property
    def traffic(self) -> object:
        """The same object for all `AllFlights` of a traffic block, whichever manoeuvres known."""

    def states(
        self,
        run: IntArray,
        known: IntArray,
        columns: IntArray,
        time_s: FloatArray,
        ahead_s: FloatArray | float,
        viewer: int,
    ) -> tuple[TrajectoryState, TrajectoryState]:
        """Return the states of the viewing platform and of its targets in the given runs.

        Times are (rows, 1) or (rows, columns), and so are the states of who looks; `known` (...,
        platforms) is how many manoeuvres of each count. `ahead_s` is how long after what is known
        at a time it is asked: where positions are published at a rate of their own, after the last
        publication. `viewer` is the target from which the others are seen, -1 for the ownship.
        """

    def viewer_states(
        self, run: IntArray, known: IntArray, time_s: FloatArray, viewer: int
    ) -> TrajectoryState:
        """Return the states of the viewing platform in runs (n,), each at its own time (n,)."""

    def compute_if_arrays_changed(
        self, name: str, of: Sequence[AnyArray], make: Callable[[], Any]
    ) -> Any:
        """Return the value kept as `name` if the arrays `of` are unchanged, else that of `make`."""


class KnownFlights:
    """The flights known at each row of a message, all of one traffic.

    Of each row its run (rows,), and how many manoeuvres of each platform it knows, (rows,
    platforms); they are seen from `viewer` (-1 for the ownship). `seen` are the functions that are
    applied to the states in turn.
    """

    def __init__(
        self,
        flights: AllFlights,
        run: IntArray,
        known: IntArray,
        seen: tuple[Callable[..., Any], ...] = (),
        viewer: int = -1,
    ) -> None:
        self.flights, self.run, self.known = flights, run, known
        self._seen, self._viewer = seen, viewer

    def __len__(self) -> int:
        return len(self.run)

    def __call__(self, columns: IntArray, time_s: FloatArray) -> Any:
        """Return what is seen of targets at times (rows, 1) or (rows, columns).

        The states of who looks, of the times' shape, and of the targets (rows, columns); or what
        `with_states_transformed` makes of them, arrays by name.
        """
        run, known = self.run[:, np.newaxis], self.known[:, np.newaxis]
        return self._states(run, known, columns, time_s, 0.0)

    def columns_of_single_targets(
        self, row: IntArray, column: IntArray, time_s: FloatArray, ahead_s: FloatArray
    ) -> Mapping[str, AnyArray]:
        """Return what is observed of single targets, one per given row, as arrays (n,) by name.

        Row of the message, index of the target in the roster and times are (n,), too; see
        `AllFlights.states`.
        """
        run, known = self.run[row][np.newaxis], self.known[row][np.newaxis]
        return _flatten_single_row(
            self._states(run, known, column, time_s[np.newaxis], ahead_s[np.newaxis])
        )

    def viewer_states(self, row: IntArray, time_s: FloatArray) -> TrajectoryState:
        """Return the viewing platform's states by the flights known at each row, at times (n,)."""
        return self.flights.viewer_states(self.run[row], self.known[row], time_s, self._viewer)

    @property
    def viewer(self) -> int:
        """Index of the target that the flights are seen from; -1 for the ownship."""
        return self._viewer

    def compute_if_arrays_changed(
        self, name: str, of: Sequence[AnyArray], make: Callable[[], Any]
    ) -> Any:
        """Return `make`'s value, kept for all viewing platforms while arrays `of` are unchanged."""
        return self.flights.compute_if_arrays_changed(name, of, make)

    def _states(
        self, run: IntArray, known: IntArray, columns: IntArray, time_s: FloatArray, ahead_s: Any
    ) -> Any:
        flights, viewer = self.flights, self._viewer
        states: Any = flights.states(run, known, columns, time_s, ahead_s, viewer)
        for seen in self._seen:
            states = seen(*states)
        return states

    def seen_from(self, viewer: int) -> KnownFlights:
        """Return the same flights seen from another target, by its index; -1 is the ownship."""
        return self._replace(self.run, self.known, viewer=viewer)

    def with_states_transformed(self, seen: Callable[..., Mapping[str, AnyArray]]) -> KnownFlights:
        """Return the same flights with `seen` applied to their states: it gets those of viewer and
        targets and returns columns.
        """
        return self._replace(self.run, self.known, seen=(*self._seen, seen))

    def take_rows(self, rows: slice | IntArray) -> KnownFlights:
        """Return the flights of some rows."""
        return self._replace(self.run[rows], self.known[rows])

    def _replace(self, run: IntArray, known: IntArray, **changed: Any) -> KnownFlights:
        how = {"seen": self._seen, "viewer": self._viewer, **changed}
        return KnownFlights(self.flights, run, known, **how)

    @classmethod
    def join_rows(cls, parts: Sequence[KnownFlights]) -> KnownFlights:
        """Return the flights of the rows of all parts, in the order given."""
        newest = max(parts, key=lambda part: part.flights.manoeuvre_count)
        for part in parts:
            how = part.flights.traffic is newest.flights.traffic, part._seen, part._viewer
            if how != (True, newest._seen, newest._viewer):
                raise NotInLockStep("rows know flights of one traffic, seen by one line of sight")
        run, known = (
            np.concatenate([getattr(part, name) for part in parts]) for name in ("run", "known")
        )
        return newest._replace(run, known)


def _flatten_single_row(seen: Mapping[str, Any]) -> Mapping[str, AnyArray]:
    """Return each array's first row by name; in nested tables prefixed by the table's name."""
    flat = {name: values[0] for name, values in seen.items() if isinstance(values, np.ndarray)}
    for table, columns in seen.items():
        if isinstance(columns, Mapping):
            flat |= {f"{table}_{name}": values[0] for name, values in columns.items()}
    return flat
