"""The standard atmosphere of ITU-R P.835, and the Recommendations' tables of coefficients."""

from __future__ import annotations

import csv
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from components.arguments.checks import broadcast_flat, check_not_negative, check_within, unflatten
from dsa_des.arrays.types import FloatArray

_FOLDER = Path(__file__).parent / "data"


@cache
def read_csv_rows(name: str) -> tuple[dict[str, str], ...]:
    """Return the rows of ``data/<name>.csv`` as dictionaries; lines starting with # are notes."""
    with open(_FOLDER / f"{name}.csv", encoding="utf-8", newline="") as file:
        return tuple(csv.DictReader(line for line in file if not line.startswith("#")))


@cache
def read_csv_columns(name: str) -> dict[str, FloatArray]:
    """Return the columns of ``data/<name>.csv`` as read-only float64 arrays."""
    table = read_csv_rows(name)
    result = {key: np.array([float(row[key]) for row in table]) for key in table[0]}
    for column in result.values():
        column.flags.writeable = False
    return result


LOWEST_ALTITUDE_M = -5_000.0
HIGHEST_ALTITUDE_M = 80_000.0

SEA_LEVEL_VAPOUR_DENSITY_G_M3 = 7.5

_EARTH_RADIUS_KM = 6356.766
_HYDROSTATIC_K_PER_KM = 34.1632
VAPOUR_SCALE_HEIGHT_KM = 2.0
_SMALLEST_MIXING_RATIO = 2e-6


def standard_atmosphere(
    altitude_m: ArrayLike,
    *,
    sea_level_vapour_density_g_m3: ArrayLike = SEA_LEVEL_VAPOUR_DENSITY_G_M3,
) -> tuple[Any, Any, Any]:
    """Return the mean global pressure (hPa), temperature (K) and water vapour density (g/m³).

    Parameters
    ----------
    altitude_m : array_like, m
        Geometric altitude above sea level, -5 to 80 km. Below sea level the lowest layer is
        continued.
    sea_level_vapour_density_g_m3 : array_like, g/m³
        0 for dry air; the Recommendation's 7.5 by default. It falls by e every 2 km, down to the
        stratosphere's constant mixing ratio of 2e-6.

    Returns
    -------
    pressure_hpa, temperature_k, vapour_density_g_m3 : arrays of the broadcast shape
        The pressure is the barometric one, vapour included.

    Notes
    -----
    Recommendation ITU-R P.835-6 (12/2017), Annex 1, mean annual global reference atmosphere.
    """
    shape, (altitude, sea_level_vapour) = broadcast_flat(
        altitude_m=check_within(
            "altitude_m", altitude_m, LOWEST_ALTITUDE_M, HIGHEST_ALTITUDE_M, "m"
        ),
        density=check_not_negative("sea_level_vapour_density_g_m3", sea_level_vapour_density_g_m3),
    )
    height_km = altitude * 1e-3
    geopotential_km = _EARTH_RADIUS_KM * height_km / (_EARTH_RADIUS_KM + height_km)
    layers = read_csv_columns("standard_atmosphere")
    base_km = layers["base_geopotential_km"]
    layer = np.maximum(np.searchsorted(base_km, geopotential_km, side="left") - 1, 0)
    above_base_km = geopotential_km - base_km[layer]
    base_temperature, lapse = layers["base_temperature_k"][layer], layers["lapse_k_per_km"][layer]
    temperature = base_temperature + lapse * above_base_km
    isothermal = lapse == 0.0
    fall = np.where(
        isothermal,
        np.exp(-_HYDROSTATIC_K_PER_KM * above_base_km / base_temperature),
        np.power(
            base_temperature / temperature,
            _HYDROSTATIC_K_PER_KM / np.where(isothermal, 1.0, lapse),
        ),
    )
    pressure = layers["base_pressure_hpa"][layer] * fall
    vapour = sea_level_vapour * np.exp(-height_km / VAPOUR_SCALE_HEIGHT_KM)
    driest = _SMALLEST_MIXING_RATIO * pressure * 216.7 / temperature
    vapour = np.where(sea_level_vapour > 0.0, np.maximum(vapour, driest), 0.0)
    return unflatten(pressure, shape), unflatten(temperature, shape), unflatten(vapour, shape)
