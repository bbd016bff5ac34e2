"""Fleets: straight flights by their starts, steered ownships, and flights of any kind."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from math import atan2, cos, inf, isnan, radians
from typing import Any

import numpy as np

from components.flights.fleet import Fleet, in_rows
from components.flights.geodesic_motion import geodesic_parameter_table
from components.flights.leg_motion import KINDS
from components.flights.sampled_flight import SampledFleet, SampledTrajectory
from components.flights.scripted_flights import MOST_ALT_M, ScriptedFleet, ScriptedTrajectory
from components.flights.steered_flight import (
    SteeredFlight,
    SteeredPart,
    flown_from,
    times_around_s,
)
from components.geometry import TrajectoryState, heading_from_deg, wrap_longitude_deg
from components.messages.steering import Manoeuvre
from dsa_des.arrays.types import FloatArray, IntArray


@dataclass(eq=False)
class Starts:
    """Where and how straight flights start, as columns (flights,); units of `ScriptedTrajectory`.

    `fixed_deg` is (3, flights): yaw, pitch and roll, NaN where they follow from the motion.
    """

    names: Sequence[str]
    lat_deg: FloatArray
    lon_deg: FloatArray
    alt_m: FloatArray
    heading_deg: FloatArray
    speed_mps: FloatArray
    climb_mps: FloatArray
    start_time_s: FloatArray
    end_time_s: FloatArray
    fixed_deg: FloatArray

    def flight(self, number: int) -> ScriptedTrajectory:
        """Return one of the flights, made by itself."""
        names = ("lat_deg", "lon_deg", "alt_m", "heading_deg", "speed_mps", "climb_mps")
        columns: dict[str, Any] = {name: float(getattr(self, name)[number]) for name in names}
        yaw, pitch, roll = (None if isnan(a) else a for a in self.fixed_deg[:, number].tolist())
        end_s = float(self.end_time_s[number])
        return ScriptedTrajectory(
            self.names[number], **columns, yaw_deg=yaw, pitch_deg=pitch, roll_deg=roll,
            start_time_s=float(self.start_time_s[number]),
            end_time_s=None if end_s == inf else end_s,
        )  # fmt: skip

    def are_plain(self) -> bool:
        """Return whether all flights move, and have no value that `ScriptedTrajectory` refuses."""
        others = (self.lon_deg, self.heading_deg, self.climb_mps, self.start_time_s)
        return bool(
            np.all(np.isfinite(self.speed_mps) & (self.speed_mps > 0.0))
            and np.all(np.abs(self.lat_deg) <= 90.0)
            and np.all(np.abs(self.alt_m) <= MOST_ALT_M)
            and np.all(self.end_time_s >= self.start_time_s)
            and all(np.isfinite(column).all() for column in others)
            and not np.isinf(self.fixed_deg).any()
        )

    def fleet(self) -> ScriptedFleet:
        """Return the flights, prepared together where that can be."""
        count = len(self.names)
        if not self.are_plain() or not count:
            return ScriptedFleet([self.flight(number) for number in range(count)])
        lon = self.lon_deg
        lon = np.where((lon >= -180.0) & (lon < 180.0), lon, wrap_longitude_deg(lon))
        speeds, climbs = self.speed_mps.tolist(), self.climb_mps.tolist()
        headings = [heading_from_deg(heading) for heading in self.heading_deg.tolist()]
        table = geodesic_parameter_table(self.lat_deg, lon, self.alt_m, headings, speeds, climbs)
        pitches = list(map(atan2, climbs, speeds))
        path_mps = self.speed_mps / np.array(list(map(cos, pitches)))
        yaw, pitch, roll = self.fixed_deg.tolist()
        fixed = [list(map(heading_from_deg, yaw)), *(list(map(radians, a)) for a in (pitch, roll))]
        zero, straight = np.zeros(count), KINDS.index("geodesic")
        return ScriptedFleet.of_columns(
            self.names,
            np.stack((self.start_time_s, self.end_time_s)),
            np.array(fixed),
            np.ones(count, dtype=np.int64),
            np.stack((zero, pitches, zero, path_mps)),
            np.full(count, straight, dtype=np.int64),
            {straight: table},
        )


#: What an ownship flies after each of its manoeuvres, and from when on, s.
Parts = tuple[tuple[float, SteeredPart], ...]


class SteeredFleet(Fleet):
    """Ownships, each with its own flight, and after manoeuvres with what each of them led to."""

    def __init__(self, flights: Fleet, parts: Sequence[Parts] = ()) -> None:
        self._flights = flights
        #: How many parts each of them has.
        self.manoeuvre_count = np.zeros(len(flights), dtype=np.int64)
        self.manoeuvre_count[: len(parts)] = [len(of_one) for of_one in parts]
        self._flown = [flight for of_one in parts for _, flight in of_one]
        self._parts = ScriptedFleet(self._flown)
        #: Of each ownship: when its parts begin, in order, and which they are.
        room = len(flights), int(self.manoeuvre_count.max(initial=0)) + 1
        self._start_s, self._part = np.full(room, np.inf), np.zeros(room, dtype=np.int64)
        there = np.arange(room[1]) < self.manoeuvre_count[:, np.newaxis]
        self._start_s[there] = [start_s for of_one in parts for start_s, _ in of_one]
        self._part[there] = np.arange(len(self._flown))

    def __len__(self) -> int:
        return len(self._flights)

    def __getitem__(self, ownship: int) -> SteeredFlight:  # type: ignore[override]
        count = int(self.manoeuvre_count[ownship])
        starts_s, numbers = self._start_s[ownship, :count], self._part[ownship, :count]
        flown = (self._flown[number] for number in numbers.tolist())
        parts = tuple(zip(starts_s.tolist(), flown, strict=True))
        return SteeredFlight(self._flights[ownship], parts)

    def each(
        self, aircraft: IntArray, time_s: FloatArray, known: IntArray | None = None
    ) -> TrajectoryState:
        """Return the states of ownships (n,), each at a time (n,) of its own, in s.

        `known` says how many of the ownship's manoeuvres count; all by default.
        """
        part = (self._start_s[aircraft] <= time_s[:, np.newaxis]).sum(axis=1)
        if known is not None:
            part = np.minimum(part, known)
        own, after = np.flatnonzero(part == 0), np.flatnonzero(part)
        if not len(after):
            return self._flights.each(aircraft, time_s)
        which = self._part[aircraft[after], part[after] - 1]
        steered = self._parts.each(which, time_s[after])
        return in_rows([own, after], [self._flights.each(aircraft[own], time_s[own]), steered])

    def fastest_by(self, ownship: IntArray, time_s: FloatArray) -> FloatArray:
        """Return the largest speed of any manoeuvre begun by ownships (n,) by times (n,), or 0."""
        if not self._flown:
            return np.zeros(len(ownship))
        speeds = self._parts.max_speeds_mps[self._part[ownship]]
        begun = self._start_s[ownship] <= time_s[:, np.newaxis]
        return np.asarray(np.where(begun, speeds, 0.0).max(axis=1))

    def steer(self, ownship: IntArray, time_s: FloatArray, manoeuvres: Sequence[Manoeuvre]) -> None:
        """Let ownships (each once) fly manoeuvres from times on, none before an earlier one."""
        times_s = times_around_s(time_s)
        around = self.each(np.repeat(ownship, times_s.shape[1]), times_s.reshape(-1))
        around = around.reshaped(times_s.shape)
        before = [
            self._flown[self._part[own, count - 1]] if count else None
            for own, count in zip(ownship, self.manoeuvre_count[ownship], strict=True)
        ]
        new = flown_from("ownship", around, time_s, manoeuvres, before)
        self._parts = ScriptedFleet.joined(self._parts, ScriptedFleet(new))
        if int(self.manoeuvre_count[ownship].max()) + 1 >= self._start_s.shape[1]:
            room = self._start_s.shape
            self._start_s = np.concatenate([self._start_s, np.full(room, np.inf)], axis=1)
            self._part = np.concatenate([self._part, np.zeros(room, dtype=np.int64)], axis=1)
        place = self.manoeuvre_count[ownship]
        self._start_s[ownship, place] = time_s
        self._part[ownship, place] = len(self._flown) + np.arange(len(new))
        self.manoeuvre_count[ownship] += 1
        self._flown += new


class MixedFleet(Fleet):
    """Flights of several kinds; those of a kind that no fleet is made for are asked one by one."""

    def __init__(self, flights: Sequence[Any]) -> None:
        self._flights = list(flights)
        self._ask: list[Callable[[IntArray, FloatArray], TrajectoryState]] = []
        self._part, self._place = np.zeros((2, len(flights)), dtype=np.int64)
        kinds = [type(flight) for flight in flights]
        for kind in dict.fromkeys(kinds):
            numbers = [number for number, one in enumerate(kinds) if one is kind]
            if kind in _FLEETS:
                self._part[numbers] = len(self._ask)
                self._place[numbers] = np.arange(len(numbers))
                self._ask.append(_FLEETS[kind]([flights[number] for number in numbers]).each)
                continue
            self._part[numbers] = len(self._ask) + np.arange(len(numbers))
            self._ask += [partial(_alone, flights[number]) for number in numbers]

    def __len__(self) -> int:
        return len(self._flights)

    def __getitem__(self, place: int) -> Any:  # type: ignore[override]
        return self._flights[place]

    def each(self, aircraft: IntArray, time_s: FloatArray) -> TrajectoryState:
        """Return states of flights (n,), each at a time (n,) of its own, in s."""
        part, place = self._part[aircraft], self._place[aircraft]
        asked = np.flatnonzero(np.bincount(part, minlength=1)).tolist()
        rows = [np.flatnonzero(part == number) for number in asked]
        states = [self._ask[k](place[r], time_s[r]) for k, r in zip(asked, rows, strict=True)]
        return in_rows(rows, states)


def _alone(flight: Any, _: IntArray, time_s: FloatArray) -> TrajectoryState:
    found: TrajectoryState = flight.at(time_s)
    return found


def _steered(flights: Sequence[SteeredFlight]) -> SteeredFleet:
    return SteeredFleet(fleet_of([f.flight for f in flights]), [f.parts for f in flights])


_FLEETS: dict[type, Callable[[Sequence[Any]], Fleet]] = {
    ScriptedTrajectory: ScriptedFleet,
    SampledTrajectory: SampledFleet,
    SteeredFlight: _steered,
}


def fleet_of(flights: Sequence[Any]) -> Fleet:
    """Return flights of any kinds as a fleet."""
    kinds = {type(flight) for flight in flights}
    kind = next(iter(kinds), ScriptedTrajectory)
    return _FLEETS[kind](flights) if len(kinds) < 2 and kind in _FLEETS else MixedFleet(flights)
