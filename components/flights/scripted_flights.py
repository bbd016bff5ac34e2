"""Scripted flights: one from a start and legs, or many that only ever fly straight on."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import atan2, cos, inf, isnan, radians
from typing import overload

import numpy as np
import numpy.typing as npt

from components.flights.geodesic_motion import geodesic_parameter_table
from components.flights.leg_motion import Segment, segment_state
from components.flights.legs import AnyLeg, LegBuilder, require
from components.flights.sampled_flight import CELLS_AT_ONCE, TrajectoryState
from components.geometry.angles import FloatArray, heading_from_deg, wrap_longitude_deg
from components.geometry.ellipsoid import enu_to_geodetic

LONGEST_FLIGHT_S = 1e12
"""Flights are held up to here (30,000 years) and stand still after, so that nothing overflows."""
MOST_ALT_M = 1e6
"""No flight starts farther above or below the ellipsoid."""


class ScriptedTrajectory:
    """An aircraft that flies a script; every position is computed from its leg's start.

    Nothing is integrated, so there is no drift. Straight legs follow the geodesic of the WGS-84
    ellipsoid (error below 2e-8 m at 12,000 km) with constant altitude when level; ground speed
    is measured at the flight's own altitude. Turns are circles (see `turn_motion`).

    Parameters
    ----------
    name : str
        The aircraft's name.
    lat_deg, lon_deg, alt_m : float
        Where it is at `start_time_s`.
    heading_deg : float
        Clockwise from true north.
    speed_mps : float
        Ground speed; 0 stands still.
    climb_mps : float
        Rate of climb of every leg that does not give its own.
    legs : sequence of legs
        `Straight`, `Turn`, `Climb`, `Stationary`, `Waypoints`. None means straight on. The last
        leg goes on for ever: a turn keeps turning, a climb without `to_alt_m` keeps climbing.
    yaw_deg, pitch_deg, roll_deg : float, optional
        Fixed attitude. What is not given follows the path: yaw is the track, pitch the
        flight-path angle, roll the bank of a coordinated turn, atan(V·rate/g).
    reference : tuple of three float, optional
        Latitude, longitude and altitude from which waypoints given as offsets are measured:
        the ownship's start. Left out: this aircraft's own start.
    start_time_s, end_time_s : float
        The aircraft is there from the one to the other, both included.

    Raises
    ------
    ValueError
        A value that is not allowed, naming it.
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
            "lat_deg": lat_deg,
            "lon_deg": lon_deg,
            "alt_m": alt_m,
            "heading_deg": heading_deg,
            "speed_mps": speed_mps,
            "climb_mps": climb_mps,
            "yaw_deg": yaw_deg,
            "pitch_deg": pitch_deg,
            "roll_deg": roll_deg,
            "start_time_s": start_time_s,
        }
        for key, value in given.items():
            if value is not None:
                require(math.isfinite(value), f"{name}: {key}", value, "be finite")
        require(abs(lat_deg) <= 90.0, f"{name}: lat_deg", lat_deg, "lie in [-90, 90] degrees")
        require(abs(alt_m) <= MOST_ALT_M, f"{name}: alt_m", alt_m, "lie within ±1e6 metres")
        require(speed_mps >= 0.0, f"{name}: speed_mps", speed_mps, "be 0 or more")
        end = math.inf if end_time_s is None else float(end_time_s)
        require(end >= start_time_s, f"{name}: end_time_s", end, f"be {start_time_s} or more")
        self.name = name
        self.start_time_s, self.end_time_s = float(start_time_s), end
        self.evaluated_until_s = min(end, self.start_time_s + LONGEST_FLIGHT_S)
        self.fixed_attitude_rad = tuple(
            None if angle is None else math.radians(angle)
            for angle in (None if yaw_deg is None else yaw_deg % 360.0, pitch_deg, roll_deg)
        )
        if not -180.0 <= lon_deg < 180.0:
            lon_deg = float(wrap_longitude_deg(np.array([lon_deg]))[0])
        start = (float(lat_deg), float(lon_deg), float(alt_m))
        self.segments: list[Segment] = LegBuilder(
            name=name,
            start=start,
            heading_rad=heading_from_deg(heading_deg),
            speed_mps=float(speed_mps),
            climb_mps=float(climb_mps),
            reference=start if reference is None else reference,
        ).build(legs)
        self._segment_starts_s = np.array([segment.start_s for segment in self.segments])

    @classmethod
    def of_segments(
        cls,
        name: str,
        segments: list[Segment],
        *,
        fixed_attitude_rad: tuple[float | None, float | None, float | None],
        start_time_s: float,
        end_time_s: float,
    ) -> ScriptedTrajectory:
        """Return a flight whose segments are known already."""
        flight = cls.__new__(cls)
        flight.name = name
        flight.start_time_s, flight.end_time_s = start_time_s, end_time_s
        flight.evaluated_until_s = min(end_time_s, start_time_s + LONGEST_FLIGHT_S)
        flight.fixed_attitude_rad = fixed_attitude_rad
        flight.segments = segments
        flight._segment_starts_s = np.array([segment.start_s for segment in segments])
        return flight

    @classmethod
    def from_offset(
        cls,
        name: str,
        *,
        east_m: float,
        north_m: float,
        up_m: float,
        reference: tuple[float, float, float],
        **others: object,
    ) -> ScriptedTrajectory:
        """Start at an offset from a reference point, usually the ownship's start.

        Parameters
        ----------
        name : str
            The aircraft's name.
        east_m, north_m, up_m : float
            Metres in the reference point's tangent frame, so that the slant range at the start
            is exactly the offset's length. The altitude of a point with up 0 exceeds the
            reference's by 7.8 m at 10 km, 0.2 m at 1.6 km.
        reference : tuple of three float
            Latitude and longitude in degrees, altitude in metres.
        **others
            As for `ScriptedTrajectory`.

        Returns
        -------
        ScriptedTrajectory
        """
        lat, lon, alt = enu_to_geodetic(
            east_m,
            north_m,
            up_m,
            reference_lat_deg=reference[0],
            reference_lon_deg=reference[1],
            reference_alt_m=reference[2],
        )
        return cls(
            name,
            lat_deg=float(lat),
            lon_deg=float(lon),
            alt_m=float(alt),
            reference=reference,
            **others,  # type: ignore[arg-type]
        )

    def at(self, time_s: npt.ArrayLike) -> TrajectoryState:
        """Give the aircraft's state at some times."""
        times = np.asarray(time_s, dtype=np.float64)
        flat = np.ascontiguousarray(times).reshape(-1)
        if len(flat) > CELLS_AT_ONCE:
            cuts = range(CELLS_AT_ONCE, len(flat), CELLS_AT_ONCE)
            parts = [self.at(part).arrays() for part in np.split(flat, cuts)]
            whole = [np.concatenate(pieces) for pieces in zip(*parts, strict=True)]
            return TrajectoryState(*whole).reshaped(times.shape)
        present = (flat >= self.start_time_s) & (flat <= self.end_time_s)
        elapsed = np.maximum(flat, self.start_time_s)
        np.minimum(elapsed, self.evaluated_until_s, out=elapsed)
        elapsed -= self.start_time_s
        if len(self.segments) == 1:
            columns = segment_state(self.segments[0], elapsed)
        else:
            index = np.searchsorted(self._segment_starts_s, elapsed, side="right") - 1
            columns = tuple(np.empty_like(flat) for _ in range(6))
            # Counting is many times faster than np.unique, which hashes.
            for k in np.flatnonzero(np.bincount(index)):
                chosen = index == k
                segment = self.segments[k]
                state = segment_state(segment, elapsed[chosen] - segment.start_s)
                for column, values in zip(columns, state, strict=True):
                    column[chosen] = values
        lat, lon, alt, *attitude = columns
        yaw, pitch, roll = (
            derived if fixed is None else np.full_like(flat, fixed)
            for derived, fixed in zip(attitude, self.fixed_attitude_rad, strict=True)
        )
        return TrajectoryState(lat, lon, alt, yaw, pitch, roll, present).reshaped(times.shape)

    @property
    def max_speed_mps(self) -> float:
        """Largest speed along the path at any time."""
        return max((segment.speed_mps for segment in self.segments), default=0.0)

    def interval_present(self) -> tuple[float, float]:
        """Return the first and last times the aircraft is there; the last may be infinite."""
        return self.start_time_s, self.end_time_s


@dataclass(eq=False)
class Starts:
    """Where and how straight flights start, as columns; units of `ScriptedTrajectory`.

    Parameters
    ----------
    names : sequence of str
    lat_deg, lon_deg, alt_m, heading_deg, speed_mps : (flights,)
    climb_mps, start_time_s : (flights,), optional
        0 by default.
    end_time_s : (flights,), optional
        Infinite by default.
    fixed_deg : (3, flights), optional
        Fixed yaw, pitch and roll; NaN, the default, where they follow from the motion.
    """

    names: Sequence[str]
    lat_deg: FloatArray
    lon_deg: FloatArray
    alt_m: FloatArray
    heading_deg: FloatArray
    speed_mps: FloatArray
    climb_mps: FloatArray | None = None
    start_time_s: FloatArray | None = None
    end_time_s: FloatArray | None = None
    fixed_deg: FloatArray | None = None

    def __len__(self) -> int:
        return len(self.names)

    def column(self, name: str, default: float) -> FloatArray:
        """Return a column, of the default where it is left out."""
        given = getattr(self, name)
        return np.full(len(self), default) if given is None else given

    def flight(self, number: int) -> ScriptedTrajectory:
        """Return one of the flights, made by itself."""
        fixed = (np.nan,) * 3 if self.fixed_deg is None else self.fixed_deg[:, number].tolist()
        yaw, pitch, roll = (None if isnan(angle) else angle for angle in fixed)
        end_s = float(self.column("end_time_s", inf)[number])
        return ScriptedTrajectory(
            self.names[number],
            lat_deg=float(self.lat_deg[number]),
            lon_deg=float(self.lon_deg[number]),
            alt_m=float(self.alt_m[number]),
            heading_deg=float(self.heading_deg[number]),
            speed_mps=float(self.speed_mps[number]),
            climb_mps=float(self.column("climb_mps", 0.0)[number]),
            yaw_deg=yaw,
            pitch_deg=pitch,
            roll_deg=roll,
            start_time_s=float(self.column("start_time_s", 0.0)[number]),
            end_time_s=None if end_s == inf else end_s,
        )


class StraightFlights(Sequence[ScriptedTrajectory]):
    """Flights without legs; an item is made when it is asked for."""

    def __init__(self, starts: Starts) -> None:
        self.names = starts.names
        #: First and last time at which each is there, shape (flights,).
        self.start_s = starts.column("start_time_s", 0.0)
        self.end_s = starts.column("end_time_s", inf)
        self.until_s = np.minimum(self.end_s, self.start_s + LONGEST_FLIGHT_S)
        lon = starts.lon_deg
        lon = np.where((lon >= -180.0) & (lon < 180.0), lon, wrap_longitude_deg(lon))
        speeds, climbs = starts.speed_mps.tolist(), starts.column("climb_mps", 0.0).tolist()
        pitches = list(map(atan2, climbs, speeds))
        #: The table of `geodesic_state`, shape (rows, flights).
        self.table: FloatArray = geodesic_parameter_table(
            starts.lat_deg,
            lon,
            starts.alt_m,
            [heading_from_deg(heading) for heading in starts.heading_deg.tolist()],
            speeds,
            climbs,
        )
        #: The attitude that follows from the motion, shape (flights,).
        self.pitch_rad = np.array(pitches, dtype=np.float64)
        #: Fixed yaw, pitch and roll, NaN where the motion gives them, shape (3, flights).
        self.fixed_rad = np.full((3, len(starts)), np.nan)
        if starts.fixed_deg is not None:
            yaw, pitch, roll = starts.fixed_deg.tolist()
            self.fixed_rad[0] = [heading_from_deg(angle) for angle in yaw]
            self.fixed_rad[1:] = [list(map(radians, pitch)), list(map(radians, roll))]
        #: Largest speed of each along its path, shape (flights,).
        self.max_speeds_mps = starts.speed_mps / np.array(list(map(cos, pitches)))

    @property
    def intervals_present_s(self) -> FloatArray:
        """First and last time at which each is there, shape (flights, 2)."""
        return np.stack((self.start_s, self.end_s), axis=1)

    def __len__(self) -> int:
        return len(self.names)

    @overload
    def __getitem__(self, place: int) -> ScriptedTrajectory: ...
    @overload
    def __getitem__(self, place: slice) -> list[ScriptedTrajectory]: ...

    def __getitem__(self, place: int | slice) -> ScriptedTrajectory | list[ScriptedTrajectory]:
        if isinstance(place, slice):
            return [self[i] for i in range(*place.indices(len(self)))]
        number = range(len(self))[place]
        segment = Segment(
            "geodesic", 0.0, self.table[:, number].copy(), float(self.pitch_rad[number]), 0.0,
            float(self.max_speeds_mps[number]),
        )  # fmt: skip
        fixed = [None if np.isnan(a) else a for a in self.fixed_rad[:, number].tolist()]
        return ScriptedTrajectory.of_segments(
            self.names[number],
            [segment],
            fixed_attitude_rad=(fixed[0], fixed[1], fixed[2]),
            start_time_s=float(self.start_s[number]),
            end_time_s=float(self.end_s[number]),
        )

    def __iter__(self) -> Iterator[ScriptedTrajectory]:
        return (self[number] for number in range(len(self)))


def flights_of(starts: Starts) -> Sequence[ScriptedTrajectory]:
    """Return flights without legs, together where that can be, else each by itself."""
    if are_plain(starts):
        return StraightFlights(starts)
    return [starts.flight(number) for number in range(len(starts))]


def are_plain(starts: Starts) -> bool:
    """Return whether all flights move, and have no value that `ScriptedTrajectory` refuses."""
    start_s = starts.column("start_time_s", 0.0)
    others = (starts.lon_deg, starts.heading_deg, starts.column("climb_mps", 0.0), start_s)
    fixed = starts.fixed_deg
    return bool(
        np.all(np.isfinite(starts.speed_mps) & (starts.speed_mps > 0.0))
        and np.all(np.abs(starts.lat_deg) <= 90.0)
        and np.all(np.abs(starts.alt_m) <= MOST_ALT_M)
        and np.all(starts.column("end_time_s", inf) >= start_s)
        and all(np.isfinite(column).all() for column in others)
        and (fixed is None or not np.isinf(fixed).any())
    )
