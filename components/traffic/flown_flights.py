"""The flights of all runs of a traffic source as they are known, with manoeuvres commanded so far.

What each row holds is what a run alone would give, to the bit; a single run is run 0.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from components.aircraft.aircraft import Roster
from components.flights.culling import NearIntervals
from components.flights.fleet import Fleet, assemble_rows
from components.flights.many_flights import SteeredFleet
from components.geometry import TrajectoryState
from dsa_des.arrays.types import AnyArray, BoolArray, FloatArray, IntArray


class OfEachRun(Fleet):
    """One of the targets of each run, by its index, as a fleet of one for each run."""

    def __init__(self, targets: Fleet, width: int, index: int) -> None:
        self._targets, self._width, self._index = targets, width, index

    def __len__(self) -> int:
        return len(self._targets) // self._width

    def __getitem__(self, run: int) -> Any:  # type: ignore[override]
        return self._targets[range(len(self))[run] * self._width + self._index]

    def each(self, aircraft: IntArray, time_s: FloatArray) -> TrajectoryState:
        """Return states (n,) in some runs, each at a time (n,) of its own, in s."""
        return self._targets.each(aircraft * self._width + self._index, time_s)

    def ground_speeds_mps(self, aircraft: IntArray, time_s: FloatArray) -> FloatArray:
        """Return speeds over ground, asked for as in `each`; NaN where no script says them."""
        return self._targets.ground_speeds_mps(aircraft * self._width + self._index, time_s)

    def fixed_attitudes_rad(self, aircraft: IntArray, time_s: FloatArray) -> FloatArray:
        """Return fixed yaw, pitch and roll (3, n), asked for as in `each`; NaN where not fixed."""
        return self._targets.fixed_attitudes_rad(aircraft * self._width + self._index, time_s)


class WithOthers(Fleet):
    """Targets of which some fly otherwise: by index in a run, a fleet of one for each run."""

    def __init__(self, targets: Fleet, width: int, others: Mapping[int, Fleet]) -> None:
        self._targets, self._width, self._others = targets, width, others

    def __len__(self) -> int:
        return len(self._targets)

    def __getitem__(self, index: int) -> Any:  # type: ignore[override]
        run, column = divmod(range(len(self))[index], self._width)
        return self._others[column][run] if column in self._others else self._targets[index]

    @cached_property
    def max_speeds_mps(self) -> FloatArray:
        """Largest speed of each along its path, shape (flights,)."""
        result = self._targets.max_speeds_mps.copy()
        for column, others in self._others.items():
            result[column :: self._width] = others.max_speeds_mps
        return result

    @cached_property
    def intervals_present_s(self) -> FloatArray:
        """First and last time at which each is there, shape (flights, 2)."""
        result = self._targets.intervals_present_s.copy()
        for column, others in self._others.items():
            result[column :: self._width] = others.intervals_present_s
        return result

    def each(self, aircraft: IntArray, time_s: FloatArray) -> TrajectoryState:
        """Return states of flights (n,), each at a time (n,) of its own, in s."""
        run, column = np.divmod(aircraft, self._width)
        left: BoolArray = np.ones(len(aircraft), dtype=bool)
        rows, states = [], []
        for index, others in self._others.items():
            mine = np.flatnonzero(column == index)
            left[mine] = False
            rows.append(mine)
            states.append(others.each(run[mine], time_s[mine]))
        rows.append(np.flatnonzero(left))
        states.append(self._targets.each(aircraft[left], time_s[left]))
        return assemble_rows(rows, states)


class FlightsOfRuns(NamedTuple):
    """The flights of all runs: an ownship each, and the targets of all one after the other."""

    own: Fleet
    targets: Fleet
    roster: Roster


@dataclass(frozen=True, eq=False)
class FlownFlights:
    """The flights of all runs with the manoeuvres that came so far; see `messages.known_flights`.

    An ownship for each run, and the targets of run 0, those of run 1, and so on. `platforms` are
    those that may be steered or looked from: the ownship (-1) first, and targets by their index,
    one flight for each run. For other instants than those of rows, targets are there while the
    `intervals` of who looks say that they may be near, and positions are those of the last
    publication at `rates_hz` (runs,). Nobody sees the targets that are `unseen`.
    """

    platforms: Mapping[int, SteeredFleet]
    targets: Fleet
    crabbing: Sequence[Any] = ()
    intervals: Mapping[int, NearIntervals] = field(default_factory=dict)
    rates_hz: FloatArray | None = None
    unseen: tuple[int, ...] = ()
    _made: dict[str, tuple[Any, Any]] = field(default_factory=dict, init=False)

    @classmethod
    def of(cls, own: Fleet, targets: Fleet, platforms: Sequence[int]) -> FlownFlights:
        """Return the flights of all runs, with the ownship and targets by index as platforms."""
        width = len(targets) // len(own)
        others = sorted({index for index in platforms if index >= 0})
        fleets = {index: SteeredFleet(OfEachRun(targets, width, index)) for index in others}
        return cls({-1: SteeredFleet(own), **fleets}, targets)

    @property
    def own(self) -> SteeredFleet:
        """The ownships."""
        return self.platforms[-1]

    @property
    def width(self) -> int:
        """Return the number of targets of a run."""
        return len(self.targets) // len(self.own)

    @property
    def traffic(self) -> object:
        """The same for all flights of one traffic: its targets."""
        return self.targets

    @property
    def manoeuvre_count(self) -> int:
        """Return the number of manoeuvres so far, in all runs."""
        return sum(int(fleet.manoeuvre_count.sum()) for fleet in self.platforms.values())

    @property
    def steered_targets(self) -> dict[int, SteeredFleet]:
        """The targets that have got manoeuvres in any run, by their index."""
        return {
            index: fleet
            for index, fleet in self.platforms.items()
            if index >= 0 and fleet.manoeuvre_count.any()
        }

    def seen_from(self, viewer: int) -> tuple[Fleet, Fleet]:
        """Return the viewing platform's flight and its targets' flights, without manoeuvres."""
        own = self.platforms[viewer].nominal
        if viewer < 0:
            return own, self.targets
        return own, WithOthers(self.targets, self.width, {viewer: self.own.nominal})

    def as_flown(self) -> Fleet:
        """Return the flights of the targets with all manoeuvres."""
        steer = self.steered_targets
        return WithOthers(self.targets, self.width, steer) if steer else self.targets

    def platform_at(
        self,
        platform: int,
        run: IntArray,
        time_s: FloatArray,
        known: IntArray | None = None,
        state: TrajectoryState | None = None,
    ) -> TrajectoryState:
        """Return the states of a platform in runs (n,), each at a time (n,) of its own, by the
        first `known` of its manoeuvres, or all; `state` is what is known of them but for the wind.
        """
        fleet = self.platforms[platform]
        state = fleet.each(run, time_s, known) if state is None else state
        for crabbing in self.crabbing:
            speed_mps = fleet.ground_speeds_mps(run, time_s, known)
            state = crabbing(state, speed_mps, fleet.fixed_attitudes_rad(run, time_s, known))
        return state

    def targets_at(
        self,
        target: IntArray,
        time_s: FloatArray,
        state: TrajectoryState | None = None,
        known: IntArray | None = None,
    ) -> TrajectoryState:
        """Return the states of targets (n,), each at a time (n,) of its own; `state` is what is
        known of them but for manoeuvres and the wind. Of manoeuvres the first `known` (n,
        platforms) count, or all.
        """
        if not (steered := self.steered_targets):
            return self._as_scripted(target, time_s, state)
        run, column = np.divmod(target, self.width)
        left = np.flatnonzero(~np.isin(column, list(steered)))
        known_of = None if state is None else state.taken(left)
        rows, states = [left], [self._as_scripted(target[left], time_s[left], known_of)]
        for place, index in enumerate(self.platforms):
            if index in steered and len(mine := np.flatnonzero(column == index)):
                counts = None if known is None else known[mine, place]
                rows.append(mine)
                states.append(self.platform_at(index, run[mine], time_s[mine], counts))
        return assemble_rows(rows, states)

    def _as_scripted(
        self, target: IntArray, time_s: FloatArray, state: TrajectoryState | None
    ) -> TrajectoryState:
        """Return the states of targets without their manoeuvres, as in `targets_at`."""
        state = self.targets.each(target, time_s) if state is None else state
        for crabbing in self.crabbing:
            speed_mps = self.targets.ground_speeds_mps(target, time_s)
            state = crabbing(state, speed_mps, self.targets.fixed_attitudes_rad(target, time_s))
        return state

    def once(self, name: str, of: Sequence[AnyArray], make: Callable[[], Any]) -> Any:
        """Return what was made under a name of equal arrays, or make it; the last one is kept.

        Those who look from several platforms ask for the same of all aircraft.
        """
        known = self._made.get(name)
        if known is None or not all(map(np.array_equal, known[0], of)):
            known = self._made[name] = of, make()
        return known[1]

    def states(
        self,
        run: IntArray,
        known: IntArray,
        columns: IntArray,
        time_s: FloatArray,
        ahead_s: FloatArray | float,
        viewer: int,
    ) -> tuple[TrajectoryState, TrajectoryState]:
        """Return states of who looks and of targets; see `messages.known_flights.AllFlights`."""
        time_s = self._published_s(run, time_s) + ahead_s
        shape = np.broadcast_shapes(time_s.shape, run.shape, columns.shape)
        target, times, runs = (
            np.broadcast_to(of, shape).reshape(-1)
            for of in (run * self.width + columns, time_s, run)
        )
        counts = None
        if self.steered_targets:
            counts = np.broadcast_to(known, (*shape, known.shape[-1])).reshape(len(times), -1)
        key = target, times, known
        others = self.once("targets", key, lambda: self.targets_at(target, times, known=counts))
        mine = np.flatnonzero(np.broadcast_to(columns, shape).reshape(-1) == viewer)
        if len(mine) != time_s.size or viewer < 0:
            looking = self._looking(viewer, run, known, time_s)
        else:
            looking = others.taken(mine).reshape(time_s.shape)
        if len(mine):  # the two have changed places
            counts = np.broadcast_to(known[..., 0], shape).reshape(-1)[mine]
            key = runs[mine], times[mine], counts
            own = self.once("own", key, lambda: self.platform_at(-1, *key))
            values = [part.copy() for part in others.arrays()]
            for part, new in zip(values, own.arrays(), strict=True):
                part[mine] = new
            others = TrajectoryState(*values)
        if self.unseen:
            hidden = np.isin(np.broadcast_to(columns, shape).reshape(-1), self.unseen)
            hidden &= np.broadcast_to(columns, shape).reshape(-1) != viewer
            others = replace(others, present=others.present & ~hidden)
        if viewer in self.intervals:
            near = self.intervals[viewer].holds(target, times, times)
            others = replace(others, present=others.present & near)
        return looking, others.reshape(shape)

    def own_states(
        self, run: IntArray, known: IntArray, time_s: FloatArray, viewer: int
    ) -> TrajectoryState:
        """Return states of who looks; see `messages.known_flights.AllFlights`."""
        return self._looking(viewer, run, known, self._published_s(run, time_s))

    def _looking(
        self, viewer: int, run: IntArray, known: IntArray, time_s: FloatArray
    ) -> TrajectoryState:
        mine = known[..., list(self.platforms).index(viewer)]
        runs, counts = (np.broadcast_to(of, time_s.shape).reshape(-1) for of in (run, mine))
        state = self.platform_at(viewer, runs, time_s.reshape(-1), counts)
        return state.reshape(time_s.shape)

    def _published_s(self, run: IntArray, time_s: FloatArray) -> FloatArray:
        """Return the times of the last publications."""
        if self.rates_hz is None:
            return time_s
        rate = self.rates_hz[run]
        published: FloatArray = np.floor(time_s * rate) / rate
        return published
