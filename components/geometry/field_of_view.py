"""The field of view of a sensor: a test of directions, and its width."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from components.arguments.checks import common_shape, squarable
from components.geometry.angles import TWO_PI, wrap_pi_unchecked
from dsa_des.arrays.types import FloatArray

BoolArray = npt.NDArray[np.bool_]

_EPS = float(np.finfo(np.float64).eps)
# Rounding of two angles near 2 pi, of 2 pi itself and of their sum.
_WRAP_TOLERANCE_RAD = 8.0 * _EPS


def inside(
    azimuth_rad: npt.ArrayLike,
    elevation_rad: npt.ArrayLike,
    *,
    azimuth_min_rad: float,
    azimuth_max_rad: float,
    elevation_min_rad: float,
    elevation_max_rad: float,
) -> BoolArray:
    """Tell which directions lie inside a field of view."""
    low, high = _azimuth_bounds(azimuth_min_rad, azimuth_max_rad)
    _require("elevation_min_rad", elevation_min_rad, 0.5 * math.pi, "[-pi/2, pi/2]")
    _require("elevation_max_rad", elevation_max_rad, 0.5 * math.pi, "[-pi/2, pi/2]")
    if elevation_min_rad > elevation_max_rad:
        raise ValueError(
            f"elevation_min_rad is {elevation_min_rad}: it must not exceed elevation_max_rad, "
            f"{elevation_max_rad}"
        )
    p, q = squarable("azimuth_rad", azimuth_rad), squarable("elevation_rad", elevation_rad)
    shape = common_shape(azimuth_rad=p, elevation_rad=q)
    in_elevation = (q >= elevation_min_rad) & (q <= elevation_max_rad)
    if high - low >= TWO_PI:
        return np.array(np.broadcast_to(in_elevation, shape))[()]
    in_azimuth = _in_sector(np.atleast_1d(p), low, high).reshape(p.shape)
    return np.asarray(in_azimuth & in_elevation)[()]


class FieldOfView:
    """A field of view, checked once, for azimuths in (-pi, pi] that are known to be finite.

    Parameters
    ----------
    azimuth_rad, elevation_rad : (min, max)
        As for `inside`.

    Raises
    ------
    ValueError
        A bound out of range.
    """

    def __init__(
        self, azimuth_rad: tuple[float, float], elevation_rad: tuple[float, float]
    ) -> None:
        inside(
            0.0, 0.0, azimuth_min_rad=azimuth_rad[0], azimuth_max_rad=azimuth_rad[1],
            elevation_min_rad=elevation_rad[0], elevation_max_rad=elevation_rad[1],
        )  # fmt: skip
        self._low, self._high = _azimuth_bounds(*azimuth_rad)
        self._lowest, self._highest = elevation_rad
        self._turns = bool(_turns(self._low, self._high))

    def holds(self, azimuth_rad: FloatArray, elevation_rad: FloatArray) -> BoolArray:
        """Tell which directions lie inside, as `inside` does."""
        result = elevation_rad >= self._lowest
        result &= elevation_rad <= self._highest
        if self._high - self._low < TWO_PI:
            within = azimuth_rad >= self._low
            within &= azimuth_rad <= self._high
            if self._turns:
                within = _at_other_turns(azimuth_rad, azimuth_rad, self._low, self._high, within)
            result &= within
        return result


def rising_sector(low_rad: float, high_rad: float) -> tuple[float, float]:
    """Give a sector's bounds with the upper one a turn on where it was below the lower one."""
    return low_rad, high_rad + TWO_PI if high_rad < low_rad else high_rad


def sector_width_rad(low_rad: float, high_rad: float) -> float:
    """Give the angle clockwise from the first azimuth to the second, in (0, 2 pi] and rounding."""
    return high_rad - low_rad if high_rad > low_rad else high_rad - low_rad + TWO_PI


def _azimuth_bounds(azimuth_min_rad: float, azimuth_max_rad: float) -> tuple[float, float]:
    _require("azimuth_min_rad", azimuth_min_rad, TWO_PI, "[-2 pi, 2 pi]")
    _require("azimuth_max_rad", azimuth_max_rad, TWO_PI, "[-2 pi, 2 pi]")
    low, high = rising_sector(float(azimuth_min_rad), float(azimuth_max_rad))
    if high < low:
        raise ValueError(
            f"azimuth_min_rad is {azimuth_min_rad}: it must be at most one turn above "
            f"azimuth_max_rad, {azimuth_max_rad}"
        )
    return low, high


def _in_sector(azimuth: FloatArray, low: float, high: float) -> BoolArray:
    """Compare azimuths with bounds, at every whole turn that the bounds can reach."""
    p = wrap_pi_unchecked(azimuth)
    slack = _WRAP_TOLERANCE_RAD + _EPS * np.abs(azimuth)
    slack_here = np.where(p == azimuth, 0.0, slack)
    result = (p >= low - slack_here) & (p <= high + slack_here)
    return _at_other_turns(p, azimuth, low, high, result)


def _at_other_turns(
    p: FloatArray, azimuth: FloatArray, low: float, high: float, result: BoolArray
) -> BoolArray:
    """Add to the result what lies inside after whole turns; p is the wrapped azimuth."""
    for shift in _turns(low, high):
        turned = p + shift
        slack = _WRAP_TOLERANCE_RAD + _EPS * np.abs(azimuth)
        result |= (turned >= low - slack) & (turned <= high + slack)
    return result


def _turns(low: float, high: float) -> list[float]:
    """Return the whole turns by which an azimuth may have to be moved to lie in the field."""
    shifts = [turns * TWO_PI for turns in (-2.0, -1.0, 1.0, 2.0)]
    # A margin of 1 rad only decides whether the comparison is worth doing.
    return [s for s in shifts if s - math.pi <= high + 1.0 and s + math.pi >= low - 1.0]


def _require(name: str, value: float, limit: float, allowed: str) -> None:
    if not abs(value) <= limit:
        raise ValueError(f"{name} is {value}: it must lie in {allowed}")
