"""The grid on which a sensor reports: rounding to it, and the variance that it leaves."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import cached_property, lru_cache
from math import copysign, fmod
from typing import Any

import numpy as np

from components.geometry import TWO_PI, remainder, unwrap_sector, wrap_pi
from dsa_des.arrays.column_values import constant_column, shared_nan_column
from dsa_des.arrays.types import FloatArray

# A limit that misses a grid point by no more than this share of itself counts as lying on it: 110
# times one degree in radians and 110 degrees in radians differ in the last bit.
_LIMIT_TOLERANCE = 4.0 * float(np.finfo(np.float64).eps)

# From 2^50 steps on the grid is hardly wider than the spacing of doubles, and beyond 1e300 the next
# grid point may not exist: such values stay as they are.
_COUNTABLE = 2.0**-50
_LARGEST = 1e300

# Up to this many values Python's numbers take less time than the calls of NumPy do.
_FEW = 6


class Grid:
    """The grid of one quantity that a sensor reports: multiples of `step` (0: no rounding).

    A value is rounded to the nearest multiple, ties to the even one. The decision is exact for the
    doubles given: which of two grid points is nearer follows from the exact remainder (fmod), not
    from value / step, whose own rounding can move a value across a cell edge. Exactly half-way
    means that 2·value is an odd multiple of `step` as doubles. The result is the multiple, rounded
    once. Rounding is symmetric about 0: the grid of -value is minus the grid of value, and 0 is
    never negative. Values of more than 2^50 steps or beyond 1e300 stay as they are.

    With limits (the edges of the field of view) a grid point beyond a limit is replaced by the
    outermost one inside, so a report never leaves the field of view; a limit within 4 last places
    of a grid point counts as that grid point, and the report is then the limit itself if the grid
    point would stick out. Angles that wrap are the caller's to wrap, before and after. Thesis
    §3.5.1: the vector is rounded to the nearest point in the resolution grid.
    """

    def __init__(
        self, step: float, *, limit_low: float | None = None, limit_high: float | None = None
    ) -> None:
        for name, value in (("step", step), ("limit_low", limit_low), ("limit_high", limit_high)):
            if value is not None and not math.isfinite(value):
                raise ValueError(f"{name} is {value}: it must be finite (no NaN, no infinity)")
        if step < 0.0:
            raise ValueError(f"step is {step}: it must be 0 or more")
        self.step = float(step)
        self._countable = min(self.step, 1e200) / _COUNTABLE
        low = None if limit_low is None else -_floor_to_grid(np.float64(-limit_low), step)
        high = None if limit_high is None else _floor_to_grid(np.float64(limit_high), step)
        self._lowest = None if low is None else float(low)
        self._highest = None if high is None else float(high)
        if limit_low is not None and limit_high is not None and limit_low > limit_high:
            raise ValueError(
                f"limit_low is {limit_low}: it must not be above limit_high, {limit_high}"
            )
        if low is not None and high is not None and low > high:
            raise ValueError(
                f"step is {self.step}: at least one of its multiples must lie between "
                "limit_low and limit_high"
            )

    def round(self, values: FloatArray) -> FloatArray:
        """Return values (must be finite, unchecked) rounded to steps within the grid's limits."""
        if self.step == 0.0:
            result = values
        elif values.size <= _FEW and values.ndim == 1:
            return np.array(self._round_short_list(values.tolist()))
        else:
            size = np.abs(values)
            # NaN, and what cannot be counted in steps, take the general way.
            simple = size.size and float(size.max()) < self._countable
            result = (
                _round_countable(size, self.step) if simple else _round_to_grid(size, self.step)
            )
            result = np.copysign(result, values)
        if self._highest is not None:
            result = np.minimum(result, self._highest)
        if self._lowest is not None:
            result = np.maximum(result, self._lowest)
        return result + 0.0  # adding 0 turns -0 into 0

    def _round_short_list(self, values: list[float]) -> list[float]:
        """Return a short list's values, each rounded exactly as by `_round_countable`."""
        step, countable, low, high = self.step, self._countable, self._lowest, self._highest
        results = []
        for value in values:
            size = abs(value)
            if size < countable:
                rest = fmod(size, step)
                whole = round((size - rest) / step)
                other = step - rest
                if rest > other or (rest == other and whole % 2 == 1):
                    whole += 1
                result = whole * step
            else:
                result = float(_round_to_grid(np.float64(size), step))
            result = copysign(result, value)
            if high is not None and result > high:
                result = high
            if low is not None and result < low:
                result = low
            results.append(result + 0.0)
        return results


def _mask_steps_and_remainders(size: Any, steps: Any) -> tuple[Any, Any, Any]:
    """Return, for sizes >= 0, which are rounded (mask), the whole steps and the remainder."""
    counts = (steps > 0.0) & (size * _COUNTABLE < steps) & (size < _LARGEST)
    spacing = np.where(counts, steps, 1.0)
    size = np.where(counts, size, 0.0)
    rest = np.fmod(size, spacing)
    return counts, np.rint((size - rest) / spacing), rest


def _round_to_grid(size: Any, steps: Any) -> Any:
    """Return sizes >= 0 rounded to the nearest step, ties to even; uncountable ones unchanged."""
    counts, whole, rest = _mask_steps_and_remainders(size, steps)
    return np.where(counts, (whole + _is_rounded_up(whole, rest, steps)) * steps, size)


def _round_countable(size: FloatArray, step: float) -> FloatArray:
    """Return sizes >= 0 rounded to the nearest step; all must be small enough to count in steps."""
    steps = size / step
    whole = np.rint(steps)
    # Off by at most 2^-53 of itself, the quotient tells which point is nearer, but half-way.
    off = np.abs(steps - whole)
    off += steps * 2.0**-51
    unsure = off >= 0.5
    if np.count_nonzero(unsure):
        rest = np.fmod(size[unsure], step)
        exact = np.rint((size[unsure] - rest) / step)
        whole[unsure] = exact + _is_rounded_up(exact, rest, step)
    whole *= step
    return whole


def _is_rounded_up(whole: Any, rest: Any, steps: Any) -> Any:
    """Return where remainders exceed half a step, or are half after an odd step count (mask)."""
    # rest and steps - rest are compared without rounding: below half a step rest is subtracted
    # from the larger, above it the subtraction is exact (Sterbenz).
    other = steps - rest
    up = rest > other
    halfway = rest == other
    if halfway.any():
        up |= halfway & (np.fmod(whole, 2.0) == 1.0)
    return up


def _floor_to_grid(limit: Any, steps: Any) -> Any:
    """Return the largest multiple of the step up to the limit, allowing for rounding error."""
    size = np.abs(limit)
    counts, whole, rest = _mask_steps_and_remainders(size, steps)
    above = limit >= 0.0
    # Going down from a negative limit is going up in size.
    near_next = (steps - rest) <= size * _LIMIT_TOLERANCE
    near_this = rest <= size * _LIMIT_TOLERANCE
    inside = np.where(above, whole + near_next, -np.where(near_this, whole, whole + 1.0))
    return np.where(counts, np.minimum(inside * steps, limit), limit)


#: Columns of `Detections` that hold variances, by measured quantity.
VARIANCE_OF = {
    "azimuth": "azimuth_variance_rad2",
    "elevation": "elevation_variance_rad2",
    "range": "range_variance_m2",
    "range_rate": "range_rate_variance_m2_s2",
}
AZIMUTH, ELEVATION = VARIANCE_OF["azimuth"], VARIANCE_OF["elevation"]

# The shortest range that is reported where there is no grid.
_NEAREST_M = 1e-3

# Grids are the same in every run of a scene: they are made once.
_grid = lru_cache(maxsize=256)(Grid)


def rounding_variance_of_step(step: float) -> float:
    """Return the variance of an error that is uniform over one step of a grid."""
    return step**2 / 12.0


Values = Mapping[str, FloatArray]
#: Values by quantity, and variances by column, in the sensor's axes.
Measured = tuple[dict[str, FloatArray], dict[str, FloatArray]]


class SensorGrid:
    """The grid of what a sensor measures, within its field of view in its own axes.

    Steps of azimuth and elevation are in rad, those of range in m and of range rate in m/s.
    """

    def __init__(
        self,
        azimuth_field_rad: tuple[float, float],
        elevation_field_rad: tuple[float, float],
        steps: Mapping[str, float],
    ) -> None:
        self._field = azimuth_field_rad
        self._heights = elevation_field_rad
        self._azimuth_step, self._elevation_step = steps["azimuth"], steps["elevation"]
        self._range_step = steps.get("range")
        self._rate_grid = _grid(steps.get("range_rate", 0.0))
        #: Of rounding, by the column that it fills.
        self.variances = {
            VARIANCE_OF[name]: rounding_variance_of_step(step) for name, step in steps.items()
        }

    def __call__(self, cells: Any, detected: Any, look: Any, true: Values) -> Measured:
        """Return measured values of true ones by quantity, as `ErrorModel` does."""
        return self.measure_false_alarms(true)

    def measure_false_alarms(
        self, where: Values, signal: Any = None, drawn: Any = None
    ) -> Measured:
        """Return false alarms' azimuth, elevation, range on the grid, and variances step²/12."""
        line = self.round(where["azimuth"], where["elevation"], where["range"])
        values = dict(zip(("azimuth", "elevation", "range"), line, strict=True))
        if "range_rate" in where:
            values["range_rate"] = self._rate_grid.round(where["range_rate"])
        count = len(values["azimuth"])
        return values, {
            name: constant_column(v, count, np.float64) for name, v in self.variances.items()
        }

    def round(
        self, azimuth_rad: FloatArray, elevation_rad: FloatArray, range_m: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return azimuth, elevation (rad) and range (m or NaN), rounded and clipped to the grid."""
        azimuth = self._round_azimuth(azimuth_rad)
        elevation = self._elevation_grid.round(elevation_rad)
        if self._range_step is None:
            return azimuth, elevation, shared_nan_column(len(range_m))
        return azimuth, elevation, self._range_grid.round(range_m)

    @cached_property
    def _elevation_grid(self) -> Grid:
        low, high = self._heights
        return _grid(self._elevation_step, limit_low=low, limit_high=high)

    @cached_property
    def _range_grid(self) -> Grid:
        # Nothing is at range 0, however near it comes: the first step is the nearest report.
        return _grid(self._range_step or 0.0, limit_low=self._range_step or _NEAREST_M)

    @cached_property
    def _azimuth_sector(self) -> tuple[float, float]:
        """Lower and upper azimuth of view, rad; 2 pi is added to an upper one below the lower."""
        return unwrap_sector(*self._field)

    @cached_property
    def _azimuth_grid(self) -> Grid:
        low, high = self._azimuth_sector
        if high - low >= TWO_PI:
            return _grid(self._azimuth_step)
        return _grid(self._azimuth_step, limit_low=low, limit_high=high)

    def _round_azimuth(self, azimuth_rad: FloatArray) -> FloatArray:
        low, high = self._azimuth_sector
        if high - low >= TWO_PI:
            return wrap_pi(self._azimuth_grid.round(azimuth_rad))
        if low >= -math.pi and high <= math.pi:
            return self._azimuth_grid.round(azimuth_rad)
        # The field runs across ±pi: unwrap into it, so that its edges are its limits.
        unwrapped = np.clip(low + remainder(azimuth_rad - low, TWO_PI), low, high)
        return wrap_pi(self._azimuth_grid.round(unwrapped))
