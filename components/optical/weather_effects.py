"""The contrast that haze, fog and rain take from a camera."""

import math
from typing import Any

import numpy as np

from components.atmosphere.infrared import (
    BANDS,
    band_extinction_per_m,
    haze_extinction_ratio_at,
    long_wave_transmission,
    mid_wave_transmission,
    precipitable_water_mm,
)
from components.atmosphere.slant_path import share_of_path_between
from components.atmosphere.visibility import (
    KOSCHMIEDER,
    combined_visibility_m,
    fog_visibility_m,
    rain_extinction_per_m,
    rain_visibility_m,
)
from components.environment.tables import Weather
from components.optical.contrast import CONTRAST, visibility_transmission
from components.sensor.look import Cells, CellValues
from components.sensor.weather_cells import (
    entry_and_exit_heights_m,
    weather_cells,
    weather_cells_on_sight_lines,
    weather_cells_verdict,
)
from dsa_des.arrays.types import FloatArray
from dsa_des.block.effect import Effect, Hook, Verdict


class Visibility(Effect[CellValues]):
    """Contrast falls with range by Koschmieder's law.

    The visibility is the scene's own, or follows from its fog and rain.
    """

    name = "visibility"
    acts_on = CONTRAST

    def verdict(self, block: Any) -> Verdict:
        """Return whether haze reduces contrast: needs visibility, fog or rain in ``[weather]``, and
        a camera without an infrared band.
        """
        weather = block.context.sections["weather"]
        if infrared_band_of(block) is not None:
            return Verdict(
                False, f"{_describe_extinction_band(block)}: the air takes what it takes there"
            )
        if weather.visibility_km is not None:
            return Verdict(True, f"[weather] visibility_km is {weather.visibility_km:g}")
        found = [
            f"{key} is {value:g}"
            for key, value in (
                ("rain_rate_mm_h", weather.rain_rate_mm_h),
                ("fog_water_g_m3", weather.fog_water_g_m3),
            )
            if value > 0
        ]
        if found:
            return Verdict(True, f"[weather] {' and '.join(found)}")
        return Verdict(False, "[weather] has no visibility_km, no rain and no fog")

    def build(self, block: Any) -> CellValues:
        """Return a function that gives the factor on each cell's contrast by haze, fog and rain."""
        visibility_m = scene_visibility_m(block.context.sections["weather"])
        if visibility_m is None or infrared_band_of(block) is not None:
            return lambda cells: np.ones(len(cells))

        def factor(cells: Cells) -> FloatArray:
            return visibility_transmission(cells.range_m, visibility_m)

        return factor


class BandExtinction(Effect[CellValues]):
    """Loss of an infrared camera's contrast by clear air, haze, fog and rain."""

    name = "extinction in the band"
    acts_on = CONTRAST

    def verdict(self, block: Any) -> Verdict:
        """Return whether air attenuates the camera's band: needs ``extinction_band``."""
        return Verdict(infrared_band_of(block) is not None, _describe_extinction_band(block))

    def build(self, block: Any) -> CellValues:
        """Return a function giving the factor on each cell's contrast by the air in its band."""
        band = infrared_band_of(block)
        if band is None:
            return lambda cells: np.ones(len(cells))
        weather = block.context.sections["weather"]
        density = weather.vapour_density_g_m3
        extinction = band_extinction_per_m(band, *haze_visibility_and_rain_extinction(weather))

        def factor(cells: Cells) -> FloatArray:
            path = cells.range_m, cells.field_at_rows("own_alt_m"), cells.alt_m
            if band == "lwir":
                clear = long_wave_transmission(*path, density)
            else:
                clear = mid_wave_transmission(precipitable_water_mm(*path, density))
            with np.errstate(under="ignore"):
                return np.asarray(clear * np.exp(-extinction * cells.range_m))

        return factor


class ObscuringCells(Effect[CellValues]):
    """Loss of contrast by moving cells of rain and fog, by the part of a line of sight in each.

    Rain below ``rain_top_m``, fog between its edges; in an infrared band as `BandExtinction` does.
    """

    name = "weather cells"
    acts_on = CONTRAST

    def verdict(self, block: Any) -> Verdict:
        """Return whether weather cells obscure targets: one must come near."""
        return weather_cells_verdict(block)

    def build(self, block: Any) -> CellValues:
        """Return a function that gives the factor on each cell's contrast by the weather cells."""
        if not weather_cells(block):
            return lambda cells: np.ones(len(cells))
        weather = block.context.sections["weather"]

        def factor(cells: Cells) -> FloatArray:
            depth = np.zeros(len(cells))
            for one, within in weather_cells_on_sight_lines(block, cells):
                ends_m = entry_and_exit_heights_m(cells, within)
                low, high = np.minimum(*ends_m), np.maximum(*ends_m)
                rain = share_of_path_between(low, high, -math.inf, weather.rain_top_m)
                fog = share_of_path_between(low, high, weather.fog_base_m, weather.fog_top_m)
                per_m = rain * float(rain_extinction_per_m(one.rain_rate_mm_h))
                per_m += fog * _fog_extinction_per_m(block, one.fog_water_g_m3)
                depth += per_m * cells.range_m * (within.leaves - within.enters)
            with np.errstate(under="ignore"):
                return np.exp(-depth)

        return factor


def _fog_extinction_per_m(block: Any, water_g_m3: float) -> float:
    """Return the extinction by fog of visible light, an infrared band or a laser, 1/m."""
    visibility_m = float(fog_visibility_m(water_g_m3))
    if math.isinf(visibility_m):
        return 0.0
    if (band := infrared_band_of(block)) is not None:
        return band_extinction_per_m(band, visibility_m)
    wavelength_um = getattr(block.p, "wavelength_um", None)
    share = (
        1.0
        if wavelength_um is None
        else float(haze_extinction_ratio_at(visibility_m, wavelength_um))
    )
    return share * KOSCHMIEDER / visibility_m


TRANSMISSION = Hook("light", CellValues, "share of each cell's light that is left, one way")


class CellsInTheWay(ObscuringCells):
    """Transmission through moving weather cells: a laser pulse (each way), a lookout's search."""

    acts_on = TRANSMISSION

    def verdict(self, block: Any) -> Verdict:
        """Return whether cells obscure targets: one must come near, and contrast be searched."""
        if getattr(block.p, "search", "") == "round":
            return Verdict(False, "search is 'round', which no contrast slows")
        return super().verdict(block)


DARKNESS = Hook("darkness", bool, "whether it is too dark to see anything")


class Night(Effect[bool]):
    """At night a camera for visible light detects nothing; lights are not simulated."""

    name = "night"
    acts_on = DARKNESS
    outside_the_proof = "a camera in the dark is off"

    def verdict(self, block: Any) -> Verdict:
        """Return whether night hides targets: needs ``[weather] night``."""
        night = block.context.sections["weather"].night
        if night and getattr(block.p, "band", "eo") == "ir":
            return Verdict(False, "band is 'ir': warm areas need no daylight")
        return Verdict(night, f"[weather] night is {str(night).lower()}")

    def build(self, block: Any) -> bool:
        """Return True, as it is dark."""
        return True


def _describe_extinction_band(block: Any) -> str:
    return f"extinction_band is {block.p.extinction_band!r}"


def infrared_band_of(block: Any) -> str | None:
    """Return the camera's ``extinction_band`` if that is an infrared band, else None."""
    band = getattr(block.p, "extinction_band", None)
    return band if band in BANDS else None


def haze_visibility_and_rain_extinction(weather: Weather) -> tuple[float | None, float]:
    """Return haze or fog's visibility (m; None if unlimited), and rain's extinction (1/m)."""
    rain = float(rain_extinction_per_m(weather.rain_rate_mm_h))
    if weather.visibility_km is not None:
        # The scene's visibility is that of all together: what rain does not take is haze.
        total = KOSCHMIEDER / (weather.visibility_km * 1000.0)
        return (KOSCHMIEDER / (total - rain), rain) if total > rain else (None, total)
    if weather.fog_water_g_m3 > 0:
        return float(fog_visibility_m(weather.fog_water_g_m3)), rain
    return None, rain


def scene_visibility_m(weather: Weather) -> float | None:
    """Return the visibility in metres, or None when nothing limits it."""
    if weather.visibility_km is not None:
        return weather.visibility_km * 1000.0
    parts = []
    if weather.rain_rate_mm_h > 0:
        parts.append(rain_visibility_m(weather.rain_rate_mm_h))
    if weather.fog_water_g_m3 > 0:
        parts.append(fog_visibility_m(weather.fog_water_g_m3))
    return float(combined_visibility_m(*parts)) if parts else None
