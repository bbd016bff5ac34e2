"""What of a measurement's error was in the same sensor's last one already.

A value on a grid is off by the same as long as it stays in its cell, a bias throughout a run, an
error with a correlation time for that long. A filter that takes such errors for new ones at every
look is too sure. Here is how much of them a measurement has in common with the one before; what is
new in it is worked out by `components.estimation.kalman.variance_of_what_is_new`.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from components.messages.detections import SensorOffer
from dsa_des.arrays.types import FloatArray, IntArray

_QUANTITIES = ("azimuth", "elevation", "range", "range_rate")


@dataclass(frozen=True, eq=False)
class LastingErrors:
    """What of each sensor's errors lasts, each (4 quantities, sensors); 0 where nothing does.

    Parameters
    ----------
    step : ndarray
        Of the grid.
    bias : ndarray
        Variance of what stays the same.
    variance, lasts_s : ndarray
        Of what is forgotten with a time constant.
    """

    step: FloatArray
    bias: FloatArray
    variance: FloatArray
    lasts_s: FloatArray

    @classmethod
    def of(cls, offers: Mapping[str, Any], sensors: tuple[str, ...]) -> "LastingErrors | None":
        """Return those of the sensors, or None where all errors are new at every look."""
        found = np.zeros((4, len(_QUANTITIES), len(sensors)))
        found[3] = np.inf
        for j, name in enumerate(sensors):
            offer = offers.get(name)
            told = offer.lasting if isinstance(offer, SensorOffer) else None
            for quantity, one in (told or {}).items():
                i = _QUANTITIES.index(quantity)
                found[:, i, j] = one.step, one.bias_variance, one.variance, one.lasts_s
        return cls(*found) if found[:3].any() else None

    def common(
        self,
        rows: list[int],
        source: IntArray,
        variance: FloatArray,
        moved: FloatArray,
        since_s: FloatArray,
    ) -> FloatArray:
        """Return the covariance of measurements' errors with those of their sensors' last ones.

        Parameters
        ----------
        rows : list of int
            Which quantities are measured.
        source : (m, n) of int
            The sensor of each.
        variance : (m, n)
            Of the whole error.
        moved : (m, n)
            How far the value has moved since the sensor's last measurement of the track.
        since_s : (m, n)
            Time since then; infinite where there was none.

        Returns
        -------
        ndarray of shape (m, n)
            Rounding counts with its share that noise does not drown: an error of deviation σ before
            rounding leaves less than exp(-4 π² (σ / step)²) of it (Widrow, Kollár, *Quantization
            Noise* (2008), §19). Errors of values x steps apart have the correlation 1 - 6 x (1 - x)
            up to one step; exp(-6 x) has its slope at 0, and is less only beyond 0.79 steps.
        """
        quantity = np.array(rows)[:, np.newaxis]
        step, bias, lasting, lasts_s = (
            values[quantity, source]
            for values in (self.step, self.bias, self.variance, self.lasts_s)
        )
        rounding = step * step / 12.0
        white = np.maximum(variance - rounding - bias - lasting, 0.0)
        safe = np.where(step > 0.0, step, 1.0)
        # A variance that comes out as 1e-20 of a step has none of its own.
        white = np.where(white > 1e-9 * rounding, white, 0.0)
        rounding = rounding * np.exp(-6.0 * moved / safe - 4.0 * np.pi**2 * white / (safe * safe))
        seen = np.isfinite(since_s)
        # Time over an infinite time constant is 0: nothing is forgotten.
        forgotten = np.exp(-np.where(seen, since_s, 0.0) / lasts_s)
        both = np.minimum(rounding + bias + lasting * forgotten, variance)
        return np.where(seen, both, 0.0)
