"""The grid on which a sensor reports lines of sight, and the variance of rounding to it."""

import math
from collections.abc import Mapping
from functools import cached_property, lru_cache

import numpy as np

from components.geometry import rising_sector
from components.geometry.angles import TWO_PI, past, wrap_pi
from components.sensor.resolution import Grid
from dsa_des.arrays.types import FloatArray

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


def variance_of_step(step: float) -> float:
    """Return the variance of an error that is uniform over one step of a grid."""
    return step**2 / 12.0


class SensorGrid:
    """The grid of what a sensor measures, within its field of view.

    Parameters
    ----------
    azimuth_field_rad, elevation_field_rad : (first, last)
        Field of view in the sensor's axes, azimuth clockwise from the first.
    steps : mapping
        Of ``azimuth`` and ``elevation`` (rad), and of ``range`` (m) and ``range_rate`` (m/s) where
        they are measured.
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
        self.variances = {VARIANCE_OF[name]: variance_of_step(step) for name, step in steps.items()}

    def round(
        self, azimuth_rad: FloatArray, elevation_rad: FloatArray, range_m: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Round a line of sight to the grid and the field of view (thesis §3.5.1).

        Returns
        -------
        azimuth_rad, elevation_rad, range_m : arrays
            Range is NaN where none is measured.
        """
        azimuth = self._round_azimuth(azimuth_rad)
        elevation = self._elevation_grid.round(elevation_rad)
        if self._range_step is None:
            return azimuth, elevation, np.full(len(range_m), np.nan)
        return azimuth, elevation, self._range_grid.round(range_m)

    def round_rate(self, range_rate_m_s: FloatArray) -> FloatArray:
        """Round range rates."""
        return self._rate_grid.round(range_rate_m_s)

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
        """The field of view with its upper edge at or above its lower one."""
        return rising_sector(*self._field)

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
        unwrapped = np.clip(low + past(azimuth_rad - low, TWO_PI), low, high)
        return wrap_pi(self._azimuth_grid.round(unwrapped))
