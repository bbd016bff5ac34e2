"""What weakens a radar's echo or lifts it on its way: weather, blind range, eclipsing, lobes."""

import math
from typing import Any, ClassVar

import numpy as np

from components.arguments.units import SPEED_OF_LIGHT_M_S
from components.atmosphere.attenuation import gas_specific_attenuation
from components.atmosphere.rain_echo import HIGHEST_RAYLEIGH_HZ
from components.atmosphere.slant_path import (
    AttenuationTable,
    attenuation_table,
    one_way_attenuation_db,
    two_way_transmission,
)
from components.environment.tables import Weather
from components.radar.ground_clutter import terrain_of
from components.radar.rain import why_no_rain_echo
from components.radar.resolution import cell_azimuth_elevation_range
from components.sensor.look import Cells, CellValues
from components.sensor.weather_cells import (
    entry_and_exit_heights_m,
    weather_cells,
    weather_cells_on_sight_lines,
    weather_cells_verdict,
)
from components.terrain.reflection import two_ray_power_factor
from dsa_des.arrays.types import FloatArray
from dsa_des.block.effect import Effect, Hook, Verdict

SNR = Hook("SNR", CellValues, "factor of each cell's SNR")


class BlindRange(Effect[CellValues]):
    """No echo closer than ``minimum_range_m``: the receiver is shut while the pulse leaves."""

    name = "blind range"
    acts_on = SNR

    def verdict(self, block: Any) -> Verdict:
        """Return whether near targets are missed: needs ``minimum_range_m``."""
        nearest = block.p.minimum_range_m
        if nearest is None:
            return Verdict(False, "minimum_range_m is not given")
        return Verdict(True, f"minimum_range_m is {nearest:g}")

    def build(self, block: Any) -> CellValues:
        """Return a function giving cells' SNR factor: 0 closer than the minimum range, else 1."""
        nearest_m = 0.0 if block.p.minimum_range_m is None else block.p.minimum_range_m

        def factor(cells: Cells) -> FloatArray:
            return np.where(cells.range_m < nearest_m, 0.0, 1.0)

        return factor


class Eclipsing(Effect[CellValues]):
    """No echo is received while a pulse is sent: the SNR falls to the share that is received.

    Of several PRFs the one counts by which just enough see the target.
    """

    name = "eclipsing"
    acts_on = SNR

    def verdict(self, block: Any) -> Verdict:
        """Return whether transmitted pulses eclipse echoes: needs ``pulse_width_s``."""
        width_s = block.p.pulse_width_s
        if width_s is None:
            return Verdict(False, "pulse_width_s is not given")
        return Verdict(True, f"pulse_width_s is {width_s:g}")

    def build(self, block: Any) -> CellValues:
        """Return a function that gives the factor on each cell's SNR: the received share."""
        p = block.p
        if p.pulse_width_s is None:
            return lambda cells: np.ones(len(cells))

        def factor(cells: Cells) -> FloatArray:
            decisive: FloatArray = p.decisive_share(p.received_shares(np.asarray(cells.range_m)))
            return decisive

        return factor


PROPAGATION = Hook("propagation", CellValues, "factor of each target's echo, and of no clutter's")


class Multipath(Effect[CellValues]):
    """Multipath lobes by the ray reflected from flat ground or sea (`two_ray_power_factor`)."""

    name = "multipath"
    acts_on = PROPAGATION

    def verdict(self, block: Any) -> Verdict:
        """Return whether multipath is simulated: needs ``[terrain]`` height and roughness."""
        terrain = terrain_of(block)
        if terrain is None:
            return Verdict(False, "[terrain] height_m is not given")
        if terrain.roughness_m is None:
            return Verdict(False, "[terrain] roughness_m is not given")
        return Verdict(True, f"[terrain] roughness_m is {terrain.roughness_m:g}")

    def build(self, block: Any) -> CellValues:
        """Return a function that gives the factor on each target's echo by the reflected ray."""
        if not self.verdict(block).simulated:
            return lambda cells: np.ones(len(cells))
        terrain, (_, beam_rad, depth_m) = terrain_of(block), cell_azimuth_elevation_range(block.p)
        keys = {
            "wavelength_m": block.wavelength_m,
            "permittivity": terrain.permittivity(block.wavelength_m),
            "polarisation": block.p.polarisation,
            "roughness_m": terrain.roughness_m,
            "elevation_beamwidth_rad": beam_rad,
            "range_resolution_m": depth_m,
        }

        def factor(cells: Cells) -> FloatArray:
            own_m = cells.field_at_rows("own_alt_m") - terrain.height_m
            far_m = np.maximum(cells.range_m, 1.0)
            return np.asarray(
                two_ray_power_factor(far_m, own_m, cells.alt_m - terrain.height_m, **keys)
            )

        return factor


_NO_CARRIER = "frequency_hz is not given"


class Attenuation(Effect[CellValues]):
    """Loss along the slant path, evaluated once per run into a table over altitude."""

    acts_on = SNR
    #: Of the scene's ``[weather]``, that says whether there is any.
    key: ClassVar[str]

    def verdict(self, block: Any) -> Verdict:
        """Return whether air attenuates echoes: needs ``[weather]`` and the radar's carrier."""
        value = getattr(block.context.sections["weather"], self.key)
        if value and block.wavelength_m is None:
            return Verdict(False, _NO_CARRIER)
        text = str(value).lower() if isinstance(value, bool) else f"{value:g}"
        bound = self.bound(block) if value > 0 else {}
        return Verdict(value > 0, f"[weather] {self.key} is {text}", bound)

    def table_arguments(self, weather: Weather, block: Any) -> dict[str, Any]:
        """Return the arguments of the attenuation table for this effect alone, by name."""
        raise TypeError(f"{type(self).__name__} has no settings")

    def build(self, block: Any) -> CellValues:
        """Return a function giving cells' SNR factor by the loss on the path both ways."""
        if block.wavelength_m is None:
            return lambda cells: np.ones(len(cells))
        table = self._attenuation_table_of_effect(block)

        def factor(cells: Cells) -> FloatArray:
            loss_db = one_way_attenuation_db(
                cells.range_m, cells.field_at_rows("own_alt_m"), cells.alt_m, table
            )
            return two_way_transmission(loss_db)

        return factor

    def _attenuation_table_of_effect(self, block: Any) -> AttenuationTable:
        settings = self.table_arguments(block.context.sections["weather"], block)
        return attenuation_table(
            SPEED_OF_LIGHT_M_S / block.wavelength_m, **{"gas": False, **settings}
        )

    def bound(self, block: Any) -> dict[str, float]:
        """Return, by quantity, the largest change of Pd within the radar's range; empty if unknown.

        The loss is at most its sea-level value times the range, and Pd falls by at most
        max |dPd / d ln SNR| per unit of ln SNR.
        """
        reach_m = block.reach.range_max_m
        steepness = block.largest_pd_slope() if hasattr(block, "largest_pd_slope") else None
        if not math.isfinite(reach_m) or steepness is None:
            return {}
        most_db = 2.0 * largest_one_way_loss_db(self._attenuation_table_of_effect(block), reach_m)
        influence = steepness * most_db * math.log(10.0) / 10.0
        return {"detection_probability": min(1.0, influence)}


def largest_one_way_loss_db(table: AttenuationTable, reach_m: float) -> float:
    """Return the largest one-way loss of any path up to `reach_m` long, dB."""
    altitudes = np.arange(-1000.0, 40_001.0, 25.0)
    level = one_way_attenuation_db(np.full(altitudes.shape, reach_m), altitudes, altitudes, table)
    slanted = one_way_attenuation_db(
        np.full(altitudes.shape, reach_m), altitudes, altitudes + reach_m, table
    )
    # Rain's coefficient depends on the path's elevation by a few per cent; 10 % covers it.
    return 1.1 * float(max(level.max(), slanted.max()))


def weather_without_carrier_warnings(block: Any) -> list[str]:
    """Return a warning in a list if there is weather but no carrier known; else an empty list."""
    weather = block.context.sections.get("weather")
    if weather is None or block.wavelength_m is not None or not block.p.enabled:
        return []
    keys = ("gas", "rain_rate_mm_h", "fog_water_g_m3", "cells")
    there = [key for key in keys if getattr(weather, key)]
    if not there:
        return []
    return [
        f"[weather] {' and '.join(there)}: no effect on this radar, whose frequency_hz is not "
        "given: its boundary lies where range_km says, in any weather"
    ]


class Gas(Attenuation):
    """Oxygen and water vapour (ITU-R P.676-12, reference atmosphere P.835-6)."""

    name = "gas attenuation"
    key = "gas"

    def table_arguments(self, weather: Weather, block: Any) -> dict[str, Any]:
        """Return the table's arguments for gas attenuation, by name."""
        return {"gas": weather.gas, "vapour_density_g_m3": weather.vapour_density_g_m3}


def rain_echo_warnings(block: Any) -> list[str]:
    """Return a warning where rain has no echo, or where its echo is overestimated."""
    weather = block.context.sections.get("weather")
    rains = weather is not None and any(c.rain_rate_mm_h for c in (weather, *weather.cells))
    if not rains or not block.p.enabled:
        return []
    if block.wavelength_m is None:
        return []  # said of all weather
    if why := why_no_rain_echo(block):
        return [f"rain has no echo for this radar: {why}"]
    frequency_hz = SPEED_OF_LIGHT_M_S / block.wavelength_m
    if frequency_hz <= HIGHEST_RAYLEIGH_HZ:
        return []
    return [
        f"rain echo: at {frequency_hz / 1e9:.3g} GHz drops are no longer small against the "
        f"wavelength, and Rayleigh's formula, good up to {HIGHEST_RAYLEIGH_HZ / 1e9:g} GHz, gives "
        "more echo than there is"
    ]


# Below it clear air takes less than 0.04 dB/km both ways from an echo; no radar's range notices.
_GAS_MATTERS_HZ = 10e9
_RANGE_WITHOUT_ONE_M = 10e3


def neglected_gas_loss_notes(block: Any) -> list[str]:
    """Return a list: a note on clear-air loss if a radar above 10 GHz neglects it, else empty.

    It is not on by default: a radar calibrated by a range that was measured through air has the air
    in its calibration already, and scenes keep their values.
    """
    weather = block.context.sections.get("weather")
    frequency_hz = SPEED_OF_LIGHT_M_S / block.budget.wavelength
    if weather is None or weather.gas or frequency_hz <= _GAS_MATTERS_HZ:
        return []
    calibrated = getattr(block.p, "calibrate", None)
    range_m = block.stated_reach.range_max_m
    if calibrated is not None:
        range_m = 1000.0 * calibrated.range_km
    elif not math.isfinite(range_m):
        range_m = _RANGE_WITHOUT_ONE_M
    db_km = float(
        gas_specific_attenuation(frequency_hz, vapour_density_g_m3=weather.vapour_density_g_m3)
    )
    return [
        f"gas attenuation: at {frequency_hz / 1e9:.3g} GHz clear air at sea level would take "
        f"{2e-3 * range_m * db_km:.2g} dB from an echo at {range_m / 1000:.4g} km, there and back; "
        "[weather] gas = true simulates it"
        + (" (the range calibrated by is then one without air)" if calibrated is not None else "")
    ]


class Rain(Attenuation):
    """Rain below its upper edge (ITU-R P.838-3)."""

    name = "rain"
    key = "rain_rate_mm_h"

    def table_arguments(self, weather: Weather, block: Any) -> dict[str, Any]:
        """Return the table's arguments for rain attenuation, by name."""
        return {
            "rain_rate_mm_h": weather.rain_rate_mm_h,
            "rain_height_m": weather.rain_top_m,
            # P.838-3 has one coefficient for a circular wave and a linear one at 45 degrees.
            "polarisation": "circular" if block.p.polarisation == "slant" else block.p.polarisation,
        }


class Fog(Attenuation):
    """Fog and cloud between two altitudes (ITU-R P.840-8)."""

    name = "fog"
    key = "fog_water_g_m3"

    def table_arguments(self, weather: Weather, block: Any) -> dict[str, Any]:
        """Return the table's arguments for fog attenuation, by name."""
        return {
            "fog_liquid_water_g_m3": weather.fog_water_g_m3,
            "fog_base_m": weather.fog_base_m,
            "fog_top_m": weather.fog_top_m,
            "fog_temperature_k": weather.fog_temperature_c + 273.15,
        }


class CellsOfWeather(Effect[CellValues]):
    """Rain and fog of the scene's moving cells, by what of a line of sight lies in each."""

    name = "weather cells"
    acts_on = SNR

    def verdict(self, block: Any) -> Verdict:
        """Return whether weather cells have an effect: needs one near, and the radar's carrier."""
        if weather_cells(block) and block.wavelength_m is None:
            return Verdict(False, _NO_CARRIER)
        return weather_cells_verdict(block)

    def build(self, block: Any) -> CellValues:
        """Return a function giving the SNR factor of each (scan, target) by weather-cell loss."""
        if not weather_cells(block) or block.wavelength_m is None:
            return lambda cells: np.ones(len(cells))
        weather, tables = block.context.sections["weather"], []
        for one in weather_cells(block):
            of_cell = weather.model_copy(update=one.model_dump(include=_OF_CELL))
            settings = {
                **Rain().table_arguments(of_cell, block),
                **Fog().table_arguments(of_cell, block),
            }
            frequency_hz = SPEED_OF_LIGHT_M_S / block.wavelength_m
            tables.append(attenuation_table(frequency_hz, gas=False, **settings))

        def factor(cells: Cells) -> FloatArray:
            loss_db = np.zeros(len(cells))
            for (_, within), table in zip(
                weather_cells_on_sight_lines(block, cells), tables, strict=True
            ):
                length_m = cells.range_m * (within.leaves - within.enters)
                heights_m = entry_and_exit_heights_m(cells, within)
                loss_db += one_way_attenuation_db(length_m, *heights_m, table)
            return two_way_transmission(loss_db)

        return factor


_OF_CELL = {"rain_rate_mm_h", "fog_water_g_m3"}
WEATHER_EFFECTS = (Gas(), Rain(), Fog(), CellsOfWeather())
