"""The blind range as an effect: how near a radar no longer hears a target."""

from typing import Any

import numpy as np

from components.radar.radar_block import CellFactor
from components.sensor.look import Cells
from dsa_des.arrays.types import FloatArray
from dsa_des.block.effect import Effect, Verdict


class BlindRange(Effect):
    """No echo closer than ``minimum_range_m``: the receiver is shut while the pulse leaves."""

    lockstep = True
    name = "blind range"
    acts_on = "SNR"

    def verdict(self, block: Any) -> Verdict:
        """Ask for ``minimum_range_m``."""
        nearest = block.p.minimum_range_m
        if nearest is None:
            return Verdict(False, "minimum_range_m is not given")
        return Verdict(True, f"minimum_range_m is {nearest:g}")

    def build(self, block: Any) -> CellFactor:
        """Return the factor on every cell's SNR: 0 closer than the minimum range, else 1."""
        nearest_m = 0.0 if block.p.minimum_range_m is None else block.p.minimum_range_m

        def factor(cells: Cells) -> FloatArray:
            return np.where(cells.range_m < nearest_m, 0.0, 1.0)

        return factor
