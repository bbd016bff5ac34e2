"""Pressure altitude and height: what altimeters read at a height in air that is not the standard's.

The air is hydrostatic, of the standard's lapse rate and dry, colder or warmer everywhere by one
offset, and has one pressure at sea level. Heights are above sea level and are taken as geopotential
ones, from which they differ by 1.4 m at 3 km; so in the standard atmosphere both are the same
number, to the bit. ICAO, "Manual of the ICAO standard atmosphere", Doc 7488.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from components.arguments.checks import (
    broadcast_flat,
    check_within,
    finite,
    positive,
    refuse,
    unflatten,
)

#: Pressure at sea level, hPa.
STANDARD_HPA = 1013.25
_SEA_LEVEL_K, _LAPSE_K_M, _TROPOPAUSE_M = 288.15, 0.0065, 11_000.0
_TROPOPAUSE_K = _SEA_LEVEL_K - _LAPSE_K_M * _TROPOPAUSE_M
#: g / R of dry air, K/m.
_HYDROSTATIC_K_M = 9.80665 / 287.05287
#: Heights at which the formulas are used; the layer above the tropopause is continued.
LOWEST_M, HIGHEST_M = -5_000.0, 30_000.0


def pressure_altitude_m(
    height_m: ArrayLike, *, qnh_hpa: ArrayLike = STANDARD_HPA, offset_k: ArrayLike = 0.0
) -> Any:
    """Return the altitude that an altimeter set to 1013.25 hPa reads, m.

    Parameters
    ----------
    height_m : array_like, m
        Above sea level, -5 to 30 km.
    qnh_hpa : array_like, hPa
        Pressure at sea level.
    offset_k : array_like, K
        How much warmer the air is than the standard's at every height, above -100.
    """
    shape, (height, qnh, offset) = _checked("height_m", height_m, qnh_hpa, offset_k)
    standard = (qnh == STANDARD_HPA) & (offset == 0.0)
    drop = _log_drop(height, offset) - np.log(qnh / STANDARD_HPA)
    return unflatten(np.where(standard, height, _height_of(drop, 0.0)), shape)


def height_of_pressure_altitude_m(
    altitude_m: ArrayLike, *, qnh_hpa: ArrayLike = STANDARD_HPA, offset_k: ArrayLike = 0.0
) -> Any:
    """Return the height above sea level at which an altimeter reads an altitude, m.

    The inverse of `pressure_altitude_m`, with its parameters.
    """
    shape, (altitude, qnh, offset) = _checked("altitude_m", altitude_m, qnh_hpa, offset_k)
    standard = (qnh == STANDARD_HPA) & (offset == 0.0)
    drop = _log_drop(altitude, 0.0) + np.log(qnh / STANDARD_HPA)
    return unflatten(np.where(standard, altitude, _height_of(drop, offset)), shape)


def scene_air(weather: Any) -> dict[str, float]:
    """Return a scene's air as the parameters of these functions; empty for the standard's."""
    if weather is None:
        return {}
    air = {"qnh_hpa": weather.qnh_hpa, "offset_k": weather.temperature_offset_c}
    return {} if air == {"qnh_hpa": STANDARD_HPA, "offset_k": 0.0} else air


def _checked(name: str, height_m: ArrayLike, qnh_hpa: ArrayLike, offset_k: ArrayLike) -> Any:
    offset = finite("offset_k", offset_k)
    refuse("offset_k", offset, offset <= -100.0, "be above -100")
    height = check_within(name, height_m, LOWEST_M, HIGHEST_M, "m")
    return broadcast_flat(height_m=height, qnh_hpa=positive("qnh_hpa", qnh_hpa), offset_k=offset)


def _log_drop(height: Any, offset: Any) -> Any:
    """Return by how much the logarithm of pressure falls from sea level to heights."""
    below = np.minimum(height, _TROPOPAUSE_M)
    warmth = _SEA_LEVEL_K + offset
    exponent = _HYDROSTATIC_K_M / _LAPSE_K_M
    drop = -exponent * np.log1p(-_LAPSE_K_M * below / warmth)
    return drop + _HYDROSTATIC_K_M * (height - below) / (_TROPOPAUSE_K + offset)


def _height_of(drop: Any, offset: Any) -> Any:
    """Return the heights at which the logarithm of pressure fell by so much."""
    tropopause = _log_drop(_TROPOPAUSE_M, offset)
    below = np.minimum(drop, tropopause)
    warmth = _SEA_LEVEL_K + offset
    height = -warmth / _LAPSE_K_M * np.expm1(-below * _LAPSE_K_M / _HYDROSTATIC_K_M)
    return height + (drop - below) * (_TROPOPAUSE_K + offset) / _HYDROSTATIC_K_M
