"""Attenuation by the air at each altitude, evaluated once per run."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from components.arguments.checks import FloatArray, as_numbers, not_negative, refuse
from components.atmosphere.fog import fog_specific_attenuation
from components.atmosphere.gas import gas_specific_attenuation
from components.atmosphere.rain import RainCoefficients, polarisation_balance, rain_coefficients
from components.atmosphere.standard_atmosphere import (
    SEA_LEVEL_VAPOUR_DENSITY_G_M3,
    standard_atmosphere,
)

BOTTOM_M = -1_000.0
TOP_M = 40_000.0
STEP_M = 25.0

# The 0 °C level of the reference atmosphere, 2.308 km, plus the 0.36 km that Recommendation ITU-R
# P.839-4 puts between it and the top of the rain.
STANDARD_RAIN_HEIGHT_M = 2668.0


@dataclass(frozen=True, eq=False)
class AttenuationTable:
    """Hold the attenuation of one radar's frequency by altitude.

    Build it with `attenuation_table`.

    Parameters
    ----------
    frequency_hz : float
    gas_db_km, gas_slope, gas_sum : (nodes,) arrays or None
        Specific attenuation of the gases at altitudes `BOTTOM_M` + i `STEP_M`, its increase to the
        next node, and its sum up to node i by the trapezium rule (in node steps). None: no gas.
    rain : RainCoefficients or None
    rain_rate_mm_h, rain_height_m, rain_balance : float
        Rain falls from `rain_height_m` down; the balance is cos 2τ of the polarisation.
    fog_db_km, fog_base_m, fog_top_m : float
        Fog or cloud fills the altitudes from base to top.
    """

    frequency_hz: float
    gas_db_km: FloatArray | None
    gas_slope: FloatArray | None
    gas_sum: FloatArray | None
    rain: RainCoefficients | None
    rain_rate_mm_h: float
    rain_height_m: float
    rain_balance: float
    fog_db_km: float
    fog_base_m: float
    fog_top_m: float


def attenuation_table(
    frequency_hz: float,
    *,
    gas: bool = True,
    vapour_density_g_m3: float = SEA_LEVEL_VAPOUR_DENSITY_G_M3,
    rain_rate_mm_h: float = 0.0,
    rain_height_m: float = STANDARD_RAIN_HEIGHT_M,
    polarisation: str | float = "circular",
    fog_liquid_water_g_m3: float = 0.0,
    fog_base_m: float = -math.inf,
    fog_top_m: float = math.inf,
    fog_temperature_k: float = 283.15,
) -> AttenuationTable:
    """Return the attenuation by altitude that `one_way_attenuation_db` integrates along a path.

    What the weather does not have is not built: without rain or fog the paths do not pay for it.

    Parameters
    ----------
    frequency_hz : float, Hz
        1 GHz to 1 THz; with fog up to 200 GHz.
    gas : bool
        Whether oxygen and water vapour attenuate.
    vapour_density_g_m3 : float, g/m³
        At sea level; the rest is the reference atmosphere's.
    rain_rate_mm_h : float, mm/h
        The same everywhere below `rain_height_m`.
    rain_height_m : float, m
        Altitude of the top of the rain; 2668 m by default (see `STANDARD_RAIN_HEIGHT_M`).
    polarisation : {"horizontal", "vertical", "circular"} or float
        Or the tilt from the horizontal in radians.
    fog_liquid_water_g_m3 : float, g/m³
        The same everywhere between `fog_base_m` and `fog_top_m` (m; everywhere by default).
    fog_temperature_k : float, K

    Returns
    -------
    AttenuationTable

    Raises
    ------
    ValueError
        If an argument is out of range, the polarisation unknown, or the fog's top below its base.

    Notes
    -----
    Recommendations ITU-R P.676-12, P.835-6, P.838-3, P.839-4 and P.840-8. The gases between nodes
    are interpolated linearly: with 25 m steps the error is below 3e-5 of their attenuation up to
    15 km, and 4.5e-4 within the one step that holds the tropopause (11 km). Below -1 km and above
    40 km they stay as they are there.
    """
    rain_rate = float(not_negative("rain_rate_mm_h", rain_rate_mm_h))
    water = float(not_negative("fog_liquid_water_g_m3", fog_liquid_water_g_m3))
    for name, value in (
        ("rain_height_m", rain_height_m),
        ("fog_base_m", fog_base_m),
        ("fog_top_m", fog_top_m),
    ):
        number = as_numbers(name, value)
        refuse(name, number, np.isnan(number), "be an altitude or infinite")
    if not fog_top_m >= fog_base_m:
        raise ValueError(
            f"fog_top_m is {fog_top_m:g}: it must be at least fog_base_m, {fog_base_m:g}"
        )
    nodes = _gas_nodes(frequency_hz, vapour_density_g_m3) if gas else (None, None, None)
    balance = polarisation_balance(polarisation)
    return AttenuationTable(
        frequency_hz=float(frequency_hz),
        gas_db_km=nodes[0],
        gas_slope=nodes[1],
        gas_sum=nodes[2],
        rain=rain_coefficients(frequency_hz) if rain_rate > 0.0 else None,
        rain_rate_mm_h=rain_rate,
        rain_height_m=float(rain_height_m),
        rain_balance=balance,
        fog_db_km=float(fog_specific_attenuation(frequency_hz, water, fog_temperature_k))
        if water > 0.0
        else 0.0,
        fog_base_m=float(fog_base_m),
        fog_top_m=float(fog_top_m),
    )


def _gas_nodes(
    frequency_hz: float, vapour_density_g_m3: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    altitude = BOTTOM_M + STEP_M * np.arange(round((TOP_M - BOTTOM_M) / STEP_M) + 1)
    pressure, temperature, vapour = standard_atmosphere(
        altitude, sea_level_vapour_density_g_m3=vapour_density_g_m3
    )
    gas = np.array(
        gas_specific_attenuation(
            frequency_hz,
            pressure_hpa=pressure,
            temperature_k=temperature,
            vapour_density_g_m3=vapour,
        )
    )
    # Level first and last steps: extrapolated, they stay constant below and above the table.
    gas[0], gas[-1] = gas[1], gas[-2]
    slope = np.append(np.diff(gas), 0.0)
    total = np.concatenate(([0.0], np.cumsum(gas[:-1] + 0.5 * slope[:-1])))
    for array in (gas, slope, total):
        array.flags.writeable = False
    return gas, slope, total
