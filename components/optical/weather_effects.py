"""The contrast that haze, fog and rain take from a camera."""

from collections.abc import Callable
from typing import Any

import numpy as np

from components.atmosphere.visibility import (
    combined_visibility_m,
    fog_visibility_m,
    rain_visibility_m,
)
from components.environment.tables import Weather
from components.optical.contrast import visibility_transmission
from components.sensor.look import Cells
from dsa_des.arrays.types import FloatArray
from dsa_des.block.effect import Effect, Verdict


class Visibility(Effect):
    """Contrast falls with range by Koschmieder's law.

    The visibility is the scene's own, or follows from its fog and rain.
    """

    lockstep = True
    name = "visibility"
    acts_on = "contrast"

    def verdict(self, block: Any) -> Verdict:
        """Ask ``[weather]`` for a visibility, fog or rain."""
        weather = block.context.sections["weather"]
        if weather.visibility_km is not None:
            return Verdict(True, f"[weather] visibility_km is {weather.visibility_km:g}")
        found = [
            f"{key} is {value:g}"
            for key, value in (
                ("rain_rate_mm_h", weather.rain_rate_mm_h),
                ("fog_water_g_m3", weather.fog_water_g_m3),
            )
            if value > 0
        ]
        if found:
            return Verdict(True, f"[weather] {' and '.join(found)}")
        return Verdict(False, "[weather] has no visibility_km, no rain and no fog")

    def build(self, block: Any) -> Callable[[Cells], FloatArray]:
        """Return the factor on every cell's contrast."""
        visibility_m = scene_visibility_m(block.context.sections["weather"])
        if visibility_m is None:
            return lambda cells: np.ones(len(cells))

        def factor(cells: Cells) -> FloatArray:
            return visibility_transmission(cells.range_m, visibility_m)

        return factor


def scene_visibility_m(weather: Weather) -> float | None:
    """Return the visibility in metres, or None when nothing limits it."""
    if weather.visibility_km is not None:
        return weather.visibility_km * 1000.0
    parts = []
    if weather.rain_rate_mm_h > 0:
        parts.append(rain_visibility_m(weather.rain_rate_mm_h))
    if weather.fog_water_g_m3 > 0:
        parts.append(fog_visibility_m(weather.fog_water_g_m3))
    return float(combined_visibility_m(*parts)) if parts else None
