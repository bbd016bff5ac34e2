"""Traffic of many replicas whose flights differ, flown together: every row asks for its own.

What each row holds is what a run of its own replica would give, to the bit. Targets are numbered
through: those of the first replica, then those of the second, and so on.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from copy import copy
from dataclasses import replace
from typing import Any, NamedTuple, Self, cast

import numpy as np

from components.aircraft.aircraft import Aircraft, Roster, joint_roster
from components.flights.culling import NearIntervals, SteeredCulling, near_intervals
from components.flights.fleet import Fleet
from components.flights.many_flights import SteeredFleet, fleet_of
from components.geometry import TrajectoryState, line_of_sight
from components.messages.known_flights import flat
from components.messages.reach import farthest_look
from components.messages.targets import TrafficStates
from components.traffic.steered_ownship import Coming, arrived_manoeuvres
from dsa_des.arrays.keyed_table import turns
from dsa_des.arrays.run_ticks import RunTicks, next_of_run
from dsa_des.arrays.types import AnyArray, BoolArray, FloatArray, IntArray
from dsa_des.block.wake import ReplicaRuns, Wake


class RowFlights:
    """The flights of all aircraft as each row of a message knows them, for the truth.

    As `components.messages.known_flights.KnownFlights` of `TrueFlights`: `known` says how many
    manoeuvres of its replica's ownship each row knows.
    """

    def __init__(
        self, own: SteeredFleet, targets: Any, width: int, replica: IntArray, known: IntArray
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

    As `components.messages.known_flights.KnownFlights` of a traffic source's flights: targets are
    there while they are near, and positions are those of the last publication where there is a
    rate.
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


class AllFlown(NamedTuple):
    """The flights of all replicas: an ownship each, and the targets of all one after the other."""

    own: Fleet
    targets: Fleet
    roster: Roster


class FlownTogether:
    """Handles the wakes of a traffic source for all replicas."""

    def __init__(self, face: Any, flown: AllFlown, rates_hz: FloatArray | None) -> None:
        self._flown, self._roster = flown, flown.roster
        self._width = len(face.roster)
        self._columns = np.arange(self._width)
        self._own = SteeredFleet(flown.own)
        self._ticks_per_s = face.context.ticks_per_s
        self._says_truth, self._asked_for = face.says_truth, face.flights_asked_for
        self._rates_hz = rates_hz
        self._intervals: NearIntervals | None = None
        self._epochs: SteeredCulling | None = None
        #: Manoeuvres that have come and are not flown by any row yet, with their runs and ticks.
        self._pending: list[Coming] = []
        look = farthest_look(consumer.request for consumer in face.context.consumers)
        culls = not face.context.simulate_everything and face.clock_of(face.p) is None
        self._lasts_s = look.lasts_s
        if culls and math.isfinite(look.range_m):
            if not face.context.producers:
                end_s = float(face.context.duration_s) + look.lasts_s
                self._intervals = self._near_intervals(look.range_m, end_s)
            elif not self._asked_for:
                runs = len(flown.own), self._width
                speeds_mps = flown.targets.max_speeds_mps.reshape(runs)
                self._epochs = SteeredCulling(flown.own.max_speeds_mps, speeds_mps, look.range_m)

    def _near_intervals(self, reach_m: float, end_s: float) -> NearIntervals:
        flown, width = self._flown, max(1, self._width)
        own = np.repeat(np.arange(len(flown.own)), self._width)
        own_s, targets_s = flown.own.intervals_present_s[own], flown.targets.intervals_present_s
        return near_intervals(
            lambda target, time_s: self.range_m(target // width, target, time_s),
            closing_speed_mps=flown.targets.max_speeds_mps + flown.own.max_speeds_mps[own],
            present_s=(
                np.maximum(targets_s[:, 0], own_s[:, 0]), np.minimum(targets_s[:, 1], own_s[:, 1]),
            ),
            reach_m=reach_m,
            end_s=end_s,
            of_run=width,
        )  # fmt: skip

    def range_m(self, ownship: IntArray, target: IntArray, time_s: FloatArray) -> FloatArray:
        """Return the range from ownships to targets (n,), each at a time (n,) of its own."""
        own, other = self._own.each(ownship, time_s), self._flown.targets.each(target, time_s)
        return line_of_sight(
            own.lat_deg, own.lon_deg, own.alt_m, other.lat_deg, other.lon_deg, other.alt_m,
            validate=False,
        )[2]  # fmt: skip

    def run(self, wake: Wake) -> TrafficStates:
        """Return the state of all aircraft of each row's replica."""
        replica, time_s = wake.run, wake.time_s
        known = self._steer(wake, replica)
        shape = len(wake), self._width
        target = replica[:, np.newaxis] * self._width + self._columns
        own = self._own.each(replica, time_s)
        each, times = target.reshape(-1), np.repeat(time_s, self._width)
        states = self._flown.targets.each(each, times).reshaped(shape)
        present = states.present & own.present[:, np.newaxis]
        near: BoolArray | None = None
        if self._intervals is not None:
            near = self._intervals.holds(each, times, times + self._lasts_s).reshape(shape)
        elif self._epochs is not None:
            told_mps = self._own.fastest_by(replica, time_s)
            near = self._epochs.near(replica, time_s, told_mps, self.range_m)
        culled = None
        if near is not None:
            present &= near
            culled = self._width - near.sum(axis=1)
        return TrafficStates.of(
            wake.ticks,
            own,
            states,
            present=present,
            roster=self._roster,
            columns=self._columns,
            culled=culled,
            flights=cast(Any, self._asked(replica, known)),
            true_flights=cast(Any, self._truth(replica, known)),
            run_time_s=time_s if self._says_truth else None,
        )

    def _truth(self, replica: IntArray, known: IntArray) -> RowFlights | None:
        """Return the flights of each row for the table of the truth, if it is recorded."""
        if not self._says_truth:
            return None
        return RowFlights(self._own, self._flown.targets, self._width, replica, known)

    def _asked(self, replica: IntArray, known: IntArray) -> AskedFlights | None:
        """Return the flights as each row knows them, where a block asks for other instants."""
        if not self._asked_for:
            return None
        return AskedFlights(
            self._own, self._flown.targets, self._width, replica, known,
            intervals=self._intervals, rates_hz=self._rates_hz,
        )  # fmt: skip

    def _steer(self, wake: Wake, replica: IntArray) -> IntArray:
        """Let ownships fly what has come; return how many manoeuvres of its own each row knows."""
        self._pending += arrived_manoeuvres(wake)
        known: IntArray = self._own.manoeuvre_count[replica]
        if self._pending:
            now, self._pending = self._due(wake)
            came = _instants(now)
            for one in turns(came.run):  # the first of every ownship, then the next
                ownship, ticks = came.run[one], came.tick[one]
                manoeuvres = [now[number].manoeuvre for number in one.tolist()]
                self._own.steer(ownship, ticks / self._ticks_per_s, manoeuvres)
                if self._epochs is not None:
                    self._epochs.forget(ownship)
                known = known + _later(replica, wake.ticks, ownship, ticks)
        return known

    def _due(self, wake: Wake) -> tuple[list[Coming], list[Coming]]:
        """Part what has come into what rows of this wake fly, and what is for later ones."""
        pending = sorted(self._pending, key=lambda one: (one.run, one.tick))
        came = _instants(pending)
        row = next_of_run(wake.instants, came)  # the first that flies it, if it is of its ownship
        due = (row < len(wake)) & (wake.run[np.minimum(row, len(wake) - 1)] == came.run)
        now = [one for one, is_due in zip(pending, due.tolist(), strict=True) if is_due]
        return now, [one for one, is_due in zip(pending, due.tolist(), strict=True) if not is_due]


def _instants(coming: list[Coming]) -> RunTicks:
    runs, ticks = ([getattr(one, name) for one in coming] for name in ("run", "tick"))
    return RunTicks(np.array(runs, dtype=np.int64), np.array(ticks, dtype=np.int64))


def _later(replica: IntArray, ticks: IntArray, ownship: IntArray, came: IntArray) -> IntArray:
    """Return 1 for the rows of some ownships at or after what came for each of them."""
    order = np.argsort(ownship)
    place = np.minimum(np.searchsorted(ownship[order], replica), len(ownship) - 1)
    mine = order[place]
    return ((ownship[mine] == replica) & (ticks >= came[mine])).astype(np.int64)


def flown_by(face: Any, replicas: ReplicaRuns) -> AllFlown | None:
    """Return the flights of all replicas, or None where they cannot be put together."""
    type(face).prepare(replicas.parameters)
    parameters = getattr(face, "flown_of", None)
    found: AllFlown | None = None if parameters is None else parameters(replicas.parameters)
    return _made_one_by_one(face, replicas) if found is None else found


def _made_one_by_one(face: Any, replicas: ReplicaRuns) -> AllFlown | None:
    own, targets = [], []
    aircraft: list[tuple[str, Aircraft]] = []
    for number in range(len(replicas)):
        source = replicas.make(number)
        own.append(source.own)
        targets += list(source.targets)
        aircraft += zip(source.roster.names, source.roster.aircraft, strict=True)
    roster = joint_roster(face.roster, aircraft)
    return None if roster is None else AllFlown(fleet_of(own), fleet_of(targets), roster)
