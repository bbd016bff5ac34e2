"""Legs of a scripted flight, and the segments they become, each with an exact closed form."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated, Literal, Self

import numpy as np
from geographiclib.geodesic import Geodesic
from pydantic import Field, model_validator

from components.arguments.units import STANDARD_GRAVITY_M_S2
from components.flights.geodesic_motion import flight_time_s, geodesic_parameters, leg_radius_m
from components.flights.leg_motion import FORMULAS, Kind, Segment, turn_parameters
from components.geometry import enu_to_geodetic, heading_rad_from_deg
from dsa_des.arrays.types import FloatArray
from dsa_des.block.parameters import Parameters


def require(condition: bool, name: str, value: object, allowed: str) -> None:
    """Raise ValueError with an argument's name, value and what is allowed if a condition fails."""
    if not condition:
        raise ValueError(f"{name} is {value}: it must {allowed}")


class Leg(Parameters):
    """What all legs but those over waypoints have in common.

    The last leg is flown for ever; only it may leave its length out.
    """

    duration_s: float | None = Field(
        default=None, gt=0, description="Length of the leg, s; the last one is held for ever."
    )


class Straight(Leg):
    """Fly straight: along the geodesic of the ellipsoid, at constant ground speed at altitude."""

    kind: Literal["straight"] = "straight"
    heading_deg: float | None = Field(default=None, description="New heading, deg from north.")
    speed_mps: float | None = Field(default=None, ge=0, description="New ground speed, m/s.")
    climb_mps: float | None = Field(default=None, description="Rate of climb, m/s.")


class Turn(Leg):
    """Turn at a constant rate; positive is to the right."""

    kind: Literal["turn"] = "turn"
    rate_deg_s: float | None = Field(default=None, description="Rate of turn, deg/s.")
    radius_m: float | None = Field(default=None, description="Radius instead of a rate, m.")
    angle_deg: float | None = Field(default=None, gt=0, description="Angle to turn through, deg.")
    speed_mps: float | None = Field(default=None, ge=0, description="New ground speed, m/s.")
    climb_mps: float | None = Field(default=None, description="Rate of climb, m/s.")

    @model_validator(mode="after")
    def _check_keys(self) -> Self:
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
        return self


class Climb(Leg):
    """Climb or descend straight ahead, for a time or to an altitude, and level off there."""

    kind: Literal["climb"] = "climb"
    climb_mps: float = Field(description="Rate of climb, m/s.")
    to_alt_m: float | None = Field(default=None, description="Altitude to level off at, m.")
    speed_mps: float | None = Field(default=None, ge=0, description="New ground speed, m/s.")

    @model_validator(mode="after")
    def _check_end(self) -> Self:
        if self.duration_s is not None and self.to_alt_m is not None:
            raise ValueError(
                f"climb duration_s is {self.duration_s} and to_alt_m is {self.to_alt_m}: "
                "give one of the two"
            )
        return self


class Stationary(Leg):
    """Stay in place, keeping the heading; the next leg flies on at the speed before this one."""

    kind: Literal["stationary"] = "stationary"


class Waypoint(Parameters):
    """A place to fly over: degrees and metres, or an offset from the ownship's start.

    An altitude that is left out is the one before.
    """

    lat_deg: float | None = Field(default=None, ge=-90, le=90, description="Latitude, deg.")
    lon_deg: float | None = Field(default=None, description="Longitude, deg.")
    alt_m: float | None = Field(default=None, description="Altitude, m.")
    east_m: float | None = Field(default=None, description="Offset to the east, m.")
    north_m: float | None = Field(default=None, description="Offset to the north, m.")
    up_m: float | None = Field(default=None, description="Offset upward, m.")
    speed_mps: float | None = Field(default=None, gt=0, description="Ground speed to it, m/s.")

    @model_validator(mode="after")
    def _check_place(self) -> Self:
        geodetic = self.lat_deg is not None and self.lon_deg is not None
        offset = self.east_m is not None and self.north_m is not None
        offsets = (self.east_m, self.north_m, self.up_m)
        mixed = offsets if geodetic else (self.lat_deg, self.lon_deg, self.alt_m)
        if geodetic == offset or any(value is not None for value in mixed):
            raise ValueError(
                f"waypoint is ({self}): it must have lat_deg and lon_deg, or east_m and north_m"
            )
        return self


class Waypoints(Parameters):
    """Fly over waypoints one after the other, climbing evenly, straight between them.

    After the last one the aircraft keeps its heading and speed and flies level.
    """

    kind: Literal["waypoints"] = "waypoints"
    points: list[Waypoint] = Field(min_length=1, description="Waypoints in order.")
    speed_mps: float | None = Field(default=None, gt=0, description="Ground speed, m/s.")


AnyLeg = Annotated[Straight | Turn | Climb | Stationary | Waypoints, Field(discriminator="kind")]


Position = tuple[float, float, float]


class LegBuilder:
    """Turns a script of legs into segments in order, tracking position, heading and time."""

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
                duration = self._add_leg(leg)
                if duration is None and number < len(legs) - 1:
                    raise ValueError(
                        "duration_s is None: it must be given, only the last leg may go on for ever"
                    )
            except ValueError as error:
                raise ValueError(f"{self.name}: legs[{number}] ({leg.kind}): {error}") from error
        if not legs:
            self._add_straight(self.climb, None)
        elif isinstance(legs[-1], Waypoints) or getattr(legs[-1], "to_alt_m", None) is not None:
            self._add_straight(0.0, None)
        return self.segments

    def _add_leg(self, leg: AnyLeg) -> float | None:
        """Append a leg's segments; returns its duration (s), 0 for waypoints, None if endless."""
        if isinstance(leg, Stationary):
            return self._add_hold(0.0, 0.0, leg.duration_s)
        if leg.speed_mps is not None:
            self.speed = leg.speed_mps
        if isinstance(leg, Waypoints):
            for point in leg.points:
                self._add_waypoint(point)
            return 0.0
        climb = self.climb if leg.climb_mps is None else leg.climb_mps
        if isinstance(leg, Turn):
            return self._add_turn(leg, climb)
        if isinstance(leg, Climb):
            return self._add_straight(climb, self._time_to_climb(leg, climb))
        if leg.heading_deg is not None:
            self.heading = heading_rad_from_deg(leg.heading_deg)
        return self._add_straight(climb, leg.duration_s)

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

    def _add_straight(self, climb: float, duration: float | None) -> float | None:
        if self.speed == 0.0:
            return self._add_hold(climb, 0.0, duration)
        table = geodesic_parameters(*self.position, self.heading, self.speed, climb)
        return self._add_segment("geodesic", table, duration, math.atan2(climb, self.speed), 0.0)

    def _add_hold(self, climb: float, rate: float, duration: float | None) -> float | None:
        table = np.array([*self.position, climb, self.heading, rate])
        return self._add_segment("hold", table, duration, 0.0, 0.0)

    def _add_turn(self, leg: Turn, climb: float) -> float | None:
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
            return self._add_hold(climb, rate, duration)
        table = turn_parameters(*self.position, self.heading, self.speed, climb, rate)
        bank = math.atan2(self.speed * rate, STANDARD_GRAVITY_M_S2)
        return self._add_segment("turn", table, duration, math.atan2(climb, self.speed), bank)

    def _add_waypoint(self, point: Waypoint) -> None:
        if point.speed_mps is not None:
            self.speed = point.speed_mps
        if self.speed <= 0.0:
            raise ValueError(
                f"speed_mps is {self.speed:g}: it must be positive to reach a waypoint"
            )
        lat, lon, alt = self._position_of(point)
        line = Geodesic.WGS84.Inverse(self.position[0], self.position[1], lat, lon)
        distance, rise = line["s12"], alt - self.position[2]
        if distance < 1e-3:
            if abs(rise) < 1e-3:
                return
            raise ValueError(
                f"waypoint ({point}) lies straight above or below the place before it: use a "
                "climb leg with a speed_mps of 0"
            )
        self.heading = heading_rad_from_deg(line["azi1"])
        level = geodesic_parameters(*self.position, self.heading, self.speed, 0.0)
        duration = flight_time_s(distance, self.speed, self.position[2], alt, leg_radius_m(level))
        self._add_straight(rise / duration, duration)
        self.position = (lat, lon, alt)

    def _position_of(self, point: Waypoint) -> Position:
        """Return a waypoint's latitude, longitude (deg), altitude (m), its own or the previous."""
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

    def _add_segment(
        self, kind: Kind, table: FloatArray, duration: float | None, pitch: float, roll: float
    ) -> float | None:
        """Append a segment and move the builder to its end."""
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


def segments_of_each(
    start: Sequence[FloatArray], heading_rad: FloatArray, legs: Sequence[Sequence[Straight | Turn]]
) -> list[list[Segment]]:
    """Return the segments of several flights from their starts (n,), as `LegBuilder` makes them.

    Every leg has its speed and its climb, and every turn its rate.
    """
    here, times_s = np.stack([*start, heading_rad]), [0.0] * len(legs)
    segments: list[list[Segment]] = [[] for _ in legs]
    for number in range(max(map(len, legs), default=0)):
        alike: dict[Kind, list[int]] = {}
        for k, mine in enumerate(legs):
            if number < len(mine) and mine[number].duration_s != 0.0:
                alike.setdefault(_kind_of(mine[number]), []).append(k)
        for kind, flown in alike.items():
            now = [legs[k][number] for k in flown]
            rates = [math.radians(getattr(leg, "rate_deg_s", None) or 0.0) for leg in now]
            motion = [(leg.speed_mps or 0.0, leg.climb_mps or 0.0) for leg in now]
            speed, climb, rate = (np.array(of) for of in (*zip(*motion, strict=True), rates))
            lat, lon, alt, heading = here[:, flown]
            if kind == "hold":
                table = np.stack([lat, lon, alt, climb, heading, rate])
            elif kind == "turn":
                table = turn_parameters(lat, lon, alt, heading, speed, climb, rate)
            else:
                table = geodesic_parameters(lat, lon, alt, heading, speed, climb)
            for column, (k, leg) in enumerate(zip(flown, now, strict=True)):
                mps, climb_mps = motion[column]
                pitch = bank = 0.0
                if kind != "hold":
                    pitch = math.atan2(climb_mps, mps)
                    bank = math.atan2(mps * rates[column], STANDARD_GRAVITY_M_S2)
                along = abs(climb_mps) if kind == "hold" else mps / math.cos(pitch)
                own = np.ascontiguousarray(table[:, column])
                segments[k].append(Segment(kind, times_s[k], own, pitch, bank, along))
                times_s[k] += leg.duration_s or 0.0
            some = [column for column, leg in enumerate(now) if leg.duration_s is not None]
            if some:
                # The clock's own difference, so that the next leg starts exactly where this one is.
                elapsed_s = [times_s[flown[j]] - segments[flown[j]][-1].start_s for j in some]
                ends = FORMULAS[kind](np.ascontiguousarray(table[:, some]), np.array(elapsed_s))
                here[:, [flown[j] for j in some]] = ends
    return segments


def _kind_of(leg: Straight | Turn) -> Kind:
    if not leg.speed_mps:
        return "hold"
    return "turn" if isinstance(leg, Turn) else "geodesic"
