"""Contrast of a target with its background, and the part of it that reaches the camera."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from components.arguments.checks import (
    broadcast_flat,
    check_not_negative,
    check_positive,
    unflatten,
)
from components.atmosphere.visibility import KOSCHMIEDER
from components.geometry import angle_between
from components.optical.luminance import background_luminance, inherent_contrast, target_luminance
from components.sensor.look import Cells, CellValues
from components.terrain.rays import horizon_dip_rad
from dsa_des.arrays.types import FloatArray
from dsa_des.block.effect import Effect, Hook, Verdict


def contrast_gain(
    *,
    model: str = "constant",
    contrast: ArrayLike = 1.0,
    azimuth_rad: ArrayLike = 0.0,
    elevation_rad: ArrayLike = 0.0,
    range_m: ArrayLike = 0.0,
    visibility_m: ArrayLike | None = None,
    sun_azimuth_rad: ArrayLike = 0.0,
    sun_elevation_rad: ArrayLike = 0.25 * np.pi,
    sun_exclusion_rad: ArrayLike = 0.0,
    paint_reflectance: ArrayLike = 0.5,
    ground_reflectance: ArrayLike = 0.2,
    sky: str = "clear",
    background: str = "auto",
) -> Any:
    """Return the factor P by which contrast multiplies the static signature (thesis eq. 18).

    - ``constant``: `contrast` itself, the thesis's P.
    - ``daylight``: `contrast` times the target's own contrast |Lt - Lb| / Lb against its
      background (`target_luminance`, `background_luminance`); 0 closer to the sun than
      `sun_exclusion_rad`, where it blinds the camera.

    Either is multiplied by Koschmieder's exp(-3.912 range / visibility) if a visibility is given.
    P is not limited to 1: a sunlit aircraft may be several times brighter than the forest behind
    it.
    """
    if model not in ("constant", "daylight"):
        raise ValueError(f"model is {model!r}: it must be 'constant' or 'daylight'")
    gain = check_not_negative("contrast", contrast)
    if model == "daylight":
        target = target_luminance(
            azimuth_rad,
            elevation_rad,
            sun_azimuth_rad,
            sun_elevation_rad,
            paint_reflectance=paint_reflectance,
            ground_reflectance=ground_reflectance,
            sky=sky,
        )
        behind = background_luminance(
            azimuth_rad,
            elevation_rad,
            sun_azimuth_rad,
            sun_elevation_rad,
            ground_reflectance=ground_reflectance,
            sky=sky,
            background=background,
        )
        from_sun = angle_between(azimuth_rad, elevation_rad, sun_azimuth_rad, sun_elevation_rad)
        blinded = from_sun < check_not_negative("sun_exclusion_rad", sun_exclusion_rad)
        gain = gain * np.where(blinded, 0.0, inherent_contrast(target, behind))
    shape = np.broadcast_shapes(
        np.shape(gain), np.shape(azimuth_rad), np.shape(elevation_rad), np.shape(range_m)
    )
    gain = np.broadcast_to(gain, shape)
    if visibility_m is None:
        return gain.copy()[()]
    return gain * visibility_transmission(range_m, visibility_m)


def visibility_transmission(range_m: ArrayLike, visibility_m: ArrayLike) -> Any:
    """Return the share of a contrast that is left after a path through haze.

    exp(-3.912 range / visibility), Koschmieder's law. Exact for a target against the horizon sky
    in even haze; used for every background here.
    """
    shape, (distance, visibility) = broadcast_flat(
        range_m=check_not_negative("range_m", range_m),
        visibility_m=check_positive("visibility_m", visibility_m),
    )
    # From 200 visibilities on nothing is left that a double could hold.
    gone = distance * (1.0 / 200.0) >= visibility
    depth = np.where(gone, 0.0, distance) / np.where(gone, 1.0, visibility)
    return unflatten(np.where(gone, 0.0, np.exp(-KOSCHMIEDER * depth)), shape)


CONTRAST = Hook("contrast", CellValues, "factor of each cell's contrast")


class Background(Effect[CellValues]):
    """Contrast of the painted target against sky or ground under the scene's sun."""

    name = "background and sun"
    acts_on = CONTRAST
    outside_the_proof = "no sun leaves every target's contrast exactly as it is"

    def verdict(self, block: Any) -> Verdict:
        """Return whether contrast with a background is computed: needs ``background``."""
        background = block.p.background
        return Verdict(background != "none", f"background is {background!r}")

    def build(self, block: Any) -> CellValues:
        """Return a function that gives each cell's contrast gain against its background."""
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
                paint_reflectance=cells.column_at_targets(cells.roster.column("paint_reflectance")),
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
            dip = horizon_dip_rad(cells.field_at_rows("own_alt_m") - surface_m, refraction)
            sky, ground = (gain_against(cells, name) for name in ("sky", "ground"))
            return np.where(cells.elevation_rad >= -dip, sky, ground)

        return factor
