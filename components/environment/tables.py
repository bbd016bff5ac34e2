"""Tables of a scene that all blocks can read.

They are ``[weather]``, ``[accuracy]``, ``[navigation]`` and ``[terrain]``.
"""

from typing import Annotated, ClassVar, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from components.atmosphere.pressure_altitude import STANDARD_HPA
from components.environment.weather_cells import WeatherCell
from components.terrain.raster import RasterFile
from components.terrain.reflection import surface_permittivity
from dsa_des.block.component import Parameters
from dsa_des.time.gauss_markov import LONGEST_S


class Weather(Parameters):
    """Weather of a scene; by default none, so that sensors look through empty space."""

    may_change: ClassVar[tuple[str, ...]] = (
        "gas", "vapour_density_g_m3", "rain_rate_mm_h", "rain_top_m", "fog_water_g_m3",
        "fog_base_m", "fog_top_m", "fog_temperature_c", "visibility_km", "cells", "night",
        "qnh_hpa", "temperature_offset_c", "temperature_profile_c",
    )  # fmt: skip

    gas: bool = Field(
        default=False, description="Whether oxygen and water vapour attenuate radar (P.676)."
    )
    vapour_density_g_m3: float = Field(
        default=7.5,
        ge=0,
        le=50,
        description="Water vapour density at sea level, g/m³, for gas attenuation of "
        "radar and for clear air in infrared bands.",
    )
    rain_rate_mm_h: float = Field(default=0.0, ge=0, le=300, description="Rain rate, mm/h.")
    rain_top_m: float = Field(
        default=2668.0, description="Altitude of the rain's upper edge, m (ITU-R P.839-4)."
    )
    fog_water_g_m3: float = Field(
        default=0.0, ge=0, le=10, description="Liquid water of fog or cloud, g/m³."
    )
    fog_base_m: float = Field(default=-1000.0, description="Altitude of the fog's lower edge, m.")
    fog_top_m: float = Field(default=500.0, description="Altitude of the fog's upper edge, m.")
    fog_temperature_c: float = Field(
        default=10.0, ge=-40, le=50, description="Temperature of the fog's droplets, deg C."
    )
    visibility_km: float | None = Field(
        default=None,
        gt=0,
        description="Visibility (Koschmieder, 2 % contrast), km; by default from fog and rain.",
    )
    cells: tuple[WeatherCell, ...] = Field(
        default=(),
        description="Rain and fog that are somewhere, and move: [[weather.cells]].",
    )

    wind_mps: float = Field(
        default=0.0,
        ge=0,
        le=150,
        description="Speed of the wind, the same everywhere, m/s. Flights keep their tracks over "
        "the ground, and noses turn into the wind.",
    )
    wind_from_deg: float = Field(
        default=0.0, ge=-360, le=360, description="Where the wind comes from, deg from north."
    )
    qnh_hpa: float = Field(
        default=STANDARD_HPA,
        ge=850,
        le=1100,
        description="Pressure at sea level, hPa: with another than the standard's, pressure "
        "altitudes, which transponders report, are no heights.",
    )
    temperature_offset_c: float = Field(
        default=0.0,
        ge=-60,
        le=60,
        description="How much warmer than the standard atmosphere the air is at every height, "
        "deg C; for pressure altitudes.",
    )
    temperature_profile_c: tuple[tuple[float, float], ...] = Field(
        default=(),
        description="In its place [height above sea level, temperature] in m and deg C, rising: "
        "even in between, beyond them as far off the standard as at the nearest.",
    )
    night: bool = Field(
        default=False,
        description="Whether there is no daylight: cameras for visible light then see nothing.",
    )

    def ineffective_key_notes(self) -> list[str]:
        """Return a sentence for each key that has no effect, as wind, rain or fog is absent."""
        said = []
        if not self.wind_mps:
            said += self.note_ineffective("wind_from_deg", because="wind_mps is 0")
        if not (self.rain_rate_mm_h or any(one.rain_rate_mm_h for one in self.cells)):
            said += self.note_ineffective("rain_top_m", because="rain_rate_mm_h is 0")
        if not (self.fog_water_g_m3 or any(one.fog_water_g_m3 for one in self.cells)):
            said += self.note_ineffective(
                "fog_base_m", "fog_top_m", "fog_temperature_c", because="fog_water_g_m3 is 0"
            )
        return said

    @model_validator(mode="after")
    def _check_profile(self) -> Self:
        rows = self.temperature_profile_c
        heights = [height_m for height_m, _ in rows]
        if heights != sorted(set(heights)) or not all(
            -1000.0 <= height_m <= 30_000.0 and -120.0 <= celsius <= 60.0
            for height_m, celsius in rows
        ):
            raise ValueError(
                f"temperature_profile_c is {[list(row) for row in rows]}: its heights must rise, "
                "from -1000 to 30000 m, with temperatures from -120 to 60 deg C"
            )
        if rows and self.temperature_offset_c:
            raise ValueError("temperature_profile_c and temperature_offset_c are given: give one")
        return self

    @model_validator(mode="after")
    def _check_fog_thickness(self) -> Self:
        if self.fog_top_m < self.fog_base_m:
            raise ValueError(
                f"fog_top_m is {self.fog_top_m:g}: it must be at least fog_base_m, "
                f"{self.fog_base_m:g}"
            )
        return self


class Accuracy(Parameters):
    """Errors a scene tolerates; effects and finer models proven to change less are left out.

    Angles are directions, azimuths and elevations in body axes, as far as a sensor looks at them.
    The line of sight is judged by ``angle_deg`` and ``range_m``, and by what its error in range
    does to a Pd where ``detection_probability`` is given. A sensor without a Pd (threshold, range
    boundary, camera) detects by no more than ``range_m`` nearer or farther.
    """

    detection_probability: float | None = Field(
        default=None, gt=0, lt=1, description="Error of any probability of detection."
    )
    angle_deg: float | None = Field(default=None, gt=0, description="Error of any angle, deg.")
    range_m: float | None = Field(default=None, gt=0, description="Error of any range, m.")


PositionError = Annotated[float, Field(ge=-10_000, le=10_000)]
PositionNoise = Annotated[float, Field(ge=0, le=1000)]
AttitudeError = Annotated[float, Field(ge=-180, le=180)]
AttitudeNoise = Annotated[float, Field(ge=0, le=30)]


class Navigation(Parameters):
    """Errors of the ownship's navigation (TECVOL, thesis §2.3.1), believed minus true."""

    position_bias_m: tuple[PositionError, PositionError, PositionError] = Field(
        default=(0.0, 0.0, 0.0),
        description="Constant error north, east and down, m; these turn near a pole.",
    )
    position_noise_m: tuple[PositionNoise, PositionNoise, PositionNoise] = Field(
        default=(0.0, 0.0, 0.0),
        description="Standard deviation of the noise north, east and down, m; where it lasts it is "
        "fixed to the Earth, and does not turn near a pole.",
    )
    position_correlation_time_s: float = Field(
        default=60.0,
        ge=0,
        le=LONGEST_S,
        description="Time after which the noise of position has forgotten all but 1/e, s; 0 for "
        "one that is new at every instant.",
    )
    attitude_bias_deg: tuple[AttitudeError, AttitudeError, AttitudeError] = Field(
        default=(0.0, 0.0, 0.0), description="Constant error of yaw, pitch and roll, deg."
    )
    attitude_noise_deg: tuple[AttitudeNoise, AttitudeNoise, AttitudeNoise] = Field(
        default=(0.0, 0.0, 0.0),
        description="Standard deviation of the noise of yaw, pitch and roll, deg.",
    )
    attitude_correlation_time_s: float = Field(
        default=60.0,
        ge=0,
        le=LONGEST_S,
        description="As position_correlation_time_s, of the noise of attitude, s.",
    )


class Record(Parameters):
    """Which further tables a run folder holds, beside the messages of blocks."""

    truth: bool | Literal["auto"] = Field(
        default="auto",
        description="Whether the table truth has the ownship and every target at every scan; by "
        "default where aircraft times seconds, of all replicas together, are at most 600; a study "
        "makes it where a metric reads it.",
    )
    looks: bool = Field(
        default=False,
        description="Whether the table looks has every sensor's look at every target, also those "
        "without a detection.",
    )


class Terrain(Parameters):
    """Ground of a scene: its height, its radar echo and what it hides; by default none."""

    height_m: float | None = Field(
        default=None,
        ge=-1000,
        le=10_000,
        description="Altitude of the ground, below the ownship's, m; none by default.",
    )
    clutter_gamma_db: float = Field(
        default=-15.0,
        ge=-100,
        le=100,
        description="Reflectivity of the ground, gamma of sigma0 = gamma sin(grazing angle), dB: "
        "about -20 desert or sea, -15 farmland, -10 woodland, -5 a town (assumption).",
    )
    clutter_motion_m_s: float = Field(
        default=0.0,
        ge=0,
        le=10,
        description="Standard deviation of the ground's own range rates, m/s: about 0.3 wooded "
        "hills in a fresh wind, 1 sea (Skolnik, table 3.1); for moving-target filters.",
    )
    facet_slope_deg: float | None = Field(
        default=None,
        gt=0,
        le=45,
        description="Slope of the ground's facets, deg: those that lie level mirror what sidelobes "
        "send straight down, about 5 a calm sea, 15 a rough one or land (assumption). Without it "
        "there is no such altitude line.",
    )
    roughness_m: float | None = Field(
        default=None,
        ge=0,
        le=100,
        description="Standard deviation of the ground's heights, m: with it flat ground or sea "
        "mirrors rays, which gives radars lobes; 0 for a mirror. Without it there is no such ray.",
    )
    relative_permittivity: float = Field(
        default=15.0,
        ge=1,
        le=200,
        description="Relative permittivity of the ground: about 70 sea, 25 wet, 15 medium and 3 "
        "dry ground (ITU-R P.527); for roughness_m and facet_slope_deg.",
    )
    conductivity_s_m: float = Field(
        default=0.0,
        ge=0,
        le=100,
        description="Conductivity of the ground, S/m: about 5 sea, 0.005 to 0.1 ground.",
    )
    clutter_mean: Literal["constant", "fluctuating"] = Field(
        default="fluctuating",
        description="Whether the clutter's mean fluctuates from look to look (thesis §5.3.2).",
    )
    horizon: bool = Field(
        default=False,
        description="Whether targets behind the Earth's limb are hidden, and cameras see sky down "
        "to the horizon's dip. The limb is that of height_m, or else of the ellipsoid.",
    )
    refraction: Literal["none", "four_thirds"] = Field(
        default="none",
        description="How the air bends rays: not at all, or as over an Earth of 4/3 its radius: "
        "targets appear higher, and the horizon is farther away.",
    )
    raster: RasterFile | None = Field(
        default=None,
        description="Elevation raster whose ground hides targets, or a list of files side by side: "
        "SRTM .hgt, or GeoTIFF with the extra geotiff. Beside it no ground is known.",
    )
    raster_offset_m: float | None = Field(
        default=None,
        ge=-200,
        le=200,
        description="Height of the raster's zero above the ellipsoid, m; by default that of sea "
        "level, geoid_undulation_m.",
    )
    geoid_undulation_m: float = Field(
        default=0.0,
        ge=-200,
        le=200,
        description="Height of mean sea level above the ellipsoid, the same all over the scene, m "
        "(-107 to 86 on Earth): for pressure altitudes, heights above sea level and rasters.",
    )

    @property
    def raster_zero_m(self) -> float:
        """Height above the ellipsoid, m, to which the raster's heights are added."""
        given = self.raster_offset_m
        return self.geoid_undulation_m if given is None else given

    def permittivity(self, wavelength_m: float | None) -> complex:
        """Return the ground's complex relative permittivity; real where no wavelength is given."""
        return surface_permittivity(
            self.relative_permittivity, self.conductivity_s_m, wavelength_m or 0.0
        )

    def ground_height_m(self, lat_deg: float, lon_deg: float) -> float | None:
        """Return the ground's height above the ellipsoid at a place, m; None if unknown."""
        if self.raster is None:
            return self.height_m
        heights, inside = self.raster.raster.heights_and_coverage(
            np.array([lat_deg]), np.array([lon_deg])
        )
        return float(heights[0]) + self.raster_zero_m if inside[0] else None

    def ineffective_key_notes(self) -> list[str]:
        """Return a sentence per key without effect, and one on raster heights filled in."""
        said = []
        if self.raster is None:
            said += self.note_ineffective("raster_offset_m", because="raster is not given")
        elif filled := self.raster.raster.filled:
            share = filled / self.raster.raster.height_m.size
            said.append(
                f"raster: {filled:,} nodes without a height ({share:.2%}) in "
                f"{self.raster.raster.name} are filled from around them"
            )
        if self.height_m is None:
            keys = "clutter_gamma_db", "clutter_motion_m_s", "clutter_mean"
            mirrors = "facet_slope_deg", "roughness_m"
            said += self.note_ineffective(*keys, *mirrors, because="height_m is not given")
        if self.facet_slope_deg is None and self.roughness_m is None:
            water = "relative_permittivity", "conductivity_s_m"
            said += self.note_ineffective(
                *water, because="roughness_m and facet_slope_deg are not given"
            )
        return said
