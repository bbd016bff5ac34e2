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


class OfPlatforms(Fleet):
    """The flights of platforms, a flight of the first in each run, then those of the next one."""

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
        """Largest speed of each along its path, shape (flights,)."""
        return np.concatenate([flights.max_speeds_mps for flights in self._flights])

    @cached_property
    def intervals_present_s(self) -> FloatArray:
        """First and last time at which each is there, shape (flights, 2)."""
        return np.concatenate([flights.intervals_present_s for flights in self._flights])

    def _split(self, aircraft: IntArray) -> tuple[IntArray, IntArray, IntArray]:
        """Return which are ownships, which targets, and which of the targets these are."""
        place, run = np.divmod(aircraft, self._runs)
        targets = place.nonzero()[0]
        of = run[targets] * self._width + self._platforms[place[targets]]
        return (place == 0).nonzero()[0], targets, of

    def each(self, aircraft: IntArray, time_s: FloatArray) -> TrajectoryState:
        """Return states of flights (n,), each at a time (n,) of its own, in s."""
        own, targets, of = self._split(aircraft)
        if not len(targets):
            return self.own.each(aircraft, time_s)
        others = self._targets.each(of, time_s[targets])
        if not len(own):
            return others
        parts = [self.own.each(aircraft[own], time_s[own]), others]
        return assemble_rows([own, targets], parts)

    def ground_speeds_mps(self, aircraft: IntArray, time_s: FloatArray) -> FloatArray:
        """Return speeds over ground, asked for as in `each`; NaN where no script says them."""
        own, targets, of = self._split(aircraft)
        speed_mps = np.empty(len(aircraft))
        speed_mps[own] = self.own.ground_speeds_mps(aircraft[own], time_s[own])
        speed_mps[targets] = self._targets.ground_speeds_mps(of, time_s[targets])
        return speed_mps

    def fixed_attitudes_rad(self, aircraft: IntArray, time_s: FloatArray) -> FloatArray:
        """Return fixed yaw, pitch and roll (3, n), asked for as in `each`; NaN where not fixed."""
        own, targets, of = self._split(aircraft)
        fixed_rad = np.empty((3, len(aircraft)))
        fixed_rad[:, own] = self.own.fixed_attitudes_rad(aircraft[own], time_s[own])
        fixed_rad[:, targets] = self._targets.fixed_attitudes_rad(of, time_s[targets])
        return fixed_rad


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
        """Return the flights of all runs, with the ownship and targets by index as platforms."""
        width = len(targets) // len(own)
        others = sorted({index for index in platforms if index >= 0})
        flights = [own, *(OfEachRun(targets, width, index) for index in others)]
        every = -1, *others
        fleet = SteeredFleet(OfPlatforms(flights, targets, every) if others else own)
        return cls(fleet, every, targets)

    @property
    def runs(self) -> int:
        """How many runs there are."""
        return len(self.fleet) // len(self.platforms)

    @property
    def width(self) -> int:
        """Return the number of targets of a run."""
        return len(self.targets) // self.runs

    @cached_property
    def place_of_target(self) -> IntArray:
        """Return the index among platforms of each target of a run, 0 for no platform."""
        places = np.zeros(self.width, dtype=np.int64)
        places[list(self.platforms[1:])] = np.arange(1, len(self.platforms))
        return places

    def of_platform(self, platform: int) -> SteeredFleet:
        """Return a platform's flights, one for each run."""
        if len(self.platforms) == 1:
            return self.fleet
        begin = self.platforms.index(platform) * self.runs
        return self.fleet.part(slice(begin, begin + self.runs), self.nominal(platform))

    def nominal(self, platform: int) -> Fleet:
        """Return a platform's flights without manoeuvres, one for each run."""
        if platform >= 0:
            return OfEachRun(self.targets, self.width, platform)
        flights = self.fleet.nominal
        return flights.own if isinstance(flights, OfPlatforms) else flights

    @property
    def traffic(self) -> object:
        """The same for all flights of one traffic: its targets."""
        return self.targets

    @property
    def manoeuvre_count(self) -> int:
        """Return the number of manoeuvres so far, in all runs."""
        return int(self.fleet.manoeuvre_count.sum())

    @cached_property
    def steered_targets(self) -> tuple[int, ...]:
        """The targets that have got manoeuvres in any run, by their index."""
        count = self.fleet.manoeuvre_count.reshape(len(self.platforms), -1).sum(axis=1)
        of_each = zip(self.platforms, count.tolist(), strict=True)
        return tuple(index for index, many in of_each if index >= 0 and many)

    def seen_from(self, viewer: int) -> tuple[Fleet, Fleet]:
        """Return the viewing platform's flight and its targets' flights, without manoeuvres."""
        if viewer < 0:
            return self.nominal(viewer), self.targets
        others = {viewer: self.nominal(-1)}
        return self.nominal(viewer), WithOthers(self.targets, self.width, others)

    def flown_target_flights(self) -> Fleet:
        """Return the flights of the targets with all manoeuvres."""
        steered = {index: self.of_platform(index) for index in self.steered_targets}
        return WithOthers(self.targets, self.width, steered) if steered else self.targets

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
        place = self.platforms.index(platform)
        return self._flown_at(run + place * self.runs if place else run, time_s, known, state)

    def _flown_at(
        self,
        number: IntArray,
        time_s: FloatArray,
        known: IntArray | None,
        state: TrajectoryState | None = None,
    ) -> TrajectoryState:
        """Return the states of flights of the fleet, as in `platform_at`."""
        fleet = self.fleet
        state = fleet.each(number, time_s, known) if state is None else state
        for crabbing in self.crabbing:
            speed_mps = fleet.ground_speeds_mps(number, time_s, known)
            state = crabbing(state, speed_mps, fleet.fixed_attitudes_rad(number, time_s, known))
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
        if not self.steered_targets:
            return self._scripted_states(target, time_s, state)
        run, column = np.divmod(target, self.width)
        place = self.place_of_target[column]
        mine, left = place.nonzero()[0], (place == 0).nonzero()[0]
        place = place[mine]
        counts = None if known is None else known[mine, place]
        flown = self._flown_at(place * self.runs + run[mine], time_s[mine], counts)
        if not len(left):
            return flown
        known_of = None if state is None else state.taken(left)
        others = self._scripted_states(target[left], time_s[left], known_of)
        return assemble_rows([left, mine], [others, flown])

    def _scripted_states(
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
            looking = self._viewer_state(viewer, run, known, time_s)
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
        return self._viewer_state(viewer, run, known, self._published_s(run, time_s))

    def _viewer_state(
        self, viewer: int, run: IntArray, known: IntArray, time_s: FloatArray
    ) -> TrajectoryState:
        mine = known[..., self.platforms.index(viewer)]
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
