"""The flights of all runs of a traffic source as they are known, with manoeuvres commanded so far.

What each row holds is what a run alone would give, to the bit; a single run is run 0.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from components.aircraft.aircraft import Roster
from components.flights.culling import NearIntervals
from components.flights.fleet import Fleet
from components.flights.many_flights import SteeredFleet
from components.geometry import TrajectoryState
from components.messages.steering import Manoeuvre
from dsa_des.arrays.keyed_table import turns
from dsa_des.arrays.run_ticks import RunTicks, next_of_run
from dsa_des.arrays.types import FloatArray, IntArray
from dsa_des.block.wake import Wake


class FlightsOfRuns(NamedTuple):
    """The flights of all runs: an ownship each, and the targets of all one after the other."""

    own: Fleet
    targets: Fleet
    roster: Roster


@dataclass(frozen=True, eq=False)
class FlownFlights:
    """The flights of all runs with the manoeuvres that came so far; see `messages.known_flights`.

    An ownship for each run, and the targets of run 0, those of run 1, and so on. For other instants
    than those of rows, targets are there while `intervals` say that they may be near, and positions
    are those of the last publication at `rates_hz` (runs,).
    """

    own: SteeredFleet
    targets: Fleet
    crabbing: Sequence[Any] = ()
    intervals: NearIntervals | None = None
    rates_hz: FloatArray | None = None

    @property
    def width(self) -> int:
        """How many targets each run has."""
        return len(self.targets) // len(self.own)

    @property
    def traffic(self) -> object:
        """The same for all flights of one traffic: its targets."""
        return self.targets

    @property
    def manoeuvre_count(self) -> int:
        """How many manoeuvres came so far, in all runs."""
        return int(self.own.manoeuvre_count.sum())

    def own_at(
        self,
        run: IntArray,
        time_s: FloatArray,
        known: IntArray | None = None,
        state: TrajectoryState | None = None,
    ) -> TrajectoryState:
        """Return the states of the ownships of runs (n,), each at a time (n,) of its own, by the
        first `known` of their manoeuvres, or all; `state` is what is known of them but for the
        wind.
        """
        state = self.own.each(run, time_s, known) if state is None else state
        for crabbing in self.crabbing:
            speed_mps = self.own.ground_speeds_mps(run, time_s, known)
            state = crabbing(state, speed_mps, self.own.fixed_attitudes_rad(run, time_s, known))
        return state

    def targets_at(
        self, target: IntArray, time_s: FloatArray, state: TrajectoryState | None = None
    ) -> TrajectoryState:
        """Return the states of targets (n,), each at a time (n,) of its own; `state` is what is
        known of them but for the wind.
        """
        state = self.targets.each(target, time_s) if state is None else state
        for crabbing in self.crabbing:
            speed_mps = self.targets.ground_speeds_mps(target, time_s)
            state = crabbing(state, speed_mps, self.targets.fixed_attitudes_rad(target, time_s))
        return state

    def states(
        self,
        run: IntArray,
        known: IntArray,
        columns: IntArray,
        time_s: FloatArray,
        ahead_s: FloatArray | float,
    ) -> tuple[TrajectoryState, TrajectoryState]:
        """Return states of ownships and of targets; see `messages.known_flights.AllFlights`."""
        time_s = self._published_s(run, time_s) + ahead_s
        runs, counts = (np.broadcast_to(of, time_s.shape).reshape(-1) for of in (run, known))
        own = self.own_at(runs, time_s.reshape(-1), counts).reshaped(time_s.shape)
        target = run * self.width + columns
        times = np.broadcast_to(time_s, np.broadcast_shapes(time_s.shape, target.shape))
        target = np.broadcast_to(target, times.shape).reshape(-1)
        others = self.targets_at(target, times.reshape(-1))
        if self.intervals is not None:
            near = self.intervals.holds(target, times.reshape(-1), times.reshape(-1))
            others = replace(others, present=others.present & near)
        return own, others.reshaped(times.shape)

    def own_states(self, run: IntArray, known: IntArray, time_s: FloatArray) -> TrajectoryState:
        """Return states of ownships; see `messages.known_flights.AllFlights`."""
        return self.own_at(run, self._published_s(run, time_s), known)

    def _published_s(self, run: IntArray, time_s: FloatArray) -> FloatArray:
        """Return the times of the last publications."""
        if self.rates_hz is None:
            return time_s
        rate = self.rates_hz[run]
        published: FloatArray = np.floor(time_s * rate) / rate
        return published


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


def due_manoeuvres(wake: Wake, pending: list[Coming]) -> tuple[list[Coming], list[Coming]]:
    """Part what has come into what rows of this wake fly, and what is for later ones.

    What comes after the last row is for the next wake: what is flown at the end of a run must not
    depend on how far a window reached beyond it.
    """
    pending = sorted(pending, key=lambda one: (one.run, one.tick))
    came = _instants(pending)
    row = next_of_run(wake.instants, came)  # the first that flies it, if it is of its ownship
    due = (row < len(wake)) & (wake.run[np.minimum(row, len(wake) - 1)] == came.run)
    now = [one for one, is_due in zip(pending, due.tolist(), strict=True) if is_due]
    return now, [one for one, is_due in zip(pending, due.tolist(), strict=True) if not is_due]


def steered(
    own: SteeredFleet, due: list[Coming], wake: Wake, run: IntArray
) -> tuple[SteeredFleet, IntArray]:
    """Return ownships that fly what has come, and how many manoeuvres each row of runs knows.

    A row knows the manoeuvres that have come by its own instant, whatever came later in this wake.
    """
    known: IntArray = own.manoeuvre_count[run]
    came = _instants(due)
    for one in turns(came.run):  # the first of every ownship, then the next
        ownship, ticks = came.run[one], came.tick[one]
        manoeuvres = [due[number].manoeuvre for number in one.tolist()]
        own = own.steered(ownship, ticks / wake.ticks_per_s, manoeuvres)
        known = known + _at_or_after(run, wake.ticks, ownship, ticks)
    return own, known


def _instants(coming: list[Coming]) -> RunTicks:
    runs, ticks = ([getattr(one, name) for one in coming] for name in ("run", "tick"))
    return RunTicks(np.array(runs, dtype=np.int64), np.array(ticks, dtype=np.int64))


def _at_or_after(run: IntArray, ticks: IntArray, ownship: IntArray, came: IntArray) -> IntArray:
    """Return 1 for the rows of some ownships at or after what came for each of them."""
    order = np.argsort(ownship)
    index = np.minimum(np.searchsorted(ownship[order], run), len(ownship) - 1)
    mine = order[index]
    return ((ownship[mine] == run) & (ticks >= came[mine])).astype(np.int64)
