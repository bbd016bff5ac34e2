"""Many flights that only ever fly straight on, as arrays: nothing is made for one alone.

Preparing a flight by itself takes 25 µs and an object or two; a million of them so take half a
minute. Each flight has the bits it would have alone.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass
from math import atan2, cos, inf, isfinite, nan, radians
from typing import overload

import numpy as np

from components.traffic.geodesic_motion import geodesic_parameter_table
from components.traffic.leg_builder import Segment
from components.traffic.legs import LONGEST_FLIGHT_S, MOST_ALT_M, ScriptedTrajectory
from components.traffic.normals import FloatArray, wrap_longitude_deg


@dataclass(slots=True)
class Start:
    """Where and how a straight flight starts; units and defaults of `ScriptedTrajectory`."""

    name: str
    lat_deg: float
    lon_deg: float
    alt_m: float
    heading_deg: float
    speed_mps: float
    climb_mps: float = 0.0
    yaw_deg: float | None = None
    pitch_deg: float | None = None
    roll_deg: float | None = None
    start_time_s: float = 0.0
    end_time_s: float | None = None


class StraightFlights(Sequence[ScriptedTrajectory]):
    """Flights without legs; an item is made when somebody asks for it.

    Parameters
    ----------
    starts : iterable of Start
        As `are_plain` says they may be.
    """

    def __init__(self, starts: Iterable[Start]) -> None:
        of = list(starts)
        self.names = [start.name for start in of]
        #: First and last time at which each is there, shape (flights,).
        self.start_s = np.array([start.start_time_s for start in of], dtype=np.float64)
        ends = [inf if start.end_time_s is None else start.end_time_s for start in of]
        self.end_s = np.array(ends, dtype=np.float64)
        self.until_s = np.minimum(self.end_s, self.start_s + LONGEST_FLIGHT_S)
        lon = np.array([start.lon_deg for start in of], dtype=np.float64)
        wrapped = (lon >= -180.0) & (lon < 180.0)
        lon = np.where(wrapped, lon, wrap_longitude_deg(lon))
        headings = [radians(start.heading_deg % 360.0) for start in of]
        pitches = [atan2(start.climb_mps, start.speed_mps) for start in of]
        speeds = [start.speed_mps / cos(p) for start, p in zip(of, pitches, strict=True)]
        #: The table of `geodesic_state`, shape (rows, flights).
        self.table: FloatArray = geodesic_parameter_table(
            [start.lat_deg for start in of],
            lon.tolist(),
            [start.alt_m for start in of],
            headings,
            [start.speed_mps for start in of],
            [start.climb_mps for start in of],
        )
        #: The attitude that follows from the motion, shape (flights,).
        self.pitch_rad = np.array(pitches, dtype=np.float64)
        #: Fixed yaw, pitch and roll, NaN where the motion gives them, shape (3, flights).
        self.fixed_rad = np.array([_fixed(start) for start in of]).reshape(-1, 3).T.copy()
        self.max_speeds_mps = np.array(speeds, dtype=np.float64)

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


def flights_of(starts: Sequence[Start]) -> Sequence[ScriptedTrajectory]:
    """Return flights without legs, together where that can be, else each by itself.

    Raises
    ------
    ValueError
        A value that `ScriptedTrajectory` refuses.
    """
    if are_plain(starts):
        return StraightFlights(starts)
    return [ScriptedTrajectory(**asdict(start)) for start in starts]


def are_plain(starts: Iterable[Start]) -> bool:
    """Return whether all flights move, and have no value that `ScriptedTrajectory` refuses."""
    return all(
        start.speed_mps > 0.0
        and abs(start.lat_deg) <= 90.0
        and abs(start.alt_m) <= MOST_ALT_M
        and (start.end_time_s is None or start.end_time_s >= start.start_time_s)
        and isfinite(start.lon_deg)
        and all(
            value is None or isfinite(value)
            for value in (start.heading_deg, start.speed_mps, start.climb_mps, start.start_time_s,
                          start.yaw_deg, start.pitch_deg, start.roll_deg)
        )
        for start in starts
    )  # fmt: skip


def _fixed(start: Start) -> tuple[float, float, float]:
    yaw, pitch, roll = start.yaw_deg, start.pitch_deg, start.roll_deg
    return (
        nan if yaw is None else radians(yaw % 360.0),
        nan if pitch is None else radians(pitch),
        nan if roll is None else radians(roll),
    )
