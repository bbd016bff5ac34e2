"""The signature that a target's motion across the picture adds (thesis eq. 16-18)."""

from collections.abc import Callable
from typing import Any

import numpy as np

from components.optical.line_of_sight_rate import line_of_sight_rate
from components.sensor.look import Cells
from dsa_des.arrays.types import FloatArray
from dsa_des.block.effect import Effect, Verdict


class DynamicSignature(Effect):
    """The rate of the line of sight adds b·V to the signature."""

    name = "dynamic signature"
    acts_on = "signature"

    def verdict(self, block: Any) -> Verdict:
        """Ask for the weight b."""
        weight = block.p.dynamic_weight
        return Verdict(weight > 0, f"dynamic_weight is {weight:g}")

    def build(self, block: Any) -> Callable[[Cells], FloatArray]:
        """Return what is added to every cell's signature."""
        return MovingTargets(block.p.dynamic_weight, block.p.rate, block.context.ticks_per_s)


class MovingTargets:
    """Remembers where each target was at the last scan, and weighs how fast it moves.

    Parameters
    ----------
    weight_s : float
        b of eq. 18, s/rad.
    model : {"exact", "thesis"}
    ticks_per_s : int
    """

    def __init__(self, weight_s: float, model: str, ticks_per_s: int) -> None:
        self.weight_s = weight_s
        self.model = model
        self._ticks_per_s = ticks_per_s
        # Tick and NED angles of the last scan, one column per target; NaN where it saw none.
        self._last: tuple[int, FloatArray, FloatArray] | None = None

    def __call__(self, cells: Cells) -> FloatArray:
        """Return b·V of every cell."""
        return self.weight_s * self.rate(cells)

    def rate(self, cells: Cells) -> FloatArray:
        """Return each cell's rate of the line of sight since the scan before, rad/s.

        A target's first look has none, nor has the first after a scan that did not see it.
        """
        scans, targets = len(cells.scan_ticks), len(cells.roster)
        azimuth = np.full((scans + 1, targets), np.nan)
        elevation = np.full((scans + 1, targets), np.nan)
        tick = np.concatenate(([0], cells.scan_ticks))
        if self._last is not None:
            tick[0], azimuth[0], elevation[0] = self._last
        azimuth[cells.row + 1, cells.target] = cells.azimuth_rad
        elevation[cells.row + 1, cells.target] = cells.elevation_rad
        self._last = (int(tick[-1]), azimuth[-1].copy(), elevation[-1].copy())
        before = azimuth[cells.row, cells.target]
        interval = (tick[1:] - tick[:-1])[cells.row] / self._ticks_per_s
        return np.asarray(
            line_of_sight_rate(
                cells.azimuth_rad,
                cells.elevation_rad,
                before,
                elevation[cells.row, cells.target],
                np.where(np.isnan(before), 1.0, interval),
                seen_before=~np.isnan(before),
                model=self.model,
            )
        )
