"""Scripted traffic: flights written in the scene (``traffic.scripted``)."""

import math
from collections.abc import Callable, Sequence
from typing import Any, Self, cast

import numpy as np
from pydantic import Field, model_validator

from components.aircraft.aircraft import OWNSHIP, Aircraft, Roster, merge_replica_rosters
from components.atmosphere.pressure_altitude import Air
from components.flights.attitude import Wind, ground_speed_mps
from components.flights.closest_approach import RegularTimes, SampleTimes
from components.flights.legs import AnyLeg, Position, Waypoints
from components.flights.many_flights import straight_fleet
from components.flights.scripted_flights import ScriptedFleet, ScriptedTrajectory
from components.geometry import enu_to_geodetic
from components.traffic.flown_flights import FlightsOfRuns
from components.traffic.heights import Heights
from components.traffic.overhead_wires import NO_AREAS, OverheadWire
from components.traffic.source import SourceParameters, TrafficSource
from components.traffic.wind_effect import CrabAngles
from dsa_des.arrays.types import FloatArray
from dsa_des.block.component import Parameters


class Flight(Heights):
    """How an aircraft starts and flies; without legs it flies straight on for ever."""

    alt_m: float | None = Field(default=None, description="Altitude at the start, m.")
    heading_deg: float = Field(
        default=0.0, description="Track over the ground at the start, deg from north."
    )
    speed_mps: float = Field(default=0.0, ge=0, description="Ground speed, m/s.")
    airspeed_mps: float | None = Field(
        default=None,
        gt=0,
        description="Level airspeed in place of speed_mps: the ground speed along heading_deg "
        "follows from the wind; for flights without legs, m/s.",
    )
    climb_mps: float = Field(default=0.0, description="Rate of climb, m/s.")
    yaw_deg: float | None = Field(
        default=None, ge=-360, le=360, description="Fixed yaw; else the track, deg."
    )
    pitch_deg: float | None = Field(
        default=None, ge=-90, le=90, description="Fixed pitch; else the path, deg."
    )
    roll_deg: float | None = Field(
        default=None,
        ge=-360,
        le=360,
        description="Fixed roll; else the bank of a coordinated turn, deg.",
    )
    legs: list[AnyLeg] = Field(default=[], description="What it does, one after the other.")

    @model_validator(mode="after")
    def _check_one_speed(self) -> Self:
        if self.airspeed_mps is not None and self.legs:
            raise ValueError(
                f"airspeed_mps is {self.airspeed_mps:g} and there are legs: their speeds are over "
                "the ground, give speed_mps"
            )
        if self.airspeed_mps is not None and self.speed_mps:
            raise ValueError(
                f"airspeed_mps is {self.airspeed_mps:g} and speed_mps is {self.speed_mps:g}: only "
                "one of them may be given"
            )
        return self

    def with_ellipsoid_heights(self, air: Air | None) -> Self:
        """Return a copy of the flight in the scene's air, its altitudes converted to heights."""
        if air is None or self.heights == "geometric":
            return self

        def replace_altitude(one: Any, key: str) -> Any:
            if getattr(one, key, None) is None:
                return one
            return one.model_copy(
                update={key: float(self.height_above_ellipsoid_m(air, getattr(one, key)))}
            )

        legs = [
            leg.model_copy(
                update={"points": [replace_altitude(point, "alt_m") for point in leg.points]}
            )
            if isinstance(leg, Waypoints) else replace_altitude(leg, "to_alt_m")
            for leg in self.legs
        ]  # fmt: skip
        return cast(Self, replace_altitude(self.model_copy(update={"legs": legs}), "alt_m"))


class Ownship(Flight, Aircraft):
    """Start, flight and properties of the ownship as written in a scene."""

    name: str = Field(default=OWNSHIP, min_length=1, description="Name by which others know it.")
    lat_deg: float = Field(ge=-90, le=90, description="Latitude at the start, deg.")
    lon_deg: float = Field(description="Longitude at the start, deg.")
    alt_m: float = Field(description="Altitude at the start, m.")

    @property
    def start(self) -> Position:
        """Latitude (deg), longitude (deg) and altitude (m) of the start."""
        return self.lat_deg, self.lon_deg, self.alt_m


class Intruder(Flight, Aircraft):
    """An intruder: a name, a start, a flight and what sensors need to know of it."""

    name: str = Field(min_length=1, description="Name; keys its random draws.")
    lat_deg: float | None = Field(default=None, ge=-90, le=90, description="Latitude, deg.")
    lon_deg: float | None = Field(default=None, description="Longitude, deg.")
    east_m: float | None = Field(default=None, description="Start east of the ownship's, m.")
    north_m: float | None = Field(default=None, description="Start north of the ownship's, m.")
    up_m: float | None = Field(default=None, description="Start above the ownship's, m.")
    start_time_s: float = Field(default=0.0, ge=0, description="When it appears, s.")
    end_time_s: float | None = Field(default=None, ge=0, description="When it leaves, s.")


class Site(Parameters):
    """A stationary place on the ground that may carry blocks and is invisible to sensors."""

    name: str = Field(min_length=1, description="Name.")
    lat_deg: float | None = Field(default=None, ge=-90, le=90, description="Latitude, deg.")
    lon_deg: float | None = Field(default=None, description="Longitude, deg.")
    east_m: float | None = Field(default=None, description="East of the ownship's start, m.")
    north_m: float | None = Field(default=None, description="North of the ownship's start, m.")
    alt_m: float | None = Field(default=None, description="Height above the ellipsoid, m.")
    above_ground_m: float | None = Field(
        default=None, gt=0, description="Height above the ground of [terrain], m."
    )
    yaw_deg: float = Field(default=0.0, ge=-360, le=360, description="Where its axis points, deg.")
    pitch_deg: float = Field(default=0.0, ge=-90, le=90, description="How far that is up, deg.")
    roll_deg: float = Field(default=0.0, ge=-360, le=360, description="Turn about that axis, deg.")

    def to_intruder(self, own: Position, terrain: Any) -> "Intruder":
        """Return the site as a static intruder; offsets count from the ownship's start `own`."""
        place, offset = (self.lat_deg, self.lon_deg), (self.east_m, self.north_m)
        given, other = (offset, place) if place == (None, None) else (place, offset)
        if None in given or other != (None, None):
            raise ValueError(
                f"site {self.name!r}: its place must be given as lat_deg and lon_deg, or as east_m "
                "and north_m from the ownship's start"
            )
        lat_deg, lon_deg = (part or 0.0 for part in given)
        if given is offset:
            lat_deg, lon_deg, _ = (
                float(part)
                for part in enu_to_geodetic(
                    lat_deg, lon_deg, 0.0, reference_lat_deg=own[0], reference_lon_deg=own[1],
                    reference_alt_m=own[2],
                )
            )  # fmt: skip
        alt_m = self.alt_m
        if (alt_m is None) == (self.above_ground_m is None):
            raise ValueError(
                f"site {self.name!r}: its height must be given as alt_m, or as above_ground_m"
            )
        if self.above_ground_m is not None:
            ground_m = None if terrain is None else terrain.ground_height_m(lat_deg, lon_deg)
            if ground_m is None:
                raise ValueError(
                    f"site {self.name!r}: above_ground_m is {self.above_ground_m:g} and [terrain] "
                    f"knows no ground at {lat_deg:.6g}, {lon_deg:.6g}: give alt_m, or a raster or "
                    "height_m there"
                )
            alt_m = ground_m + self.above_ground_m
        attitude = {
            f"{name}_deg": getattr(self, f"{name}_deg") for name in ("yaw", "pitch", "roll")
        }
        return Intruder(
            name=self.name, lat_deg=lat_deg, lon_deg=lon_deg, alt_m=alt_m, **attitude, **_UNSEEN
        )


#: Of an aircraft that no sensor can see.
_UNSEEN: dict[str, Any] = {
    "rcs_dbsm": -100.0, "swerling": 0, "eo": NO_AREAS, "ir": {**NO_AREAS, "back_m2": 0.0},
}  # fmt: skip


class ScriptedParameters(SourceParameters):
    """Parameters of scripted traffic."""

    ownship: Ownship = Field(description="The ownship.")
    intruders: list[Intruder] = Field(default=[], description="Any number of intruders.")
    wires: list[OverheadWire] = Field(
        default=[], description="Wires between posts, in the way at rest."
    )
    sites: list[Site] = Field(default=[], description="Places on the ground that may carry blocks.")
    sample_interval_s: float = Field(
        default=0.1,
        ge=0.001,
        le=86400,
        description="Spacing of the samples at which closest approach is sought, s.",
    )

    def with_ellipsoid_heights(self, air: Air | None) -> Self:
        """Return a copy in the scene's air: all flights' altitudes are above the ellipsoid."""
        if air is None:
            return self
        flights = [one.with_ellipsoid_heights(air) for one in self.intruders]
        return self.model_copy(
            update={"ownship": self.ownship.with_ellipsoid_heights(air), "intruders": flights}
        )

    def targets(self, terrain: Any) -> list[Intruder]:
        """Return all targets as intruders: intruders, pieces of wires, and sites (stationary)."""
        pieces = [Intruder(**piece) for wire in self.wires for piece in wire.piece_intruder_keys()]
        sites = [site.to_intruder(self.ownship.start, terrain) for site in self.sites]
        return self.intruders + pieces + sites


class ScriptedTraffic(TrafficSource):
    """Ownship and intruders on flights written in the scene: legs, turns, climbs, waypoints."""

    Parameters = ScriptedParameters
    lockstep = True
    effects = (CrabAngles(),)

    def __init__(self, name: str, parameters: Any, context: Any) -> None:
        super().__init__(name, parameters, context)
        parameters = parameters.with_ellipsoid_heights(self.air)
        own = parameters.ownship
        self.own = scripted_flight(own, own.start, self.wind)
        crafts = parameters.targets(self.context.sections.get("terrain"))
        self.unseen = tuple(range(len(crafts) - len(parameters.sites), len(crafts)))
        used: set[str] = set()
        for place, craft in enumerate(crafts):
            if craft.name in used:
                key = f"intruders[{place}].name" if place < len(parameters.intruders) else "wires"
                raise ValueError(f"{key}: the name {craft.name!r} is used more than once")
            used.add(craft.name)
        self.targets = _intruder_fleet(crafts, own.start, self.wind)
        self.roster = Roster.from_pairs([(craft.name, craft) for craft in crafts], (own.name, own))

    def flights_of_runs(
        self, parameters: Sequence[Any], make: Callable[[int], Any]
    ) -> FlightsOfRuns | None:
        """Return many runs' flights, computed together if all straight; None if rosters differ."""
        parameters = [p.with_ellipsoid_heights(self.air) for p in parameters]
        own = [p.ownship for p in parameters]
        terrain = self.context.sections.get("terrain")
        crafts = [craft for p in parameters for craft in p.targets(terrain)]
        width = len(self.roster)
        if len(crafts) != width * len(own) or any(flight.legs for flight in (*own, *crafts)):
            return super().flights_of_runs(parameters, make)
        roster = merge_replica_rosters(
            self.roster, *([(one.name, one) for one in of] for of in (crafts, own))
        )
        if roster is None:
            return None
        origins = np.array([flight.start for flight in own], dtype=np.float64)
        starts = _start_positions(crafts, np.repeat(origins, width, axis=0))
        ownships, targets = (
            _straight_fleet(own, origins, self.wind),
            _straight_fleet(crafts, starts, self.wind),
        )
        return FlightsOfRuns(ownships, targets, roster)

    def sample_times(self) -> list[SampleTimes]:
        """Return regular sample times over the whole run, at the interval that the scene states."""
        return [RegularTimes(self.p.sample_interval_s, float(self.context.duration_s))]


def initial_ground_speed_mps(flight: Flight, name: str, wind: Wind | None) -> float:
    """Return a flight's initial ground speed, m/s: given, or from airspeed, heading and wind."""
    if flight.airspeed_mps is None:
        return flight.speed_mps
    if wind is None:
        return flight.airspeed_mps
    try:
        return ground_speed_mps(math.radians(flight.heading_deg), flight.airspeed_mps, wind)
    except ValueError as error:
        raise ValueError(f"{name}: {error}") from None


def scripted_flight(
    flight: Flight, start: Position, wind: Wind | None, reference: Position | None = None
) -> ScriptedTrajectory:
    """Return the trajectory of a scene's flight from `start` (latitude, longitude, height)."""
    lat_deg, lon_deg, alt_m = start
    return ScriptedTrajectory(
        _name_or_ownship(flight),
        lat_deg=lat_deg,
        lon_deg=lon_deg,
        alt_m=alt_m,
        heading_deg=flight.heading_deg,
        speed_mps=initial_ground_speed_mps(flight, _name_or_ownship(flight), wind),
        climb_mps=flight.climb_mps,
        yaw_deg=flight.yaw_deg,
        pitch_deg=flight.pitch_deg,
        roll_deg=flight.roll_deg,
        legs=flight.legs,
        reference=reference,
        start_time_s=getattr(flight, "start_time_s", 0.0),
        end_time_s=getattr(flight, "end_time_s", None),
    )


def _intruder_fleet(
    crafts: Sequence[Intruder], reference: Position, wind: Wind | None
) -> ScriptedFleet:
    """Return the flights of all intruders, whose offsets count from `reference`."""
    starts = _start_positions(crafts, np.tile(np.array(reference), (len(crafts), 1)))
    if not any(craft.legs for craft in crafts):
        return _straight_fleet(crafts, starts, wind)
    return ScriptedFleet(
        [scripted_flight(craft, tuple(at), wind, reference)
         for craft, at in zip(crafts, starts.tolist(), strict=True)]
    )  # fmt: skip


def _start_positions(crafts: Sequence[Intruder], references: FloatArray) -> FloatArray:
    """Return intruders' start latitude, longitude, height (n, 3), offset from references (n, 3)."""
    starts: FloatArray = np.zeros((len(crafts), 3))
    relative = np.zeros(len(crafts), dtype=bool)
    for number, craft in enumerate(crafts):
        geodetic = (craft.lat_deg, craft.lon_deg, craft.alt_m)
        offset = (craft.east_m, craft.north_m, craft.up_m)
        relative[number] = geodetic == (None, None, None)
        given, other = (offset, geodetic) if relative[number] else (geodetic, offset)
        if other != (None, None, None) or None in (given[:2] if relative[number] else given):
            raise ValueError(
                f"intruder {craft.name!r}: its start must be given as lat_deg, lon_deg and alt_m, "
                "or as east_m, north_m and up_m from the ownship's start"
            )
        starts[number] = [part or 0.0 for part in given]
    lat_deg, lon_deg, alt_m = references[relative].T
    starts[relative] = np.stack(
        enu_to_geodetic(
            *starts[relative].T, reference_lat_deg=lat_deg, reference_lon_deg=lon_deg,
            reference_alt_m=alt_m,
        ),
        axis=-1,
    )  # fmt: skip
    return starts


def _straight_fleet(
    crafts: Sequence[Flight], starts: FloatArray, wind: Wind | None
) -> ScriptedFleet:
    """Return straight flights that begin at positions (n, 3: latitude, longitude, height)."""
    lat_deg, lon_deg, alt_m = starts.T.copy()

    def column(name: str, default: float = 0.0) -> FloatArray:
        values = [getattr(craft, name, None) for craft in crafts]
        return np.array([default if v is None else v for v in values], dtype=np.float64)

    return straight_fleet(
        [_name_or_ownship(craft) for craft in crafts], lat_deg=lat_deg, lon_deg=lon_deg,
        alt_m=alt_m,
        speed_mps=np.array([initial_ground_speed_mps(craft, _name_or_ownship(craft),
        wind) for craft in crafts]),
        **{name: column(name) for name in ("heading_deg", "climb_mps", "start_time_s")},
        end_time_s=column("end_time_s", np.inf),
        fixed_deg=np.stack([column(f"{angle}_deg", np.nan) for angle in ("yaw", "pitch", "roll")]),
    )  # fmt: skip


def _name_or_ownship(flight: Flight) -> str:
    return getattr(flight, "name", "ownship")
