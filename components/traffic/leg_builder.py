"""Turn a list of legs into segments that can each be evaluated at any time."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from geographiclib.geodesic import Geodesic

from components.geometry.angles import TWO_PI, FloatArray, heading_from_deg, past
from components.geometry.ellipsoid import enu_to_geodetic
from components.traffic.attitude_from_path import STANDARD_GRAVITY_MPS2
from components.traffic.geodesic_motion import (
    flight_time_s,
    geodesic_parameters,
    geodesic_state,
    leg_radius_m,
)
from components.traffic.leg_types import AnyLeg, Climb, Stationary, Turn, Waypoint, Waypoints
from components.traffic.turn_motion import turn_parameters, turn_state

Position = tuple[float, float, float]
Kind = Literal["geodesic", "turn", "hold"]


@dataclass(frozen=True)
class Segment:
    """One leg, ready to be evaluated.

    Parameters
    ----------
    kind : {"geodesic", "turn", "hold"}
        Which formula; "hold" stays over one place, and may climb and turn on the spot.
    start_s : float
        When it begins, since the start of the flight.
    parameters : ndarray
        The formula's table. For "hold": lat_deg, lon_deg, alt_m, climb_mps, yaw_rad, rate_rad_s.
    pitch_rad, roll_rad : float
        The attitude that follows from the motion.
    speed_mps : float
        Along the path, climb included.
    """

    kind: Kind
    start_s: float
    parameters: FloatArray
    pitch_rad: float
    roll_rad: float
    speed_mps: float


def hold_state(
    table: FloatArray, elapsed: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Evaluate aircraft that stay over one place; see `Segment` for the table's rows."""
    zero = np.zeros_like(elapsed)
    # Reduced before the sum, so that hours of turning keep their digits and stay in [0, 2 pi).
    yaw = past(table[4] + table[5] * elapsed, TWO_PI)
    return zero + table[0], zero + table[1], table[2] + table[3] * elapsed, yaw


FORMULAS = {"geodesic": geodesic_state, "turn": turn_state, "hold": hold_state}


def segment_state(segment: Segment, elapsed: FloatArray) -> tuple[FloatArray, ...]:
    """Evaluate one segment at times since its start.

    Parameters
    ----------
    segment : Segment
        Which.
    elapsed : ndarray, shape (m,)
        Seconds.

    Returns
    -------
    lat_deg, lon_deg, alt_m, yaw_rad, pitch_rad, roll_rad : ndarray, shape (m,)
    """
    state = FORMULAS[segment.kind](segment.parameters[:, np.newaxis], elapsed)
    pitch, roll = (np.full_like(elapsed, a) for a in (segment.pitch_rad, segment.roll_rad))
    return (*state, pitch, roll)


class LegBuilder:
    """Flies the script once, leg by leg, noting where each leg starts.

    Parameters
    ----------
    name : str
        The aircraft, for messages.
    start : tuple of three float
        Latitude, longitude (degrees) and altitude (metres).
    heading_rad, speed_mps, climb_mps : float
        At the start.
    reference : tuple of three float
        Where offsets of waypoints are measured from.
    """

    def __init__(
        self,
        name: str,
        start: Position,
        heading_rad: float,
        speed_mps: float,
        climb_mps: float,
        reference: Position,
    ) -> None:
        self.name, self.reference = name, reference
        self.position, self.heading = start, heading_rad
        self.speed, self.climb = speed_mps, climb_mps
        self.time = 0.0
        self.segments: list[Segment] = []

    def build(self, legs: Sequence[AnyLeg]) -> list[Segment]:
        """Return the segments; the last one never ends."""
        for number, leg in enumerate(legs):
            try:
                duration = self._fly(leg)
                if duration is None and number < len(legs) - 1:
                    raise ValueError(
                        "duration_s is None: it must be given, only the last leg may go on for ever"
                    )
            except ValueError as error:
                kind = type(leg).__name__.lower()
                raise ValueError(f"{self.name}: legs[{number}] ({kind}): {error}") from error
        if not legs:
            self._straight(self.climb, None)
        elif isinstance(legs[-1], Waypoints) or getattr(legs[-1], "to_alt_m", None) is not None:
            self._straight(0.0, None)
        return self.segments

    def _fly(self, leg: AnyLeg) -> float | None:
        """Add a leg's segments; returns how long they last, None for ever."""
        if leg.speed_mps is not None and not isinstance(leg, Stationary):
            self.speed = leg.speed_mps
        if isinstance(leg, Waypoints):
            for point in leg.points:
                self._to_waypoint(point)
            return 0.0
        climb = self.climb if leg.climb_mps is None else leg.climb_mps
        if isinstance(leg, Stationary):
            climb = 0.0 if leg.climb_mps is None else leg.climb_mps
            return self._hold(climb, 0.0, leg.duration_s)
        if isinstance(leg, Turn):
            return self._turn(leg, climb)
        if isinstance(leg, Climb):
            return self._straight(climb, self._time_to_climb(leg, climb))
        if leg.heading_deg is not None:
            self.heading = heading_from_deg(leg.heading_deg)
        return self._straight(climb, leg.duration_s)

    def _time_to_climb(self, leg: Climb, climb: float) -> float | None:
        if leg.to_alt_m is None:
            return leg.duration_s
        rise = leg.to_alt_m - self.position[2]
        if rise == 0.0:
            return 0.0
        if rise * climb <= 0.0:
            raise ValueError(
                f"climb_mps is {climb:g}: it must lead from {self.position[2]:g} m "
                f"to {leg.to_alt_m:g} m"
            )
        return rise / climb

    def _straight(self, climb: float, duration: float | None) -> float | None:
        if self.speed == 0.0:
            return self._hold(climb, 0.0, duration)
        table = geodesic_parameters(*self.position, self.heading, self.speed, climb)
        return self._add("geodesic", table, duration, math.atan2(climb, self.speed), 0.0)

    def _hold(self, climb: float, rate: float, duration: float | None) -> float | None:
        table = np.array([*self.position, climb, self.heading, rate])
        return self._add("hold", table, duration, 0.0, 0.0)

    def _turn(self, leg: Turn, climb: float) -> float | None:
        if leg.radius_m is not None:
            rate = self.speed / leg.radius_m
            if rate == 0.0:
                raise ValueError("speed_mps is 0: a turn of a given radius needs a speed")
        else:
            rate = math.radians(leg.rate_deg_s or 0.0)
        duration = leg.duration_s
        if leg.angle_deg is not None:
            duration = math.radians(leg.angle_deg) / abs(rate)
        if self.speed == 0.0:
            return self._hold(climb, rate, duration)
        table = turn_parameters(*self.position, self.heading, self.speed, climb, rate)
        bank = math.atan2(self.speed * rate, STANDARD_GRAVITY_MPS2)
        return self._add("turn", table, duration, math.atan2(climb, self.speed), bank)

    def _to_waypoint(self, point: Waypoint) -> None:
        if point.speed_mps is not None:
            self.speed = point.speed_mps
        if self.speed <= 0.0:
            raise ValueError(
                f"speed_mps is {self.speed:g}: it must be positive to reach a waypoint"
            )
        lat, lon, alt = self._place(point)
        line = Geodesic.WGS84.Inverse(self.position[0], self.position[1], lat, lon)
        distance, rise = line["s12"], alt - self.position[2]
        if distance < 1e-3:
            if abs(rise) < 1e-3:
                return
            raise ValueError(
                f"waypoint {point} lies straight above or below the place before it: use a "
                "stationary leg with climb_mps"
            )
        self.heading = heading_from_deg(line["azi1"])
        level = geodesic_parameters(*self.position, self.heading, self.speed, 0.0)
        duration = flight_time_s(distance, self.speed, self.position[2], alt, leg_radius_m(level))
        self._straight(rise / duration, duration)
        self.position = (lat, lon, alt)

    def _place(self, point: Waypoint) -> Position:
        """Find a waypoint's geodetic position; an altitude left out is the one before."""
        before = self.position[2]
        if point.lat_deg is not None and point.lon_deg is not None:
            return point.lat_deg, point.lon_deg, before if point.alt_m is None else point.alt_m
        lat, lon, alt = enu_to_geodetic(
            point.east_m or 0.0,
            point.north_m or 0.0,
            point.up_m or 0.0,
            reference_lat_deg=self.reference[0],
            reference_lon_deg=self.reference[1],
            reference_alt_m=self.reference[2],
        )
        return float(lat), float(lon), before if point.up_m is None else float(alt)

    def _add(
        self, kind: Kind, table: FloatArray, duration: float | None, pitch: float, roll: float
    ) -> float | None:
        """Note a segment and move to its end."""
        if duration == 0.0:
            return duration
        # A hold's table has its climb in row 3; elsewhere the pitch is that of the path.
        speed = abs(float(table[3])) if kind == "hold" else self.speed / math.cos(pitch)
        segment = Segment(kind, self.time, table, pitch, roll, speed)
        self.segments.append(segment)
        if duration is not None:
            self.time += duration
            # The clock's own difference, so that the next leg starts exactly where this one is.
            elapsed = np.array([self.time - segment.start_s])
            lat, lon, alt, yaw = (float(v[0]) for v in segment_state(segment, elapsed)[:4])
            self.position, self.heading = (lat, lon, alt), yaw
        return duration
