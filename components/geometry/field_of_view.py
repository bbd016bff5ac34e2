"""The field of view of a sensor: a test of directions, and its width."""

import math

import numpy as np

from components.geometry.angles import TWO_PI
from dsa_des.arrays.types import BoolArray, FloatArray

_EPS = float(np.finfo(np.float64).eps)
# Rounding of two angles near 2 pi, of 2 pi itself and of their sum.
_WRAP_TOLERANCE_RAD = 8.0 * _EPS


class FieldOfView:
    """A field of view, checked once, for azimuths in (-pi, pi] that are known to be finite.

    Parameters
    ----------
    azimuth_rad : (low, high)
        Clockwise from low to high, each within two turns; the upper may lie below the lower one.
    elevation_rad : (low, high)

    Raises
    ------
    ValueError
        A bound out of range.
    """

    def __init__(
        self, azimuth_rad: tuple[float, float], elevation_rad: tuple[float, float]
    ) -> None:
        self._low, self._high = _checked_azimuth_bounds(*azimuth_rad)
        for name, elevation in zip(("min", "max"), elevation_rad, strict=True):
            _require(f"elevation_{name}_rad", elevation, 0.5 * math.pi, "[-pi/2, pi/2]")
        self._lowest, self._highest = elevation_rad
        if self._lowest > self._highest:
            raise ValueError(
                f"elevation_min_rad is {self._lowest}: it must not exceed elevation_max_rad, "
                f"{self._highest}"
            )
        self._turns = _azimuth_shifts_rad(self._low, self._high)

    def holds(self, azimuth_rad: FloatArray, elevation_rad: FloatArray) -> BoolArray:
        """Return which directions lie inside the field of view, its bounds included."""
        result = elevation_rad >= self._lowest
        result &= elevation_rad <= self._highest
        if self._high - self._low < TWO_PI:
            within = azimuth_rad >= self._low
            within &= azimuth_rad <= self._high
            if self._turns:
                slack = _WRAP_TOLERANCE_RAD + _EPS * np.abs(azimuth_rad)
                for shift in self._turns:
                    turned = azimuth_rad + shift
                    within |= (turned >= self._low - slack) & (turned <= self._high + slack)
            result &= within
        return result


def unwrap_sector(low_rad: float, high_rad: float) -> tuple[float, float]:
    """Return a sector's bounds, the upper one a turn higher if it was below the lower one."""
    return low_rad, high_rad + TWO_PI if high_rad < low_rad else high_rad


def sector_width_rad(low_rad: float, high_rad: float) -> float:
    """Return the angle clockwise from the first azimuth to the second, in (0, 2 pi]."""
    return high_rad - low_rad if high_rad > low_rad else high_rad - low_rad + TWO_PI


def _checked_azimuth_bounds(azimuth_min_rad: float, azimuth_max_rad: float) -> tuple[float, float]:
    _require("azimuth_min_rad", azimuth_min_rad, TWO_PI, "[-2 pi, 2 pi]")
    _require("azimuth_max_rad", azimuth_max_rad, TWO_PI, "[-2 pi, 2 pi]")
    low, high = unwrap_sector(float(azimuth_min_rad), float(azimuth_max_rad))
    if high < low:
        raise ValueError(
            f"azimuth_min_rad is {azimuth_min_rad}: it must be at most one turn above "
            f"azimuth_max_rad, {azimuth_max_rad}"
        )
    return low, high


def _azimuth_shifts_rad(low: float, high: float) -> list[float]:
    """Return whole turns (rad) by which an azimuth may be shifted into the field of view."""
    shifts = [turns * TWO_PI for turns in (-2.0, -1.0, 1.0, 2.0)]
    # A margin of 1 rad only decides whether the comparison is worth doing.
    return [s for s in shifts if s - math.pi <= high + 1.0 and s + math.pi >= low - 1.0]


def _require(name: str, value: float, limit: float, allowed: str) -> None:
    if not abs(value) <= limit:
        raise ValueError(f"{name} is {value}: it must lie in {allowed}")
