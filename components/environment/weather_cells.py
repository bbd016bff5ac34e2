"""Rain and fog that are somewhere: discs that move, and what of a path lies over each."""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple, Self

import numpy as np
from pydantic import Field, model_validator

from components.geometry import line_of_sight_ned
from dsa_des.arrays.types import FloatArray
from dsa_des.block.component import Parameters


class Within(NamedTuple):
    """Where a path enters and leaves a disc, as shares of its length (0 to 1); both 0 if missed."""

    enters: FloatArray
    leaves: FloatArray


def disc_entry_and_exit_shares(
    way_north_m: FloatArray,
    way_east_m: FloatArray,
    centre_north_m: FloatArray,
    centre_east_m: FloatArray,
    radius_m: float,
) -> Within:
    """Return at which shares (0 to 1) of their length straight paths from the origin enter and
    leave the air over a disc; both 0 if missed.

    A path w from the origin enters and leaves a disc of radius r around c at shares
    (c·w -+ sqrt(r² w² - (c×w)²)) / w² of itself; one straight up is in it or not.
    """
    square = way_north_m**2 + way_east_m**2
    along = centre_north_m * way_north_m + centre_east_m * way_east_m
    across = centre_north_m * way_east_m - centre_east_m * way_north_m
    level = np.where(square > 0.0, square, 1.0)
    half = np.sqrt(np.maximum(radius_m**2 * square - across**2, 0.0)) / level
    over = (square == 0.0) & (centre_north_m**2 + centre_east_m**2 < radius_m**2)
    enters = np.clip(along / level - half, 0.0, 1.0)
    leaves = np.where(over, 1.0, np.clip(along / level + half, 0.0, 1.0))
    met = leaves > enters
    return Within(np.where(met, enters, 0.0), np.where(met, leaves, 0.0))


class WeatherCell(Parameters):
    """An item of ``[weather] cells``: rain or fog within a circle that moves."""

    lat_deg: float = Field(ge=-90, le=90, description="Latitude of its centre at the start, deg.")
    lon_deg: float = Field(ge=-180, le=360, description="Longitude of its centre then, deg.")
    radius_km: float = Field(gt=0, le=1000, description="Its radius, km.")
    rain_rate_mm_h: float = Field(
        default=0.0, ge=0, le=300, description="Rain rate in it, beside that everywhere, mm/h."
    )
    fog_water_g_m3: float = Field(
        default=0.0, ge=0, le=10, description="Liquid water of its fog, between fog_base_m and "
        "fog_top_m, beside that everywhere, g/m³."
    )  # fmt: skip
    speed_mps: float = Field(default=0.0, ge=0, le=150, description="How fast it moves, m/s.")
    towards_deg: float = Field(
        default=0.0, ge=-360, le=360, description="Where it moves to, deg from north."
    )

    @model_validator(mode="after")
    def _check_not_empty(self) -> Self:
        if not (self.rain_rate_mm_h or self.fog_water_g_m3):
            raise ValueError("a cell has rain_rate_mm_h, fog_water_g_m3 or both")
        return self

    def centre_offset_m(
        self, own_place: Sequence[FloatArray], time_s: FloatArray
    ) -> tuple[Any, Any]:
        """Return the moving cell centre's offset north and east, m, from places at these times."""
        lat_deg, lon_deg, alt_m = own_place
        lat, lon = (np.full(np.shape(lat_deg), at) for at in (self.lat_deg, self.lon_deg))
        north, east, _ = line_of_sight_ned(lat_deg, lon_deg, alt_m, lat, lon, alt_m, validate=False)
        towards = math.radians(self.towards_deg)
        moved_m = self.speed_mps * time_s
        return north + math.cos(towards) * moved_m, east + math.sin(towards) * moved_m

    def entry_and_exit_shares(
        self,
        own_place: Sequence[FloatArray],
        line: Sequence[FloatArray],
        time_s: FloatArray,
    ) -> Within:
        """Return at which shares (0 to 1) of their length lines of sight (azimuth from north,
        elevation, range) enter and leave the cell; both 0 if missed.
        """
        azimuth, elevation, range_m = line
        level_m = range_m * np.cos(elevation)
        way = level_m * np.cos(azimuth), level_m * np.sin(azimuth)
        return disc_entry_and_exit_shares(
            *way, *self.centre_offset_m(own_place, time_s), 1000.0 * self.radius_km
        )
