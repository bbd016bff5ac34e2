"""Pressure altitude and height: what altimeters read at a height in air that is not the standard's.

The air is hydrostatic and dry, and the same over all of a scene. Heights count as geopotential
ones, from which they differ by 1.4 m at 3 km. A scene of the standard's, where sea level lies on
the ellipsoid, has no `Air`: altitude and height are the same number. ICAO, "Manual of the ICAO
standard atmosphere", Doc 7488.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from components.arguments.checks import check_within
from dsa_des.arrays.types import FloatArray, IntArray

#: Pressure at sea level, hPa.
STANDARD_HPA = 1013.25
_SEA_LEVEL_K, _LAPSE_K_M, _TROPOPAUSE_M = 288.15, 0.0065, 11_000.0
_ZERO_C_K = 273.15
#: g / R of dry air, K/m.
_HYDROSTATIC_K_M = 9.80665 / 287.05287
#: Heights at which the formulas are used; the layer above the tropopause is continued.
LOWEST_M, HIGHEST_M = -5_000.0, 30_000.0


@dataclass(frozen=True)
class Air:
    """The air of a scene: what altimeters set to 1013.25 hPa read at heights above the ellipsoid.

    Parameters
    ----------
    qnh_hpa : float
        Pressure at sea level.
    offset_k : float
        How much warmer the air is than the standard's at every height, above -100.
    profile_c : tuple of (height, temperature)
        In its place, what the temperature is (deg C) at rising heights above sea level (m): even
        in between, and below and above as much off the standard's as at the nearest of them.
    geoid_m : float
        How high sea level lies above the ellipsoid.
    """

    qnh_hpa: float = STANDARD_HPA
    offset_k: float = 0.0
    profile_c: tuple[tuple[float, float], ...] = ()
    geoid_m: float = 0.0

    def pressure_altitude_m(self, height_m: ArrayLike) -> Any:
        """Return the pressure altitude, m, at heights of -5 to 30 km above the ellipsoid."""
        height = check_within("height_m", height_m, LOWEST_M, HIGHEST_M, "m") - self.geoid_m
        return _STANDARD.height_of_pressure_drop_m(
            self._column.log_pressure_drop(height) - self._log_qnh_over_standard
        )

    def height_of_pressure_altitude_m(self, altitude_m: ArrayLike) -> Any:
        """Return heights above the ellipsoid, m, where altimeters read these pressure altitudes."""
        altitude = check_within("altitude_m", altitude_m, LOWEST_M, HIGHEST_M, "m")
        return (
            self._column.height_of_pressure_drop_m(
                _STANDARD.log_pressure_drop(altitude) + self._log_qnh_over_standard
            )
            + self.geoid_m
        )

    @property
    def _log_qnh_over_standard(self) -> float:
        return float(np.log(self.qnh_hpa / STANDARD_HPA))

    @cached_property
    def _column(self) -> _AirColumn:
        off_k = self.offset_k
        known = {h: c + _ZERO_C_K for h, c in self.profile_c} or {0.0: _SEA_LEVEL_K + off_k}
        heights, kelvin = np.array(sorted(known.items())).T
        off = kelvin - _standard_temperature_k(heights)
        every = np.union1d(heights, [0.0, _TROPOPAUSE_M])
        outside = _standard_temperature_k(every) + np.interp(every, heights, off)
        inside = (every >= heights[0]) & (every <= heights[-1])
        return _AirColumn(every, np.where(inside, np.interp(every, heights, kelvin), outside))


def scene_air(sections: Mapping[str, Any]) -> Air | None:
    """Return the air of a scene's ``weather`` and ``terrain``; None for the standard atmosphere."""
    weather, terrain = sections.get("weather"), sections.get("terrain")
    air = Air(geoid_m=0.0 if terrain is None else terrain.geoid_undulation_m)
    if weather is not None:
        column = weather.temperature_offset_c, weather.temperature_profile_c
        air = Air(weather.qnh_hpa, *column, air.geoid_m)
    return None if air == Air() else air


class _AirColumn:
    """Air with temperature given at rising heights, among them 0 and 11 km, linear between.

    It falls by the standard's lapse rate below the lowest, and is the same above the highest.
    """

    def __init__(self, heights_m: FloatArray, kelvin: FloatArray) -> None:
        self._from_m, below = heights_m, np.concatenate([[0], np.arange(len(heights_m))])
        self._base_m, self._base_k = heights_m[below], kelvin[below]
        lapse = -np.diff(kelvin) / np.diff(heights_m)
        self._lapse_k_m = np.concatenate([[_LAPSE_K_M], lapse, [0.0]])
        layer = np.arange(1, len(heights_m))
        drops = np.concatenate(
            [[0.0], np.cumsum(self._log_drop_in_layer(layer, np.diff(heights_m)))]
        )
        self._from_drop = drops - drops[np.searchsorted(heights_m, 0.0)]
        self._base_drop = self._from_drop[below]

    def log_pressure_drop(self, height_m: FloatArray) -> FloatArray:
        """Return by how much the natural log of pressure falls from sea level to these heights."""
        layer = np.searchsorted(self._from_m, height_m, side="right")
        above_m = height_m - self._base_m[layer]
        return np.asarray(self._base_drop[layer] + self._log_drop_in_layer(layer, above_m))

    def _log_drop_in_layer(self, layer: IntArray, height_m: FloatArray) -> FloatArray:
        """Return the fall of the log of pressure from each layer's base to `height_m` above it."""
        lapse, kelvin = self._lapse_k_m[layer], self._base_k[layer]
        even = np.where(lapse == 0.0, 1.0, lapse)
        falling = -_HYDROSTATIC_K_M / even * np.log1p(-lapse * height_m / kelvin)
        return np.where(lapse == 0.0, _HYDROSTATIC_K_M * height_m / kelvin, falling)

    def height_of_pressure_drop_m(self, drop: FloatArray) -> FloatArray:
        """Return heights above sea level, m, over which the logarithm of pressure falls so much."""
        layer = np.searchsorted(self._from_drop, drop, side="right")
        lapse, kelvin = self._lapse_k_m[layer], self._base_k[layer]
        share = (drop - self._base_drop[layer]) / _HYDROSTATIC_K_M
        even = np.where(lapse == 0.0, 1.0, lapse)
        falling = -kelvin / even * np.expm1(-share * lapse)
        return np.asarray(self._base_m[layer] + np.where(lapse == 0.0, share * kelvin, falling))


def _standard_temperature_k(height_m: FloatArray) -> FloatArray:
    return _SEA_LEVEL_K - _LAPSE_K_M * np.minimum(height_m, _TROPOPAUSE_M)


_STANDARD = _AirColumn(
    np.array([0.0, _TROPOPAUSE_M]), _standard_temperature_k(np.array([0.0, _TROPOPAUSE_M]))
)
