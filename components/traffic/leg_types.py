"""The legs that a scripted flight is made of."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields


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
