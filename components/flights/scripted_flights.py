"""Flights by scripts: a start and legs, of one aircraft or of many."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from functools import cached_property
from math import inf, isfinite, isnan, radians
from typing import Any, Self

import numpy as np
import numpy.typing as npt

from components.flights.fleet import (
    Fleet,
    FormulaGroup,
    PieceSearch,
    checked_one_axis_times,
    evaluate_in_blocks,
    uninitialized_state,
)
from components.flights.leg_motion import (
    FORMULAS,
    KINDS,
    LONGEST_FLIGHT_S,
    Segment,
    ramp_velocity_in_start_axes,
)
from components.flights.legs import AnyLeg, LegBuilder, require
from components.geometry import (
    TrajectoryState,
    enu_to_geodetic,
    heading_rad_from_deg,
    wrap_longitude_deg,
)
from dsa_des.arrays.growing_arrays import Growing, GrowingArray
from dsa_des.arrays.types import FloatArray, IntArray

MOST_ALT_M = 1e6
"""No flight starts farther above or below the ellipsoid."""

_BY_KIND = [FORMULAS[kind] for kind in KINDS]
_STRAIGHT, _HOLD, _RAMP = (KINDS.index(kind) for kind in ("geodesic", "hold", "ramp"))


class ScriptedTrajectory:
    """An aircraft that flies a script from `start_time_s` to `end_time_s`, both included.

    Nothing is integrated, so there is no drift. Straight legs follow the geodesic of the WGS-84
    ellipsoid (error below 2e-8 m at 12,000 km) with constant altitude when level; ground speed is
    measured at the flight's own altitude. Turns are circles (see `turn_parameters`). Without legs
    it flies straight on; the last leg goes on for ever.

    Attitude that is not given follows the path: yaw is the track, pitch the flight-path angle, roll
    the bank of a coordinated turn, atan(V·rate/g). Waypoints given as offsets count from
    `reference` (latitude, longitude, altitude), by default the aircraft's own start. ValueError
    names the value that is not allowed.
    """

    def __init__(
        self,
        name: str,
        *,
        lat_deg: float,
        lon_deg: float,
        alt_m: float,
        heading_deg: float = 0.0,
        speed_mps: float = 0.0,
        climb_mps: float = 0.0,
        legs: Sequence[AnyLeg] = (),
        yaw_deg: float | None = None,
        pitch_deg: float | None = None,
        roll_deg: float | None = None,
        reference: tuple[float, float, float] | None = None,
        start_time_s: float = 0.0,
        end_time_s: float | None = None,
    ) -> None:
        given = {
            "lat_deg": lat_deg, "lon_deg": lon_deg, "alt_m": alt_m, "heading_deg": heading_deg,
            "speed_mps": speed_mps, "climb_mps": climb_mps, "yaw_deg": yaw_deg,
            "pitch_deg": pitch_deg, "roll_deg": roll_deg, "start_time_s": start_time_s,
        }  # fmt: skip
        for key, value in given.items():
            if value is not None:
                require(isfinite(value), f"{name}: {key}", value, "be finite")
        require(abs(lat_deg) <= 90.0, f"{name}: lat_deg", lat_deg, "lie in [-90, 90] degrees")
        require(abs(alt_m) <= MOST_ALT_M, f"{name}: alt_m", alt_m, "lie within ±1e6 metres")
        require(speed_mps >= 0.0, f"{name}: speed_mps", speed_mps, "be 0 or more")
        end = inf if end_time_s is None else float(end_time_s)
        require(end >= start_time_s, f"{name}: end_time_s", end, f"be {start_time_s} or more")
        if not -180.0 <= lon_deg < 180.0:
            lon_deg = float(wrap_longitude_deg(np.array([lon_deg]))[0])
        start = (float(lat_deg), float(lon_deg), float(alt_m))
        builder = LegBuilder(
            name, start, heading_rad_from_deg(heading_deg), float(speed_mps), float(climb_mps),
            start if reference is None else reference,
        )  # fmt: skip
        segments = builder.build(legs)
        angles = (None if yaw_deg is None else yaw_deg % 360.0, pitch_deg, roll_deg)
        fixed = tuple(None if angle is None else radians(angle) for angle in angles)
        self._set_segments(name, segments, fixed, float(start_time_s), end)

    @classmethod
    def from_offset(
        cls,
        name: str,
        *,
        east_m: float,
        north_m: float,
        up_m: float,
        reference: tuple[float, float, float],
        **others: Any,
    ) -> ScriptedTrajectory:
        """Return a flight that starts at an east, north, up offset (m) from a reference point,
        usually the ownship's start.

        The slant range at the start is exactly the offset's length; the altitude of a point with
        up 0 exceeds the reference's by 7.8 m at 10 km. `others` are as for `ScriptedTrajectory`.
        """
        lat_deg, lon_deg, alt_m = reference
        lat, lon, alt = enu_to_geodetic(
            east_m, north_m, up_m,
            reference_lat_deg=lat_deg, reference_lon_deg=lon_deg, reference_alt_m=alt_m,
        )  # fmt: skip
        position: Any = {"lat_deg": float(lat), "lon_deg": float(lon), "alt_m": float(alt)}
        return cls(name, **position, reference=reference, **others)

    @classmethod
    def of_segments_unchecked(cls, *known: Any) -> Self:
        """Return a flight of ready segments, without checks; arguments as in `_set_segments`."""
        flight = cls.__new__(cls)
        flight._set_segments(*known)
        return flight

    def _set_segments(
        self,
        name: str,
        segments: list[Segment],
        fixed_attitude_rad: tuple[float | None, ...],
        start_time_s: float,
        end_time_s: float,
    ) -> None:
        self.name, self.segments, self.fixed_attitude_rad = name, segments, fixed_attitude_rad
        self.start_time_s, self.end_time_s = start_time_s, end_time_s

    @cached_property
    def as_fleet(self) -> ScriptedFleet:
        """The flight as a fleet of one."""
        return ScriptedFleet([self])

    def at(self, time_s: npt.ArrayLike) -> TrajectoryState:
        """Return the aircraft's state at some times."""
        times = np.asarray(time_s, dtype=np.float64)
        return self.as_fleet.at(times.reshape(-1)).reshape(times.shape)

    @property
    def max_speed_mps(self) -> float:
        """Largest speed along the path at any time."""
        return max(segment.speed_mps for segment in self.segments)

    def interval_present(self) -> tuple[float, float]:
        """Return the first and last times the aircraft is there; the last may be infinite."""
        return self.start_time_s, self.end_time_s


#: Columns of a fleet that are those of its parts one after the other.
_GROWING = ("_names", "_between_s", "_until_s", "_fixed_rad", "_counts", "_legs", "_kind")


class ScriptedFleet(Growing, Fleet):
    """Scripted flights: columns over flights, and over all their legs laid end to end."""

    def __init__(self, flights: Sequence[ScriptedTrajectory]) -> None:
        self._set_columns(*_columns_of(flights))

    def _set_columns(
        self,
        names: Sequence[str],
        between_s: FloatArray,
        fixed_rad: FloatArray,
        counts: IntArray,
        legs: FloatArray,
        kinds: IntArray,
        tables: dict[int, FloatArray],
    ) -> None:
        """Store the columns: times (2, flights), leg numbers, legs' starts, pitch, roll, speed.

        Fixed angles (3, flights) are NaN where the motion gives them; the table of each kind of
        legs holds those of that kind, in their order.
        """
        self._names = np.array(names, dtype=object)
        self._between_s, self._fixed_rad = between_s, fixed_rad
        self._some_fixed = not np.isnan(fixed_rad).all()
        self._until_s = np.minimum(between_s[1], between_s[0] + LONGEST_FLIGHT_S)
        self._counts, self._legs, self._kind = counts, legs, kinds
        #: Of each kind, the rows of a leg beside each other in memory: some legs are taken at once.
        self._tables = {kind: GrowingArray(np.asfortranarray(of)) for kind, of in tables.items()}
        self._find = PieceSearch(legs[0], counts)
        self._slot = np.empty(len(kinds), dtype=np.int64)
        for kind in tables:
            members = np.flatnonzero(kinds == kind)
            self._slot[members] = np.arange(len(members))
        #: Which of all flights are those of this fleet: subsets share all else.
        self._columns: IntArray = np.arange(len(names))

    @classmethod
    def of_columns_unchecked(cls, *columns: Any) -> ScriptedFleet:
        """Return a fleet of ready columns, without checks; arguments as in `_set_columns`."""
        fleet = cls.__new__(cls)
        fleet._set_columns(*columns)
        return fleet

    def with_flights(self, flights: ScriptedFleet) -> ScriptedFleet:
        """Return these flights followed by more as a fleet; neither may be a subset of another."""
        sizes = {kind: table.values.shape[1] for kind, table in self._tables.items()}
        slot = flights._slot.copy()
        for kind in flights._tables:
            slot[flights._kind == kind] += sizes.get(kind, 0)
        fleet = self.with_appended(
            _slot=slot,
            _columns=flights._columns + len(self._names),
            **{name: getattr(flights, name) for name in _GROWING},
        )
        fleet._clear_cached()
        fleet._find = self._find.with_paths(flights._find)
        fleet._some_fixed = self._some_fixed or flights._some_fixed
        fleet._tables = {**flights._tables, **self._tables}
        for kind in sizes.keys() & flights._tables.keys():
            more = flights._tables[kind].values
            fleet._tables[kind] = self._tables[kind].with_appended(more)
        return fleet

    def _clear_cached(self) -> None:
        """Discard the cached properties, because the flights have changed."""
        for name in ("_groups_and_others", "max_speeds_mps"):
            self.__dict__.pop(name, None)

    def _leg_tables(self, kind: int, slot: IntArray) -> FloatArray:
        """Return the parameters (rows, n) of legs of one kind, by places in that kind's table."""
        return np.ascontiguousarray(self._tables[kind].values.T.take(slot, axis=0).T)

    def ramp_velocities_mps(self, aircraft: IntArray, time_s: FloatArray) -> FloatArray:
        """Return velocities (2, n) east, north (m/s) of flights at own times; NaN if on no ramp."""
        leg, elapsed = self._leg_indices_and_elapsed_s(self._columns[aircraft], time_s)
        velocity = np.full((2, len(leg)), np.nan)
        on = np.flatnonzero(self._kind[leg] == _RAMP)
        if len(on):
            table = self._leg_tables(_RAMP, self._slot[leg[on]])
            velocity[:, on] = ramp_velocity_in_start_axes(table, elapsed[on])
        return velocity

    def subset(self, columns: IntArray) -> ScriptedFleet:
        """Return the fleet of some flights, without preparing them anew."""
        fleet = copy(self)
        fleet._clear_cached()
        fleet._columns = self._columns[columns]
        return fleet

    def __len__(self) -> int:
        return len(self._columns)

    def __getitem__(self, index: int) -> ScriptedTrajectory:  # type: ignore[override]
        number = int(self._columns[index])
        first, last = int(self._find.first[number]), int(self._find.last[number])
        legs = enumerate(self._legs[:, first : last + 1].T.tolist(), first)
        segments = []
        for leg, (start_s, *others) in legs:
            kind = int(self._kind[leg])
            table = self._tables[kind].values[:, self._slot[leg]].copy()
            segments.append(Segment(KINDS[kind], start_s, table, *others))
        fixed = tuple(None if isnan(a) else a for a in self._fixed_rad[:, number].tolist())
        between_s = self._between_s[:, number].tolist()
        return ScriptedTrajectory.of_segments_unchecked(
            self._names[number], segments, fixed, *between_s
        )

    @cached_property
    def max_speeds_mps(self) -> FloatArray:
        """Largest speed of each along its path, shape (flights,)."""
        if not len(self._names):
            return np.empty(0)
        return np.asarray(np.maximum.reduceat(self._legs[3], self._find.first)[self._columns])

    @property
    def intervals_present_s(self) -> FloatArray:
        """First and last time at which each is there, shape (flights, 2)."""
        return self._between_s[:, self._columns].T

    def at(self, time_s: npt.ArrayLike) -> TrajectoryState:
        """Return the states of all flights at the given times, shape (times, flights)."""
        times = checked_one_axis_times(time_s)
        groups, others = self._groups_and_others
        parts = [(group.columns, group.at(times)) for group in groups]
        if len(others):
            shape = len(times), len(others)
            aircraft = np.broadcast_to(others, shape).reshape(-1)
            several = self.each(aircraft, np.repeat(times, len(others))).reshape(shape)
            parts.append((others, several))
        if len(parts) == 1:
            return parts[0][1]
        state = uninitialized_state(len(times), len(self))
        for members, part in parts:
            for out, columns in zip(state.arrays(), part.arrays(), strict=True):
                out[:, members] = columns
        return state

    def each(self, aircraft: IntArray, time_s: FloatArray) -> TrajectoryState:
        """Return the states (n,) of the given flights, each at its own time (s)."""
        return evaluate_in_blocks(self._state, self._columns[aircraft], time_s)

    def _leg_indices_and_elapsed_s(
        self, aircraft: IntArray, time_s: FloatArray
    ) -> tuple[IntArray, FloatArray]:
        """Return the index of each flight's leg at its time, and the time (s) since it began."""
        start_s, until_s = self._between_s[0].take(aircraft), self._until_s.take(aircraft)
        elapsed = np.where(time_s > start_s, time_s, start_s)
        elapsed = np.where(elapsed < until_s, elapsed, until_s) - start_s
        leg = self._find(aircraft, elapsed)
        elapsed -= self._find.starts_s.take(leg)
        return leg, elapsed

    def _state(self, aircraft: IntArray, time_s: FloatArray) -> TrajectoryState:
        leg, elapsed = self._leg_indices_and_elapsed_s(aircraft, time_s)
        kinds, slot = self._kind.take(leg), self._slot.take(leg)
        in_use = np.flatnonzero(np.bincount(kinds)).tolist()
        if len(in_use) == 1:
            kind = in_use[0]
            lat, lon, alt, yaw = _BY_KIND[kind](self._leg_tables(kind, slot), elapsed)
        else:
            lat, lon, alt, yaw = moved = tuple(np.empty(len(leg)) for _ in range(4))
            for kind in in_use:
                chosen = np.flatnonzero(kinds == kind)
                values = _BY_KIND[kind](self._leg_tables(kind, slot[chosen]), elapsed[chosen])
                for out, value in zip(moved, values, strict=True):
                    out[chosen] = value
        pitch, roll = self._legs[1].take(leg), self._legs[2].take(leg)
        if self._some_fixed:
            fixed = self._fixed_rad.take(aircraft, axis=1)
            yaw, pitch, roll = np.where(np.isnan(fixed), (yaw, pitch, roll), fixed)
        first_s, last_s = self._between_s
        present = (time_s >= first_s.take(aircraft)) & (time_s <= last_s.take(aircraft))
        return TrajectoryState(lat, lon, alt, yaw, pitch, roll, present)

    def ground_speeds_mps(self, aircraft: IntArray, time_s: FloatArray) -> FloatArray:
        """Return the ground speeds (m/s) of the given flights, each at its own time."""
        leg, _ = self._leg_indices_and_elapsed_s(self._columns[aircraft], time_s)
        level = self._legs[3][leg] * np.cos(self._legs[1][leg])
        level = np.where(self._kind[leg] == _HOLD, 0.0, level)
        if _RAMP not in self._tables:
            return level
        ramps_mps = np.hypot(*self.ramp_velocities_mps(aircraft, time_s))
        return np.where(np.isnan(ramps_mps), level, ramps_mps)

    def fixed_attitudes_rad(self, aircraft: IntArray, time_s: FloatArray) -> FloatArray:
        """Return fixed yaw, pitch and roll (3, n), NaN where the motion gives them."""
        return self._fixed_rad[:, self._columns[aircraft]]

    @cached_property
    def _groups_and_others(self) -> tuple[list[FormulaGroup], IntArray]:
        """Flights of a single straight or hold leg by formula, and the others' indices."""
        flights = self._columns
        leg = self._find.first[flights]
        kinds = np.where(self._counts[flights] == 1, self._kind[leg], -1)
        groups = []
        for kind in (_STRAIGHT, _HOLD):
            members = np.flatnonzero(kinds == kind)
            if not len(members):
                continue
            of, legs = flights[members], leg[members]
            fixed = self._fixed_rad[:, of]
            derived = np.stack((np.full(len(of), np.nan), *self._legs[1:3, legs]))
            groups.append(
                FormulaGroup(
                    _BY_KIND[kind],
                    members,
                    self._leg_tables(kind, self._slot[legs])[:, np.newaxis],
                    (self._between_s[0][of], self._between_s[1][of], self._until_s[of]),
                    np.where(np.isnan(fixed), derived, fixed),
                    ~np.isnan(fixed[0]),
                )
            )
        return groups, np.flatnonzero((kinds != _STRAIGHT) & (kinds != _HOLD))


def _columns_of(flights: Sequence[ScriptedTrajectory]) -> tuple[Any, ...]:
    """Return the columns of a fleet; see `ScriptedFleet._set_columns`."""
    segments = [segment for flight in flights for segment in flight.segments]
    kinds = [KINDS.index(s.kind) for s in segments]
    fixed = [[np.nan if a is None else a for a in f.fixed_attitude_rad] for f in flights]
    legs = [(s.start_s, s.pitch_rad, s.roll_rad, s.speed_mps) for s in segments]
    tables: dict[int, Any] = {kind: [] for kind in sorted(set(kinds))}
    for kind, segment in zip(kinds, segments, strict=True):
        tables[kind].append(segment.parameters)
    return (
        [flight.name for flight in flights],
        np.array([(f.start_time_s, f.end_time_s) for f in flights]).reshape(-1, 2).T.copy(),
        np.array(fixed).reshape(-1, 3).T.copy(),
        np.array([len(flight.segments) for flight in flights], dtype=np.int64),
        np.array(legs).reshape(-1, 4).T.copy(),
        np.array(kinds, dtype=np.int64),
        {kind: np.stack(rows, axis=-1) for kind, rows in tables.items()},
    )
