"""Random traffic: many intruders that cross a region in straight flight (``traffic.random``).

For studies of density and for benchmarks. Every draw is keyed by the intruder's name, so that more
intruders leave the first ones where they were.
"""

import math
from typing import Any, Self

import numpy as np
from pydantic import Field, model_validator

from components.aircraft.aircraft import Aircraft, Roster
from components.aircraft.equipage import EquipageShares, draw_equipage
from components.flights.closest_approach import RegularTimes, SampleTimes
from components.flights.many_flights import straight_fleet
from components.geometry import enu_to_geodetic
from components.traffic.scripted import Ownship, scripted_flight
from components.traffic.source import SourceParameters, TrafficSource
from components.traffic.wind_effect import CrabAngles
from dsa_des.time.randomness import target_keys


class RandomTrafficParameters(SourceParameters):
    """Parameters of random traffic."""

    ownship: Ownship = Field(description="The ownship.")
    intruders: int = Field(ge=1, le=1_000_000, description="How many intruders.")
    radius_km: float = Field(
        gt=0, le=2000, description="They start evenly spread over a disc of this radius, km."
    )
    altitude_spread_m: float = Field(
        default=300.0, ge=0, description="Largest difference from the ownship's altitude, m."
    )
    speed_min_mps: float = Field(default=40.0, ge=0, description="Slowest ground speed, m/s.")
    speed_max_mps: float = Field(default=120.0, ge=0, description="Fastest ground speed, m/s.")
    aircraft: Aircraft = Field(default=Aircraft(), description="What all of them are.")
    equipage_shares: EquipageShares = Field(
        default=EquipageShares(), description="Shares of them that carry the aircraft's equipage."
    )
    sample_interval_s: float = Field(
        default=1.0,
        ge=0.001,
        le=86400,
        description="Spacing of the samples at which closest approach is sought, s.",
    )

    @model_validator(mode="after")
    def _check_order(self) -> Self:
        if self.speed_max_mps < self.speed_min_mps:
            raise ValueError(
                f"speed_max_mps is {self.speed_max_mps:g}: it must be at least speed_min_mps, "
                f"{self.speed_min_mps:g}"
            )
        return self


class RandomTraffic(TrafficSource):
    """Intruders that start evenly spread over a disc around the ownship and fly straight on."""

    Parameters = RandomTrafficParameters
    effects = (CrabAngles(),)

    def __init__(self, name: str, parameters: Any, context: Any) -> None:
        super().__init__(name, parameters, context)
        p = parameters
        own = p.ownship.with_ellipsoid_heights(self.air)
        self.own = scripted_flight(own, own.start, self.wind)
        names = tuple(f"intruder_{number}" for number in range(1, p.intruders + 1))
        keys = target_keys(names)
        stream = self.stream("start")
        bearing, share, height, heading, speed = (
            stream.uniform(keys, np.int64(0), draw) for draw in range(5)
        )
        distance_m, bearing_rad = 1000.0 * p.radius_km * np.sqrt(share), 2.0 * math.pi * bearing
        lat, lon, _ = enu_to_geodetic(
            distance_m * np.sin(bearing_rad),
            distance_m * np.cos(bearing_rad),
            0.0,
            reference_lat_deg=own.lat_deg,
            reference_lon_deg=own.lon_deg,
            reference_alt_m=own.alt_m,
        )
        altitude = own.alt_m + p.altitude_spread_m * (2.0 * height - 1.0)
        speed = p.speed_min_mps + (p.speed_max_mps - p.speed_min_mps) * speed
        zero = np.zeros(len(names))
        self.targets = straight_fleet(
            names, lat_deg=lat, lon_deg=lon, alt_m=altitude, heading_deg=360.0 * heading,
            speed_mps=speed, climb_mps=zero, start_time_s=zero, end_time_s=zero + np.inf,
            fixed_deg=np.full((3, len(names)), np.nan),
        )  # fmt: skip
        aircraft = [p.aircraft] * len(names)
        if p.equipage_shares != EquipageShares():
            aircraft = draw_equipage(names, aircraft, p.equipage_shares, self.stream("equipage"))
        self.roster = Roster.from_pairs(list(zip(names, aircraft, strict=True)), (own.name, own))

    def sample_times(self) -> list[SampleTimes]:
        """Return regular sample times over the whole run, at the interval that the scene states."""
        return [RegularTimes(self.p.sample_interval_s, float(self.context.duration_s))]
