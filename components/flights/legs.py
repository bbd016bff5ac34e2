"""Legs of a scripted flight, and the segments they become, each with an exact closed form."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
from geographiclib.geodesic import Geodesic

from components.flights.attitude import STANDARD_GRAVITY_MPS2
from components.flights.geodesic_motion import flight_time_s, geodesic_parameters, leg_radius_m
from components.flights.leg_motion import FORMULAS, Kind, Segment, turn_parameters
from components.geometry import enu_to_geodetic, heading_from_deg
from dsa_des.arrays.types import FloatArray


def require(condition: bool, name: str, value: object, allowed: str) -> None:
    """Raise ValueError with the argument's name, its value and what is allowed."""
    if not condition:
        raise ValueError(f"{name} is {value}: it must {allowed}")


@dataclass(frozen=True)
class Leg:
    """What all legs have in common.

    Parameters
    ----------
    duration_s : float, optional
        How long the leg lasts. Only the last leg may leave it out; the last leg is flown for
        ever in any case.
    speed_mps : float, optional
        Ground speed at flight altitude, from this leg on. Left out: as before.
    climb_mps : float, optional
        Rate of climb during this leg. Left out: the trajectory's own.
    """

    duration_s: float | None = None
    speed_mps: float | None = None
    climb_mps: float | None = None

    def __post_init__(self) -> None:
        kind = type(self).__name__.lower()
        for field in fields(self):
            value = getattr(self, field.name)
            if isinstance(value, float | int):
                name = f"{kind} {field.name}"
                require(math.isfinite(value), name, value, "be finite")
                if field.name in ("duration_s", "angle_deg"):
                    require(value > 0.0, name, value, "be positive")
                if field.name == "speed_mps":
                    require(value >= 0.0, name, value, "be 0 or more")


@dataclass(frozen=True)
class Straight(Leg):
    """Fly straight: along the geodesic of the ellipsoid, at constant ground speed.

    Parameters
    ----------
    heading_deg : float, optional
        Heading at the start of the leg, clockwise from true north. Left out: straight on.
    """

    heading_deg: float | None = None


@dataclass(frozen=True)
class Turn(Leg):
    """Turn at a constant rate.

    Parameters
    ----------
    rate_deg_s : float, optional
        Rate of turn, positive to the right.
    radius_m : float, optional
        Instead of the rate: radius, positive to the right.
    angle_deg : float, optional
        Instead of the duration: how far to turn, positive whichever way.
    """

    rate_deg_s: float | None = None
    radius_m: float | None = None
    angle_deg: float | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if (self.rate_deg_s is None) == (self.radius_m is None):
            raise ValueError(
                f"turn rate_deg_s is {self.rate_deg_s} and radius_m is {self.radius_m}: "
                "give one of the two"
            )
        if self.duration_s is not None and self.angle_deg is not None:
            raise ValueError(
                f"turn duration_s is {self.duration_s} and angle_deg is {self.angle_deg}: "
                "give one of the two"
            )
        require(self.rate_deg_s != 0.0, "turn rate_deg_s", self.rate_deg_s, "not be 0")
        require(self.radius_m != 0.0, "turn radius_m", self.radius_m, "not be 0")


@dataclass(frozen=True)
class Climb(Leg):
    """Fly straight on with a rate of climb, for a time or up (or down) to an altitude.

    Parameters
    ----------
    to_alt_m : float, optional
        Instead of the duration: the altitude to reach. If this is the last leg the aircraft
        levels off there.
    """

    to_alt_m: float | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        require(self.climb_mps is not None, "climb climb_mps", self.climb_mps, "be given")
        if self.duration_s is not None and self.to_alt_m is not None:
            raise ValueError(
                f"climb duration_s is {self.duration_s} and to_alt_m is {self.to_alt_m}: "
                "give one of the two"
            )


@dataclass(frozen=True)
class Stationary(Leg):
    """Stay where we are, keeping the heading; the next leg flies on at the speed before it."""

    def __post_init__(self) -> None:
        super().__post_init__()
        require(not self.speed_mps, "stationary speed_mps", self.speed_mps, "be 0 or left out")


@dataclass(frozen=True)
class Waypoint:
    """A place to fly over: latitude, longitude, altitude, or offsets from the reference point.

    Parameters
    ----------
    lat_deg, lon_deg, alt_m : float, optional
        Geodetic position. Altitude left out: the one before.
    east_m, north_m, up_m : float, optional
        Instead: offsets in the reference point's tangent frame. Up left out: the altitude before.
    speed_mps : float, optional
        Ground speed on the way *to* this waypoint, and from then on.
    """

    lat_deg: float | None = None
    lon_deg: float | None = None
    alt_m: float | None = None
    east_m: float | None = None
    north_m: float | None = None
    up_m: float | None = None
    speed_mps: float | None = None

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if value is not None:
                require(math.isfinite(value), f"waypoint {field.name}", value, "be finite")
        geodetic = self.lat_deg is not None and self.lon_deg is not None
        offset = self.east_m is not None and self.north_m is not None
        offsets = (self.east_m, self.north_m, self.up_m)
        mixed = offsets if geodetic else (self.lat_deg, self.lon_deg, self.alt_m)
        if geodetic == offset or any(value is not None for value in mixed):
            raise ValueError(
                f"waypoint is {self}: it must have lat_deg and lon_deg, or east_m and north_m"
            )
        if self.lat_deg is not None:
            require(abs(self.lat_deg) <= 90.0, "waypoint lat_deg", self.lat_deg, "lie in [-90, 90]")


@dataclass(frozen=True)
class Waypoints:
    """Fly over waypoints one after the other, climbing evenly, straight between them.

    After the last one the aircraft keeps its heading and speed and flies level.

    Parameters
    ----------
    points : tuple of Waypoint
        At least one.
    speed_mps : float, optional
        Ground speed from this leg on, unless a waypoint says otherwise.
    """

    points: tuple[Waypoint, ...]
    speed_mps: float | None = None

    def __post_init__(self) -> None:
        require(len(self.points) > 0, "waypoints points", self.points, "hold at least one")


AnyLeg = Straight | Turn | Climb | Stationary | Waypoints


Position = tuple[float, float, float]


class LegBuilder:
    """Flies the script once, leg by leg, noting where each leg starts."""

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
            state = FORMULAS[kind](table[:, np.newaxis], elapsed)
            lat, lon, alt, yaw = (float(v[0]) for v in state)
            self.position, self.heading = (lat, lon, alt), yaw
        return duration
