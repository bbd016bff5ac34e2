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
    """The flights of one target, chosen by its index in each run, as a fleet of one per run."""

    def __init__(self, targets: Fleet, width: int, index: int) -> None:
        self._targets, self._width, self._index = targets, width, index

    def __len__(self) -> int:
        return len(self._targets) // self._width

    def __getitem__(self, run: int) -> Any:  # type: ignore[override]
        return self._targets[range(len(self))[run] * self._width + self._index]

    def each(self, aircraft: IntArray, time_s: FloatArray) -> TrajectoryState:
        """Return the state of the target in the given runs (n,), each at its own time in s (n,)."""
        return self._targets.each(aircraft * self._width + self._index, time_s)

    def ground_speeds_mps(self, aircraft: IntArray, time_s: FloatArray) -> FloatArray:
        """Return the target's ground speed in runs at given times, m/s; NaN if not scripted."""
        return self._targets.ground_speeds_mps(aircraft * self._width + self._index, time_s)

    def fixed_attitudes_rad(self, aircraft: IntArray, time_s: FloatArray) -> FloatArray:
        """Return fixed yaw, pitch, roll (3, n), rad, of the target by run and time; NaN: free."""
        return self._targets.fixed_attitudes_rad(aircraft * self._width + self._index, time_s)


class OfPlatforms(Fleet):
    """Several platforms' flights as one fleet: all runs of the first, then of the next."""

    def __init__(self, flights: Sequence[Fleet], targets: Fleet, platforms: Sequence[int]) -> None:
        self.own, self._flights, self._runs = flights[0], flights, len(flights[0])
        self._targets, self._width = targets, len(targets) // self._runs
        self._platforms = np.array(platforms)

    def __len__(self) -> int:
        return len(self._flights) * self._runs

    def __getitem__(self, index: int) -> Any:  # type: ignore[override]
        place, run = divmod(range(len(self))[index], self._runs)
        return self._flights[place][run]

    @cached_property
    def max_speeds_mps(self) -> FloatArray:
        """Largest speed of each flight along its path, m/s, shape (flights,)."""
        return np.concatenate([flights.max_speeds_mps for flights in self._flights])

    @cached_property
    def intervals_present_s(self) -> FloatArray:
        """First and last time at which each flight is present, s, shape (flights, 2)."""
        return np.concatenate([flights.intervals_present_s for flights in self._flights])

    def _split_ownships_and_targets(
        self, aircraft: IntArray
    ) -> tuple[IntArray, IntArray, IntArray]:
        """Return positions in the flights of ownships, of targets, and the targets' fleet index."""
        place, run = np.divmod(aircraft, self._runs)
        targets = place.nonzero()[0]
        of = run[targets] * self._width + self._platforms[place[targets]]
        return (place == 0).nonzero()[0], targets, of

    def each(self, aircraft: IntArray, time_s: FloatArray) -> TrajectoryState:
        """Return the state of each given flight (n,) at its own time in s (n,)."""
        own, targets, of = self._split_ownships_and_targets(aircraft)
        if not len(targets):
            return self.own.each(aircraft, time_s)
        others = self._targets.each(of, time_s[targets])
        if not len(own):
            return others
        parts = [self.own.each(aircraft[own], time_s[own]), others]
        return assemble_rows([own, targets], parts)

    def ground_speeds_mps(self, aircraft: IntArray, time_s: FloatArray) -> FloatArray:
        """Return each flight's ground speed at its own time, m/s; NaN if no script states it."""
        own, targets, of = self._split_ownships_and_targets(aircraft)
        speed_mps = np.empty(len(aircraft))
        speed_mps[own] = self.own.ground_speeds_mps(aircraft[own], time_s[own])
        speed_mps[targets] = self._targets.ground_speeds_mps(of, time_s[targets])
        return speed_mps

    def fixed_attitudes_rad(self, aircraft: IntArray, time_s: FloatArray) -> FloatArray:
        """Return the flights' fixed yaw, pitch, roll (3, n), rad, at times; NaN where not fixed."""
        own, targets, of = self._split_ownships_and_targets(aircraft)
        fixed_rad = np.empty((3, len(aircraft)))
        fixed_rad[:, own] = self.own.fixed_attitudes_rad(aircraft[own], time_s[own])
        fixed_rad[:, targets] = self._targets.fixed_attitudes_rad(of, time_s[targets])
        return fixed_rad


class WithOthers(Fleet):
    """The targets of all runs, of which those with some indices are replaced by other flights."""

    def __init__(self, targets: Fleet, width: int, others: Mapping[int, Fleet]) -> None:
        self._targets, self._width, self._others = targets, width, others

    def __len__(self) -> int:
        return len(self._targets)

    def __getitem__(self, index: int) -> Any:  # type: ignore[override]
        run, column = divmod(range(len(self))[index], self._width)
        return self._others[column][run] if column in self._others else self._targets[index]

    @cached_property
    def max_speeds_mps(self) -> FloatArray:
        """Largest speed of each flight along its path, m/s, shape (flights,)."""
        result = self._targets.max_speeds_mps.copy()
        for column, others in self._others.items():
            result[column :: self._width] = others.max_speeds_mps
        return result

    @cached_property
    def intervals_present_s(self) -> FloatArray:
        """First and last time at which each flight is present, s, shape (flights, 2)."""
        result = self._targets.intervals_present_s.copy()
        for column, others in self._others.items():
            result[column :: self._width] = others.intervals_present_s
        return result

    def each(self, aircraft: IntArray, time_s: FloatArray) -> TrajectoryState:
        """Return the state of each given flight (n,) at its own time in s (n,)."""
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
    """The flights of many runs: one ownship per run, and all targets, grouped by run."""

    own: Fleet
    targets: Fleet
    roster: Roster


@dataclass(frozen=True, eq=False)
class FlownFlights:
    """The flights of all runs, including the manoeuvres commanded so far.

    An ownship for each run, and the targets of run 0, those of run 1, and so on. `platforms` are
    those that may be steered or looked from: the ownship (-1) first, and targets by their index.
    They are flown together: `fleet` has the first one's flight of each run, then the next one's.
    For other instants than those of rows, targets are there while the
    `intervals` of who looks say that they may be near, and positions are those of the last
    publication at `rates_hz` (runs,). Nobody sees the targets that are `unseen`.
    """

    fleet: SteeredFleet
    platforms: tuple[int, ...]
    targets: Fleet
    crabbing: Sequence[Any] = ()
    intervals: Mapping[int, NearIntervals] = field(default_factory=dict)
    rates_hz: FloatArray | None = None
    unseen: tuple[int, ...] = ()
    _made: dict[str, tuple[Any, Any]] = field(default_factory=dict, init=False)

    @classmethod
    def of(cls, own: Fleet, targets: Fleet, platforms: Sequence[int]) -> FlownFlights:
        """Return all runs' flights, unsteered; `platforms` index targets steered or viewed from."""
        width = len(targets) // len(own)
        others = sorted({index for index in platforms if index >= 0})
        flights = [own, *(OfEachRun(targets, width, index) for index in others)]
        every = -1, *others
        fleet = SteeredFleet(OfPlatforms(flights, targets, every) if others else own)
        return cls(fleet, every, targets)

    @property
    def runs(self) -> int:
        """Number of runs."""
        return len(self.fleet) // len(self.platforms)

    @property
    def targets_per_run(self) -> int:
        """Number of targets in each run."""
        return len(self.targets) // self.runs

    @cached_property
    def platform_index_of_targets(self) -> IntArray:
        """Each target's index among the platforms in a run; 0 if the target is no platform."""
        places = np.zeros(self.targets_per_run, dtype=np.int64)
        places[list(self.platforms[1:])] = np.arange(1, len(self.platforms))
        return places

    def flights_of_platform(self, platform: int) -> SteeredFleet:
        """Return the flights of a platform including manoeuvres, one for each run."""
        if len(self.platforms) == 1:
            return self.fleet
        begin = self.platforms.index(platform) * self.runs
        return self.fleet.part(slice(begin, begin + self.runs), self.nominal_flights(platform))

    def nominal_flights(self, platform: int) -> Fleet:
        """Return the flights of a platform as scripted, without manoeuvres, one for each run."""
        if platform >= 0:
            return OfEachRun(self.targets, self.targets_per_run, platform)
        flights = self.fleet.nominal
        return flights.own if isinstance(flights, OfPlatforms) else flights

    @property
    def traffic(self) -> object:
        """The target fleet: one object for all flights of a traffic block, and so its identity."""
        return self.targets

    @property
    def manoeuvre_count(self) -> int:
        """Return the number of manoeuvres so far, in all runs."""
        return int(self.fleet.manoeuvre_count.sum())

    @cached_property
    def steered_targets(self) -> tuple[int, ...]:
        """Indices of the targets that have been given a manoeuvre in any run."""
        count = self.fleet.manoeuvre_count.reshape(len(self.platforms), -1).sum(axis=1)
        of_each = zip(self.platforms, count.tolist(), strict=True)
        return tuple(index for index, many in of_each if index >= 0 and many)

    def viewer_and_target_fleets(self, viewer: int) -> tuple[Fleet, Fleet]:
        """Return a viewer's flights and all targets', ownship in its place, without manoeuvres."""
        if viewer < 0:
            return self.nominal_flights(viewer), self.targets
        others = {viewer: self.nominal_flights(-1)}
        return self.nominal_flights(viewer), WithOthers(self.targets, self.targets_per_run, others)

    def flown_target_flights(self) -> Fleet:
        """Return the flights of all targets including the manoeuvres commanded so far."""
        steered = {index: self.flights_of_platform(index) for index in self.steered_targets}
        return WithOthers(self.targets, self.targets_per_run, steered) if steered else self.targets

    def platform_states_at(
        self,
        platform: int,
        run: IntArray,
        time_s: FloatArray,
        known: IntArray | None = None,
        state: TrajectoryState | None = None,
    ) -> TrajectoryState:
        """Return the states of a platform in the given runs (n,), each at its own time, flown with
        its first `known` manoeuvres or all; `state` gives them without wind if already computed.
        """
        place = self.platforms.index(platform)
        return self._flown_states_at(
            run + place * self.runs if place else run, time_s, known, state
        )

    def _flown_states_at(
        self,
        number: IntArray,
        time_s: FloatArray,
        known: IntArray | None,
        state: TrajectoryState | None = None,
    ) -> TrajectoryState:
        """Return the states of flights by index in the steered fleet, each at its own time."""
        fleet = self.fleet
        state = fleet.each(number, time_s, known) if state is None else state
        for crabbing in self.crabbing:
            speed_mps = fleet.ground_speeds_mps(number, time_s, known)
            state = crabbing(state, speed_mps, fleet.fixed_attitudes_rad(number, time_s, known))
        return state

    def target_states_at(
        self,
        target: IntArray,
        time_s: FloatArray,
        state: TrajectoryState | None = None,
        known: IntArray | None = None,
    ) -> TrajectoryState:
        """Return the states of targets (n,), each at its own time, with manoeuvres and wind;
        `state` gives them without both if already computed. Of manoeuvres the first `known` (n,
        platforms) count, or all.
        """
        if not self.steered_targets:
            return self._scripted_states(target, time_s, state)
        run, column = np.divmod(target, self.targets_per_run)
        place = self.platform_index_of_targets[column]
        mine, left = place.nonzero()[0], (place == 0).nonzero()[0]
        place = place[mine]
        counts = None if known is None else known[mine, place]
        flown = self._flown_states_at(place * self.runs + run[mine], time_s[mine], counts)
        if not len(left):
            return flown
        known_of = None if state is None else state.taken(left)
        others = self._scripted_states(target[left], time_s[left], known_of)
        return assemble_rows([left, mine], [others, flown])

    def _scripted_states(
        self, target: IntArray, time_s: FloatArray, state: TrajectoryState | None
    ) -> TrajectoryState:
        """Return the states of targets as scripted, without manoeuvres but turned into the wind."""
        state = self.targets.each(target, time_s) if state is None else state
        for crabbing in self.crabbing:
            speed_mps = self.targets.ground_speeds_mps(target, time_s)
            state = crabbing(state, speed_mps, self.targets.fixed_attitudes_rad(target, time_s))
        return state

    def compute_if_arrays_changed(
        self, name: str, of: Sequence[AnyArray], make: Callable[[], Any]
    ) -> Any:
        """Return a name's stored value if arrays are equal, else call `make` and store instead.

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
        """Return the viewing platform's states and its targets', at given times of runs."""
        time_s = self._last_publication_s(run, time_s) + ahead_s
        shape = np.broadcast_shapes(time_s.shape, run.shape, columns.shape)
        target, times, runs = (
            np.broadcast_to(of, shape).reshape(-1)
            for of in (run * self.targets_per_run + columns, time_s, run)
        )
        counts = None
        if self.steered_targets:
            counts = np.broadcast_to(known, (*shape, known.shape[-1])).reshape(len(times), -1)
        key = target, times, known
        others = self.compute_if_arrays_changed(
            "targets", key, lambda: self.target_states_at(target, times, known=counts)
        )
        mine = np.flatnonzero(np.broadcast_to(columns, shape).reshape(-1) == viewer)
        if len(mine) != time_s.size or viewer < 0:
            looking = self._viewer_state(viewer, run, known, time_s)
        else:
            looking = others.taken(mine).reshape(time_s.shape)
        if len(mine):  # the two have changed places
            counts = np.broadcast_to(known[..., 0], shape).reshape(-1)[mine]
            key = runs[mine], times[mine], counts
            own = self.compute_if_arrays_changed(
                "own", key, lambda: self.platform_states_at(-1, *key)
            )
            values = [part.copy() for part in others.arrays()]
            for part, new in zip(values, own.arrays(), strict=True):
                part[mine] = new
            others = TrajectoryState(*values)
        if self.unseen:
            hidden = np.isin(np.broadcast_to(columns, shape).reshape(-1), self.unseen)
            hidden &= np.broadcast_to(columns, shape).reshape(-1) != viewer
            others = replace(others, present=others.present & ~hidden)
        if viewer in self.intervals:
            near = self.intervals[viewer].may_be_near_throughout(target, times, times)
            others = replace(others, present=others.present & near)
        return looking, others.reshape(shape)

    def viewer_states(
        self, run: IntArray, known: IntArray, time_s: FloatArray, viewer: int
    ) -> TrajectoryState:
        """Return the states of the viewing platform alone, at given times of given runs."""
        return self._viewer_state(viewer, run, known, self._last_publication_s(run, time_s))

    def _viewer_state(
        self, viewer: int, run: IntArray, known: IntArray, time_s: FloatArray
    ) -> TrajectoryState:
        mine = known[..., self.platforms.index(viewer)]
        runs, counts = (np.broadcast_to(of, time_s.shape).reshape(-1) for of in (run, mine))
        state = self.platform_states_at(viewer, runs, time_s.reshape(-1), counts)
        return state.reshape(time_s.shape)

    def _last_publication_s(self, run: IntArray, time_s: FloatArray) -> FloatArray:
        """Return, for each run and time, the time of the last publication of the traffic, s."""
        if self.rates_hz is None:
            return time_s
        rate = self.rates_hz[run]
        published: FloatArray = np.floor(time_s * rate) / rate
        return published
