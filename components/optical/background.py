"""The effect of daylight on a target's contrast: sun, sky and ground behind it."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from components.optical.contrast import contrast_gain
from components.sensor.look import Cells
from dsa_des.arrays.types import FloatArray
from dsa_des.block.effect import Effect, Verdict


class Background(Effect):
    """Contrast of the painted target against sky or ground under the scene's sun."""

    lockstep = True
    name = "background and sun"
    acts_on = "contrast"
    neutral = False
    outside_the_proof = "no sun leaves every target's contrast exactly as it is"

    def verdict(self, block: Any) -> Verdict:
        """Ask for ``background``."""
        background = block.p.background
        return Verdict(background != "none", f"background is {background!r}")

    def build(self, block: Any) -> Callable[[Cells], FloatArray]:
        """Return the factor on every cell's contrast."""
        p = block.p
        sun = {
            "sun_azimuth_rad": math.radians(p.sun_azimuth_deg),
            "sun_elevation_rad": math.radians(p.sun_elevation_deg),
            "sun_exclusion_rad": math.radians(p.sun_exclusion_deg),
        }

        def factor(cells: Cells) -> FloatArray:
            gain = contrast_gain(
                model="daylight",
                azimuth_rad=cells.azimuth_rad,
                elevation_rad=cells.elevation_rad,
                paint_reflectance=cells.of_target(cells.roster.column("paint_reflectance")),
                ground_reflectance=p.ground_reflectance,
                sky=p.sky,
                background=p.background,
                **sun,
            )
            return np.asarray(gain)

        return factor
