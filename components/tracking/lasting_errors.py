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
    """What of each sensor's errors lasts."""

    step: FloatArray  # (4 quantities, sensors): Of the grid; 0 for none
    # (parts, 4 quantities, sensors): As in `LastingPart`; 0 where there is none
    variance: FloatArray
    # (parts, 4 quantities, sensors): As in `LastingPart`; 0 where there is none
    lasts_s: FloatArray
    # (parts, 4 quantities, sensors): As in `LastingPart`; 0 where there is none
    across_m2: FloatArray

    @classmethod
    def of(cls, offers: Mapping[str, Any], sensors: tuple[str, ...]) -> "LastingErrors | None":
        """Return those of the sensors, or None where all errors are new at every look."""
        told = {
            (_QUANTITIES.index(quantity), j): one
            for j, name in enumerate(sensors)
            if isinstance(offer := offers.get(name), SensorOffer)
            for quantity, one in (offer.lasting or {}).items()
        }
        if not told:
            return None
        most = max(len(one.parts) for one in told.values())
        step = np.zeros((len(_QUANTITIES), len(sensors)))
        variance, across_m2 = np.zeros((2, most, *step.shape))
        lasts_s = np.full(variance.shape, np.inf)
        for place, one in told.items():
            step[place] = one.step
            for k, part in enumerate(one.parts):
                variance[k][place], across_m2[k][place] = part.variance, part.across_m2
                lasts_s[k][place] = part.lasts_s
        return cls(step, variance, lasts_s, across_m2)

    def common(
        self,
        rows: list[int],
        source: IntArray,
        variance: FloatArray,
        moved: FloatArray,
        since_s: FloatArray,
        range_m: FloatArray,
    ) -> FloatArray:
        """Return the covariance of measurements' errors with those of their sensors' last ones."""
        quantity = np.array(rows)[:, np.newaxis]
        step, lasts_s = self.step[quantity, source], self.lasts_s[:, quantity, source]
        lasting = self.variance[:, quantity, source]
        if self.across_m2.any():
            lasting = lasting + self.across_m2[:, quantity, source] / np.maximum(range_m, 1.0) ** 2
        rounding = step * step / 12.0
        white = np.maximum(variance - rounding - lasting.sum(axis=0), 0.0)
        safe = np.where(step > 0.0, step, 1.0)
        # A variance that comes out as 1e-20 of a step has none of its own.
        white = np.where(white > 1e-9 * rounding, white, 0.0)
        rounding = rounding * np.exp(-6.0 * moved / safe - 4.0 * np.pi**2 * white / (safe * safe))
        seen = np.isfinite(since_s)
        # Time over an infinite time constant is 0: nothing is forgotten.
        forgotten = np.exp(-np.where(seen, since_s, 0.0) / lasts_s)
        return np.where(seen, rounding + (lasting * forgotten).sum(axis=0), 0.0)
