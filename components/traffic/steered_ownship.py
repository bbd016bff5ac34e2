"""The flights of a traffic source as they are known: its ownship flies what it is told to."""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple, cast

import numpy as np

from components.flights.culling import Culling
from components.flights.fleet import Fleet
from components.flights.steered_flight import SteeredFlight, Trajectory
from components.geometry import TrajectoryState
from components.messages.known_flights import Flights, KnownFlights
from components.messages.steering import Manoeuvre, Manoeuvres
from dsa_des.arrays.types import FloatArray, IntArray
from dsa_des.block.component import Component, Context, Input
from dsa_des.block.wake import Wake

#: The truth is recorded without being asked for where aircraft times seconds, of all runs that are
#: recorded together, are at most this: some ten thousand rows with the usual sensors.
SMALL_S = 600.0
_TABLE = "truth"


def truth_is_recorded(context: Context, targets: int) -> bool:
    """Return whether a scene records where all aircraft are.

    Where tables are chosen, as a study chooses those that its metrics read, that one is among them
    or it is not made.

    How often sensors look does not count: replicas whose clocks differ record the same tables.
    """
    record = context.sections.get("record")
    asked = "auto" if record is None else record.truth
    if context.recorded_tables is not None:
        return asked is not False and _TABLE in context.recorded_tables
    if asked == "auto":
        seconds = context.recorded_runs * float(context.duration_s)
        return (1 + targets) * seconds <= SMALL_S
    return bool(asked)


class TrueFlights:
    """The ownship's flight, as far as it is known, and those of all targets."""

    def __init__(self, own: Any, fleet: Any, crabbing: Sequence[Any]) -> None:
        self._own, self._fleet, self._crabbing = own, fleet, crabbing

    def __call__(
        self, columns: IntArray, time_s: FloatArray
    ) -> tuple[TrajectoryState, TrajectoryState]:
        """Return the ownship's states (rows, 1) and the targets' (rows, n) at times (rows, 1)."""
        times = np.repeat(time_s, len(columns), axis=1)
        each = np.broadcast_to(columns, times.shape).reshape(-1)
        others = self._fleet.each(each, times.reshape(-1)).reshaped(times.shape)
        own = self._own.at(time_s.reshape(-1)).reshaped(time_s.shape)
        for crabbing in self._crabbing:
            own = crabbing.of_own(self._own, own, time_s)
            others = crabbing.of_targets(columns, others, times)
        return own, others


class Coming(NamedTuple):
    """A manoeuvre that has come, in which run and when."""

    run: int
    tick: int
    manoeuvre: Manoeuvre


def arrived_manoeuvres(wake: Wake) -> list[Coming]:
    """Return the manoeuvres that have come since the last wake."""
    return [
        Coming(*one)
        for new in wake.arrivals("manoeuvres")
        for one in zip(
            new.message.run.tolist(),
            new.tick.tolist(),
            map(Manoeuvre, *(getattr(new.message, name).tolist() for name in Manoeuvre._fields)),
            strict=True,
        )
    ]


class SteeredOwnship(Component):
    """A block whose ownship flies manoeuvres from the time they come.

    Subclasses set `own` and `targets` in `setup`, and then call `_be_steered`.
    """

    inputs = {
        "manoeuvres": Input(
            Manoeuvres,
            "queued",
            "Turns and climbs that the ownship is told to fly.",
            required=False,
        )
    }

    own: Trajectory
    targets: Fleet
    _crabbing: list[Any]
    _culling: Culling | None = None
    #: Whether blocks ask for flights at other instants, and whether the truth is recorded.
    flights_asked_for = False
    says_truth = False

    def serves_replicas(self) -> bool:
        """Return whether replicas share it: an ownship that is steered flies otherwise in each."""
        return super().serves_replicas() and not self.context.producers

    def _be_steered(self) -> None:
        """Let manoeuvres be flown from now on, where they can come."""
        if self.context.producers:
            self.own = SteeredFlight(self.own)
        self._flights_now: Flights = partial(self.flights, self.own)
        self._truth_now = self._true_flights()
        #: Manoeuvres that have come, and are not flown by any row yet.
        self._pending: list[Coming] = []

    def own_at(self, time_s: FloatArray) -> TrajectoryState:
        """Return the ownship's state, as it is known now, at some times (any shape), in wind."""
        own = self.own.at(time_s)
        for crabbing in self._crabbing:
            own = crabbing.of_own(self.own, own, time_s)
        return own

    def flights(
        self,
        own: Trajectory,
        columns: IntArray,
        time_s: FloatArray,
        ahead_s: FloatArray | float = 0.0,
    ) -> tuple[TrajectoryState, TrajectoryState]:
        """Return the states of the ownship and of some targets, each at a time of its own.

        With an ``update_rate_hz`` the last publication up to that time counts; they are wanted
        `ahead_s` later.
        """
        if self.p.update_rate_hz is not None:
            rate = float(self.p.update_rate_hz)
            time_s = np.floor(time_s * rate) / rate
        time_s = time_s + ahead_s
        columns_each, times = np.broadcast_to(columns, time_s.shape).reshape(-1), time_s.reshape(-1)
        others = self.targets.each(columns_each, times)
        if self._culling is not None:
            near = self._culling.intervals.holds(columns_each, times, times)
            others = replace(others, present=others.present & near)
        seen, others = own.at(time_s), others.reshaped(time_s.shape)
        for crabbing in self._crabbing:
            seen = crabbing.of_own(own, seen, time_s)
            others = crabbing.of_targets(columns, others, time_s)
        return seen, others

    def _steer(self, wake: Wake) -> tuple[KnownFlights | None, KnownFlights | None]:
        """Steer the ownship at the times at which manoeuvres have come; return flights and truth.

        A row knows the manoeuvres that have come by its own instant, whatever came later in this
        wake; None stands for what no block asks for.
        """
        pending = [*self._pending, *arrived_manoeuvres(wake)]
        last = int(wake.ticks[-1])
        # What comes after the last row is for the next wake: what is flown at the end of a run
        # must not depend on how far a window reached beyond it.
        due = [one for one in pending if one.tick <= last]
        self._pending = pending[len(due) :]
        known, true = [self._flights_now], [self._truth_now]
        for one in due:
            assert isinstance(self.own, SteeredFlight)
            self.own = self.own.steered(one.tick / self.context.ticks_per_s, one.manoeuvre)
            known.append(partial(self.flights, self.own))
            true.append(self._true_flights())
        self._flights_now, self._truth_now = known[-1], true[-1]
        if not self.flights_asked_for and self._truth_now is None:
            return None, None
        # A manoeuvre has come before anything runs at its instant.
        came = np.array([one.tick for one in due], dtype=np.int64)
        of_row = np.searchsorted(came, wake.ticks, side="right")
        return (
            KnownFlights(known, of_row) if self.flights_asked_for else None,
            None if self._truth_now is None else KnownFlights(cast(Any, true), of_row),
        )

    def _true_flights(self) -> TrueFlights | None:
        """Return all flights as they are known now, if the truth is recorded."""
        return TrueFlights(self.own, self.targets, self._crabbing) if self.says_truth else None
