"""Fleets: straight flights by their starts, steered ownships, and flights of any kind."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import copy
from functools import cached_property
from math import atan2, cos, inf, isnan, radians
from typing import Any

import numpy as np

from components.flights.fleet import Fleet, MixedFleet, Trajectory, assemble_rows
from components.flights.geodesic_motion import geodesic_parameters
from components.flights.leg_motion import KINDS, RAMP_ROWS, Ramps, ramp_parameters
from components.flights.sampled_flight import SampledFleet, SampledTrajectory
from components.flights.scripted_flights import MOST_ALT_M, ScriptedFleet, ScriptedTrajectory
from components.flights.steering_plan import (
    SteeredPart,
    displacements_around,
    steered_parts,
    times_around_s,
)
from components.geometry import TrajectoryState, heading_rad_from_deg, wrap_longitude_deg
from components.messages.steering import Manoeuvre
from dsa_des.arrays.growing_arrays import Growing
from dsa_des.arrays.types import FloatArray, IntArray


def straight_fleet(
    names: Sequence[str],
    *,
    lat_deg: FloatArray,
    lon_deg: FloatArray,
    alt_m: FloatArray,
    heading_deg: FloatArray,
    speed_mps: FloatArray,
    climb_mps: FloatArray,
    start_time_s: FloatArray,
    end_time_s: FloatArray,
    fixed_deg: FloatArray,
) -> ScriptedFleet:
    """Return a fleet of straight flights, one for each entry of the columns (flights,).

    Units are those of `ScriptedTrajectory`, which says what is wrong with one; `fixed_deg`
    (3, flights) is yaw, pitch and roll, NaN where they follow from the motion.
    """
    others = (lon_deg, heading_deg, climb_mps, start_time_s)
    are_plain = bool(
        np.all(np.isfinite(speed_mps) & (speed_mps > 0.0))
        and np.all(np.abs(lat_deg) <= 90.0)
        and np.all(np.abs(alt_m) <= MOST_ALT_M)
        and np.all(end_time_s >= start_time_s)
        and all(np.isfinite(column).all() for column in others)
        and not np.isinf(fixed_deg).any()
    )
    if not are_plain or not len(names):
        given = {
            "lat_deg": lat_deg, "lon_deg": lon_deg, "alt_m": alt_m, "heading_deg": heading_deg,
            "speed_mps": speed_mps, "climb_mps": climb_mps, "start_time_s": start_time_s,
        }  # fmt: skip
        ends_s = np.where(end_time_s == inf, np.nan, end_time_s)
        yaw, pitch, roll = fixed_deg
        free = {"end_time_s": ends_s, "yaw_deg": yaw, "pitch_deg": pitch, "roll_deg": roll}
        flights = []
        for number, name in enumerate(names):
            one: dict[str, Any] = {key: float(of[number]) for key, of in given.items()}
            one |= {key: float(of[number]) for key, of in free.items() if not isnan(of[number])}
            flights.append(ScriptedTrajectory(name, **one))
        return ScriptedFleet(flights)
    lon = np.where((lon_deg >= -180.0) & (lon_deg < 180.0), lon_deg, wrap_longitude_deg(lon_deg))
    headings = np.array([heading_rad_from_deg(heading) for heading in heading_deg.tolist()])
    table = geodesic_parameters(lat_deg, lon, alt_m, headings, speed_mps, climb_mps)
    pitches = list(map(atan2, climb_mps.tolist(), speed_mps.tolist()))
    path_mps = speed_mps / np.array(list(map(cos, pitches)))
    yaw, pitch, roll = fixed_deg.tolist()
    fixed = [list(map(heading_rad_from_deg, yaw)), *(list(map(radians, a)) for a in (pitch, roll))]
    zero, straight = np.zeros(len(names)), KINDS.index("geodesic")
    return ScriptedFleet.of_columns_unchecked(
        names,
        np.stack((start_time_s, end_time_s)),
        np.array(fixed),
        np.ones(len(names), dtype=np.int64),
        np.stack((zero, pitches, zero, path_mps)),
        np.full(len(names), straight, dtype=np.int64),
        {straight: table},
    )


#: What an ownship flies after each of its manoeuvres, and from when on, s.
Parts = tuple[tuple[float, ScriptedTrajectory], ...]


class SteeredFleet(Growing, Fleet):
    """The ownships of several runs: each one's own flight, and what it flies after manoeuvres.

    A manoeuvre replaces only its own part: a climb lets a turn in progress go on, and a turn a
    climb. The flight's own script ends with the first one. A fleet never changes:
    `add_manoeuvres` gives another one, so that a run can go back, and rows of a message keep those
    that they know.
    """

    def __init__(self, flights: Fleet, parts: Sequence[Parts] = ()) -> None:
        self._flights = flights
        #: The only flight, which answers faster by itself.
        self._alone = flights[0] if len(flights) == 1 else None
        #: How many parts each of them has.
        self.manoeuvre_count = np.zeros(len(flights), dtype=np.int64)
        self.manoeuvre_count[: len(parts)] = [len(of_one) for of_one in parts]
        flown = [flight for of_one in parts for _, flight in of_one]
        self._parts = ScriptedFleet(flown)
        #: Parts that velocities led to, of whom the parts above are none.
        self._ramps = Ramps(np.empty(0), np.empty((RAMP_ROWS, 0)), np.empty(0))
        #: Each part of a script with its plan; None of those without.
        self._flown = np.array(
            [one if isinstance(one, SteeredPart) else None for one in flown], dtype=object
        )
        #: Of each ownship: when its parts begin, in order, and which they are: ~k is ramp k. Fleets
        #: that came of this one write theirs behind; how many have, which of them this one is.
        self._written, self._version = [0], 0
        room = len(flights), int(self.manoeuvre_count.max(initial=0)) + 1
        self._start_s, self._part = np.full(room, np.inf), np.zeros(room, dtype=np.int64)
        there = np.arange(room[1]) < self.manoeuvre_count[:, np.newaxis]
        self._start_s[there] = [start_s for of_one in parts for start_s, _ in of_one]
        self._part[there] = np.arange(len(self._flown))

    @property
    def nominal(self) -> Fleet:
        """The ownships' flights as they would be without any manoeuvre."""
        return self._flights

    def __len__(self) -> int:
        return len(self._flights)

    def __getitem__(self, ownship: int) -> SteeredFlight:  # type: ignore[override]
        return SteeredFlight(self._flights[ownship], self, ownship)

    def parts_of(self, ownship: int) -> Parts:
        """Return an ownship's parts after its manoeuvres, each with the time (s) of its start."""
        count = int(self.manoeuvre_count[ownship])
        starts_s, numbers = self._start_s[ownship, :count], self._part[ownship, :count]
        return tuple(zip(starts_s.tolist(), map(self._flight_of, numbers.tolist()), strict=True))

    def _flight_of(self, part: int) -> ScriptedTrajectory:
        if part < 0:
            ramp, start_s = self._ramps.segment(~part)
            return ScriptedTrajectory.of_segments_unchecked(
                "ownship", [ramp], (None,) * 3, start_s, inf
            )
        flown: ScriptedTrajectory = self._flown[part] or self._parts[part]
        return flown

    def subset(self, columns: IntArray) -> SteeredFleet:
        """Return a fleet of the flights at some indices, sharing all parts computed already."""
        if np.array_equal(columns, np.arange(len(self))):
            return self
        flights = self._flights
        if isinstance(flights, ScriptedFleet):
            some = SteeredFleet(flights.subset(columns))
        else:
            some = SteeredFleet(fleet_of([flights[number] for number in columns.tolist()]))
        some._parts, some._flown, some._ramps = self._parts, self._flown, self._ramps
        for name in ("manoeuvre_count", "_start_s", "_part"):
            setattr(some, name, getattr(self, name)[columns])
        return some

    def part(self, flights: slice, nominal: Fleet) -> SteeredFleet:
        """Return a fleet of a slice of the flights; ``nominal`` are these without manoeuvres."""
        some = copy(self)
        some.__dict__.pop("max_speeds_mps", None)
        some._flights, some._alone, some._written = nominal, None, [-1]
        for name in ("manoeuvre_count", "_start_s", "_part"):
            setattr(some, name, getattr(self, name)[flights])
        return some

    def each(
        self, aircraft: IntArray, time_s: FloatArray, known: IntArray | None = None
    ) -> TrajectoryState:
        """Return ownships' states (n,) at own times (s), with first ``known`` manoeuvres or all."""
        own, after, which = self._rows_before_after_and_part(aircraft, time_s, known)
        if not len(after):
            return self._states_before_steering(aircraft, time_s)
        steered = self._states_of_parts(which, time_s[after])
        if not len(own):
            return steered
        return assemble_rows(
            [own, after], [self._states_before_steering(aircraft[own], time_s[own]), steered]
        )

    def _states_of_parts(self, which: IntArray, time_s: FloatArray) -> TrajectoryState:
        """Return states (n,) of flown parts, each at its time (s); numbers below 0 mean ramps."""
        scripts, ramps = (which >= 0).nonzero()[0], (which < 0).nonzero()[0]
        if not len(ramps):
            return self._parts.each(which, time_s)
        on_ramps = self._ramps.each(~which[ramps], time_s[ramps])
        if not len(scripts):
            return on_ramps
        others = self._parts.each(which[scripts], time_s[scripts])
        return assemble_rows([scripts, ramps], [others, on_ramps])

    def _states_before_steering(self, aircraft: IntArray, time_s: FloatArray) -> TrajectoryState:
        """Return the states (n,) of the given ownships by their flights without any manoeuvre."""
        if self._alone is None:
            return self._flights.each(aircraft, time_s)
        state: TrajectoryState = self._alone.at(time_s)
        return state

    def _rows_before_after_and_part(
        self, aircraft: IntArray, time_s: FloatArray, known: IntArray | None
    ) -> tuple[IntArray, IntArray, IntArray]:
        """Return the indices of rows before their ownship's first manoeuvre, those of rows after
        it, and the number of the part flown in the latter.
        """
        if not len(self._flown) and not len(self._ramps):
            return np.arange(len(time_s)), _NOBODY, _NOBODY
        count = self.manoeuvre_count.take(aircraft)
        if known is not None:
            count = np.minimum(count, known)
        # Most ask for the last part.
        begun = self._start_s[aircraft, np.maximum(count - 1, 0)] <= time_s
        part = np.where(begun, count, 0)
        early = (~begun & (count > 0)).nonzero()[0]
        if len(early):
            part[early] = self._count_begun_parts(aircraft[early], time_s[early], count[early] - 1)
        after = part.nonzero()[0]
        own = _NOBODY if len(after) == len(part) else np.flatnonzero(part == 0)
        return own, after, self._part[aircraft[after], part[after] - 1]

    def _count_begun_parts(
        self, aircraft: IntArray, time_s: FloatArray, most: IntArray
    ) -> IntArray:
        """Return how many of the first ``most`` parts of each aircraft have begun by its time."""
        least = np.zeros_like(most)
        for _ in range(int(most.max()).bit_length()):
            half = (least + most) // 2
            begun = (least < most) & (self._start_s[aircraft, half] <= time_s)
            least, most = np.where(begun, half + 1, least), np.where(begun, most, half)
        return least

    @cached_property
    def max_speeds_mps(self) -> FloatArray:
        """Largest speed of each along its path as it is now, shape (flights,)."""
        every = np.arange(len(self))
        return np.maximum(
            self._flights.max_speeds_mps,
            self.largest_manoeuvre_speed_mps(every, np.full(len(self), inf)),
        )

    def ground_speeds_mps(
        self, aircraft: IntArray, time_s: FloatArray, known: IntArray | None = None
    ) -> FloatArray:
        """Return ground speeds (m/s) at own times, flown by first ``known`` manoeuvres or all."""
        own, after, which = self._rows_before_after_and_part(aircraft, time_s, known)
        speed_mps = np.empty(len(time_s))
        speed_mps[own] = self._flights.ground_speeds_mps(aircraft[own], time_s[own])
        scripts, ramps = which >= 0, which < 0
        of, at_s = after[scripts], time_s[after]
        speed_mps[of] = self._parts.ground_speeds_mps(which[scripts], at_s[scripts])
        speed_mps[after[ramps]] = self._ramps.ground_speeds_mps(~which[ramps], at_s[ramps])
        return speed_mps

    def fixed_attitudes_rad(
        self, aircraft: IntArray, time_s: FloatArray, known: IntArray | None = None
    ) -> FloatArray:
        """Return the fixed yaw, pitch and roll (3, n) of the given ownships, each at its own time;
        NaN where not fixed or after a manoeuvre.
        """
        own, _, _ = self._rows_before_after_and_part(aircraft, time_s, known)
        fixed_rad = np.full((3, len(time_s)), np.nan)
        fixed_rad[:, own] = self._flights.fixed_attitudes_rad(aircraft[own], time_s[own])
        return fixed_rad

    def largest_manoeuvre_speed_mps(self, ownship: IntArray, time_s: FloatArray) -> FloatArray:
        """Return ownships' largest speed (m/s) in manoeuvres begun by their time, 0 without any."""
        parts = int(self.manoeuvre_count.max(initial=0))
        if not parts:
            return np.zeros(len(ownship))
        # Counted from its end, the last one is that of the first ramp.
        every_mps = np.append(self._parts.max_speeds_mps, self._ramps.max_speeds_mps[::-1])
        speeds = every_mps[self._part[ownship, :parts]]
        begun = self._start_s[ownship, :parts] <= time_s[:, np.newaxis]
        begun &= np.arange(parts) < self.manoeuvre_count[ownship, np.newaxis]
        return np.asarray(np.where(begun, speeds, 0.0).max(axis=1))

    def add_manoeuvres(
        self,
        ownship: IntArray,
        time_s: FloatArray,
        manoeuvres: Sequence[Manoeuvre] | FloatArray,
    ) -> SteeredFleet:
        """Return a new fleet with further manoeuvres (at most one per ownship) from given times on.

        A turn or a change of altitude begins and ends at once, without a change of speed along the
        path's projection and without acceleration upward; speeds change steadily. A velocity is
        come to by a ramp, level; what is commanded after it begins with the motion of that instant.
        """
        given = np.array(manoeuvres, dtype=np.float64).reshape(-1, len(Manoeuvre._fields))
        ramps = ~np.isnan(given[:, _VELOCITY[0]])
        if ramps.any():
            mine, others = ramps.nonzero()[0], (~ramps).nonzero()[0]
            fleet = self._append_parts(
                ownship[mine], time_s[mine], ~(len(self._ramps) + np.arange(len(mine)))
            )
            fleet._ramps = self._ramps.with_flights(
                self._ramps_to_commanded(ownship[mine], time_s[mine], given[mine])
            )
            if not len(others):
                return fleet
            return fleet.add_manoeuvres(ownship[others], time_s[others], given[others])
        around = self._states_around(ownship, time_s)
        count = self.manoeuvre_count[ownship]
        last = np.where(count > 0, self._part[ownship, count - 1], -1).tolist()
        before = [self._flown[part] if part >= 0 else None for part in last]
        every = [Manoeuvre(*row) for row in given.tolist()]
        flown = steered_parts("ownship", around, time_s, every, before)
        fleet = self._append_parts(ownship, time_s, len(self._flown) + np.arange(len(flown)))
        fleet._parts = self._parts.with_flights(ScriptedFleet(flown))
        return fleet.with_appended(_flown=np.array(flown, dtype=object))

    def _states_around(self, ownship: IntArray, time_s: FloatArray) -> TrajectoryState:
        """Return ownships' states (n, 3) shortly before, at and after times (`times_around_s`)."""
        times_s = times_around_s(time_s)
        around = self.each(np.repeat(ownship, times_s.shape[1]), times_s.reshape(-1))
        return around.reshape(times_s.shape)

    def _ramps_to_commanded(
        self, ownship: IntArray, time_s: FloatArray, given: FloatArray
    ) -> Ramps:
        """Return the ramps from ownships' velocities at their times to the commanded ones."""
        _, after, which = self._rows_before_after_and_part(ownship, time_s, None)
        velocity = np.full((2, len(time_s)), np.nan)
        at_s, scripts, ramps = time_s[after], which >= 0, which < 0
        velocity[:, after[ramps]] = self._ramps.velocities_mps(~which[ramps], at_s[ramps])
        if not ramps.all():
            of_scripts = self._parts.ramp_velocities_mps(which[scripts], at_s[scripts])
            velocity[:, after[scripts]] = of_scripts
        here = self.each(ownship, time_s)
        rest = np.isnan(velocity[0]).nonzero()[0]
        if len(rest):
            around = self._states_around(ownship[rest], time_s[rest])
            north_m, east_m, base_s = np.array(displacements_around(around, time_s[rest])).T
            velocity[:, rest] = east_m / base_s, north_m / base_s
        east, north, acceleration = (given[:, place] for place in _VELOCITY)
        table = ramp_parameters(
            (here.lat_deg, here.lon_deg, here.alt_m), here.yaw_rad, (velocity[0], velocity[1]),
            (east, north), acceleration,
        )  # fmt: skip
        fastest = np.maximum(np.hypot(*velocity), np.hypot(east, north))
        return Ramps(time_s, table, fastest)

    def _append_parts(self, ownship: IntArray, time_s: FloatArray, part: IntArray) -> SteeredFleet:
        """Return a new fleet in which each of some ownships flies a further part from its time."""
        fleet = copy(self)
        fleet.__dict__.pop("max_speeds_mps", None)
        index = self.manoeuvre_count[ownship]
        wide = self._start_s.shape[1]
        if self._written[0] != self._version or int(index.max()) >= wide:
            # Another one has written there, or there is no room.
            shape, fleet._written = (len(self), 2 * wide), [0]
            fleet._start_s, fleet._part = np.full(shape, np.inf), np.zeros(shape, dtype=np.int64)
            fleet._start_s[:, :wide], fleet._part[:, :wide] = self._start_s, self._part
        fleet._written[0] += 1
        fleet._version = fleet._written[0]
        fleet._start_s[ownship, index] = time_s
        fleet._part[ownship, index] = part
        fleet.manoeuvre_count = self.manoeuvre_count.copy()
        fleet.manoeuvre_count[ownship] += 1
        return fleet


#: Where what commands a velocity stands in a manoeuvre: east, north, and the acceleration to it.
_VELOCITY = [
    Manoeuvre._fields.index(name)
    for name in ("velocity_east_mps", "velocity_north_mps", "acceleration_mps2")
]
_NOBODY: IntArray = np.empty(0, dtype=np.int64)


class SteeredFlight:
    """One flight of a `SteeredFleet`; for a flight given alone a fleet of one is made."""

    def __init__(
        self, flight: Trajectory, fleet: SteeredFleet | None = None, number: int = 0
    ) -> None:
        self.name, self.flight = flight.name, flight
        self._fleet = SteeredFleet(fleet_of([flight])) if fleet is None else fleet
        self._number = number

    @property
    def parts(self) -> Parts:
        """Return the parts flown after manoeuvres, each with the time (s) from which it holds."""
        return self._fleet.parts_of(self._number)

    @property
    def max_speed_mps(self) -> float:
        """Largest speed (m/s) along the path, with the manoeuvres so far."""
        return float(self._fleet.max_speeds_mps[self._number])

    def interval_present(self) -> tuple[float, float]:
        """Return the flight's first and last time (s): 0 and infinity, as it has no end."""
        return 0.0, inf

    def add_manoeuvre(self, time_s: float, manoeuvre: Manoeuvre) -> SteeredFlight:
        """Return a new flight, steered from a time on; see `SteeredFleet.add_manoeuvres`."""
        fleet = self._fleet.add_manoeuvres(
            np.array([self._number]), np.array([time_s]), [manoeuvre]
        )
        return SteeredFlight(self.flight, fleet, self._number)

    def at(self, time_s: Any) -> TrajectoryState:
        """Return the state at some times, of any shape."""
        times = np.asarray(time_s, dtype=np.float64)
        flat = times.reshape(-1)
        state = self._fleet.each(np.full(len(flat), self._number), flat)
        return state.reshape(times.shape)


def _join_flights(flights: Sequence[SteeredFlight]) -> SteeredFleet:
    fleet = flights[0]._fleet
    if all(flight._fleet is fleet for flight in flights):
        return fleet.subset(np.array([flight._number for flight in flights]))
    return SteeredFleet(fleet_of([f.flight for f in flights]), [f.parts for f in flights])


_FLEETS: dict[type, Callable[[Sequence[Any]], Fleet]] = {
    ScriptedTrajectory: ScriptedFleet,
    SampledTrajectory: SampledFleet,
    SteeredFlight: _join_flights,
}


def fleet_of(flights: Sequence[Any]) -> Fleet:
    """Return flights as a fleet: of their type's class if all share one type, else a mixed one."""
    kinds = {type(flight) for flight in flights}
    kind = next(iter(kinds), ScriptedTrajectory)
    return (
        _FLEETS[kind](flights)
        if len(kinds) < 2 and kind in _FLEETS
        else MixedFleet(flights, _FLEETS)
    )
