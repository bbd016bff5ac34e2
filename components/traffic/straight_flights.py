"""Many flights that only ever fly straight on, as arrays: nothing is made for one alone.

Preparing a flight by itself takes 25 µs and an object or two; a million of them so take half a
minute. Each flight has the bits it would have alone.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import atan2, cos, inf, isnan, radians
from typing import overload

import numpy as np

from components.geometry.angles import FloatArray, heading_from_deg, wrap_longitude_deg
from components.traffic.geodesic_motion import geodesic_parameter_table
from components.traffic.leg_builder import Segment
from components.traffic.legs import LONGEST_FLIGHT_S, MOST_ALT_M, ScriptedTrajectory


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
        """Return one of the flights, made by itself.

        Raises
        ------
        ValueError
            A value that is not allowed.
        """
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
    """Flights without legs; an item is made when it is asked for.

    Parameters
    ----------
    starts : Starts
        As `are_plain` says they may be.
    """

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
    """Return flights without legs, together where that can be, else each by itself.

    Raises
    ------
    ValueError
        A value that `ScriptedTrajectory` refuses.
    """
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
