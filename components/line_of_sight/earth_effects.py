"""What the Earth does to lines of sight: hides targets, bends rays. Effects of the transform."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

import numpy as np

from components.environment.tables import Terrain
from components.geometry import POSITION_FIELDS, SeenFromOwnship, body_angles_of_sight_line
from components.terrain.rays import (
    is_behind_limb,
    is_behind_terrain,
    max_ground_above_clear_ray_m,
    refracted_elevation_rad,
)
from dsa_des.arrays.types import BoolArray
from dsa_des.block.effect import Effect, Hook, Verdict


class Hides(Protocol):
    """Function that returns which targets (True) terrain or the Earth's limb hides."""

    def __call__(self, own: Any, other: Any, present: BoolArray, /) -> BoolArray:
        """Return which of the targets that are `present` are hidden, from states of both."""


class Bends(Protocol):
    """Function that returns lines of sight with their elevation changed by refraction."""

    def __call__(self, own: Any, seen: SeenFromOwnship, attitude: str, /) -> SeenFromOwnship:
        """Return lines of sight along bent rays, by a model of the `attitude`."""


HIDES = Hook("hides", Hides, "which targets something stands before")
BENDS = Hook("bends", Bends, "seen: lines of sight along bent rays")


def terrain_section(block: Any) -> Terrain:
    """Return the scene's ``[terrain]`` section, or one with default values if there is none."""
    terrain = block.context.sections.get("terrain")
    return Terrain() if terrain is None else terrain


class Limb(Effect[Hides]):
    """The Earth's limb hides what lies behind it."""

    name = "Earth's horizon"
    acts_on = HIDES
    outside_the_proof = "an Earth that hides nothing is none"

    def verdict(self, block: Any) -> Verdict:
        """Return whether the Earth hides targets: needs ``[terrain] horizon``."""
        horizon = terrain_section(block).horizon
        return Verdict(horizon, f"[terrain] horizon is {str(horizon).lower()}")

    def build(self, block: Any) -> Hides:
        """Return a function giving a mask of targets behind the Earth's horizon; absent: False."""
        terrain = terrain_section(block)
        surface_m = terrain.height_m or 0.0
        return _hide_only_present(
            lambda a, b: is_behind_limb(a, b, surface_m=surface_m, refraction=terrain.refraction)
        )


class Mountains(Effect[Hides]):
    """The ground of an elevation raster hides what lies behind it."""

    name = "masking by the ground"
    acts_on = HIDES
    outside_the_proof = "without a raster there is no ground"

    def verdict(self, block: Any) -> Verdict:
        """Return whether mountains hide targets: needs ``[terrain] raster``."""
        file = terrain_section(block).raster
        if file is None:
            return Verdict(False, "[terrain] raster is not given")
        raster = file.raster
        return Verdict(
            True,
            f"[terrain] raster is {raster.name} ({raster.bounds_text()}); nothing hides beside "
            f"it, and "
            f"of what stands in a line of sight up to {max_ground_above_clear_ray_m(raster):.2g} "
            f"m may "
            f"be missed",
        )

    def build(self, block: Any) -> Hides:
        """Return a function that masks targets behind terrain (True: hidden; absent: False)."""
        terrain = terrain_section(block)
        assert terrain.raster is not None
        raster = terrain.raster.raster
        return _hide_only_present(
            lambda a, b: is_behind_terrain(
                a, b, raster, offset_m=terrain.raster_zero_m, refraction=terrain.refraction
            )
        )


class Refraction(Effect[Bends]):
    """The air bends rays, and targets appear above where they are."""

    name = "refraction"
    acts_on = BENDS
    outside_the_proof = "angles are formed anew, and their last bits differ"

    def verdict(self, block: Any) -> Verdict:
        """Return whether rays bend: needs ``[terrain] refraction``."""
        refraction = terrain_section(block).refraction
        return Verdict(refraction != "none", f"[terrain] refraction is {refraction!r}")

    def build(self, block: Any) -> Bends:
        """Return a function that makes lines of sight apparent, elevation raised by refraction."""
        refraction = terrain_section(block).refraction

        def bends(own: Any, seen: SeenFromOwnship, attitude: str) -> SeenFromOwnship:
            elevation = refracted_elevation_rad(seen.elevation_rad, seen.range_m, refraction)
            body = body_angles_of_sight_line(
                seen.azimuth_rad,
                elevation,
                own.yaw_rad,
                own.pitch_rad,
                own.roll_rad,
                model=attitude,
                validate=False,
            )
            return SeenFromOwnship(seen.azimuth_rad, elevation, seen.range_m, *body)

        return bends


EARTH_EFFECTS = (Limb(), Mountains(), Refraction())


def _hide_only_present(hidden_of: Callable[[Any, Any], BoolArray]) -> Hides:
    """Return a function that asks `hidden_of` for present targets; absent ones get False."""

    def hides(own: Any, other: Any, present: BoolArray) -> BoolArray:
        hidden = np.zeros(present.shape, dtype=bool)
        here = np.nonzero(present)
        if len(here[0]):
            ends = (
                tuple(np.broadcast_to(getattr(s, n), present.shape)[here] for n in POSITION_FIELDS)
                for s in (own, other)
            )
            hidden[here] = hidden_of(*ends)
        return hidden

    return hides
