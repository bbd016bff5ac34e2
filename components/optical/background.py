"""The effect of daylight on a target's contrast: sun, sky and ground behind it."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from components.optical.contrast import contrast_gain
from components.sensor.look import Cells
from components.terrain.rays import dip_rad
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

        terrain = block.context.sections.get("terrain")

        def gain_against(cells: Cells, background: str) -> FloatArray:
            gain = contrast_gain(
                model="daylight",
                azimuth_rad=cells.azimuth_rad,
                elevation_rad=cells.elevation_rad,
                paint_reflectance=cells.of_target(cells.roster.column("paint_reflectance")),
                ground_reflectance=p.ground_reflectance,
                sky=p.sky,
                background=background,
                **sun,
            )
            return np.asarray(gain)

        if p.background != "auto" or terrain is None or not terrain.horizon:
            return lambda cells: gain_against(cells, p.background)
        surface_m, refraction = terrain.height_m or 0.0, terrain.refraction

        def factor(cells: Cells) -> FloatArray:
            # From up here there is sky down to the dip of the horizon.
            dip = dip_rad(cells.of_row("own_alt_m") - surface_m, refraction)
            sky, ground = (gain_against(cells, name) for name in ("sky", "ground"))
            return np.where(cells.elevation_rad >= -dip, sky, ground)

        return factor
