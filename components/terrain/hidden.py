"""Which targets are hidden: behind the Earth's limb, or behind the ground of a raster."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from components.arguments.checks import FloatArray
from components.geometry.normals import DEG_PER_RAD, Vector
from components.terrain.raster import ElevationRaster
from components.terrain.rays import Rays, rays_between

BoolArray = npt.NDArray[np.bool_]

# A ray that only grazes the ground, as the one that ends on it, is not hidden by rounding.
_GRAZING_M = 1e-6
# Points worked on together stay in the cache; so do those of the largest single ray.
_POINTS_AT_ONCE = 1 << 17


def behind_the_limb(
    own: Vector, other: Vector, *, surface_m: float = 0.0, refraction: str = "none"
) -> BoolArray:
    """Tell which rays dip below a surface of one height above the ellipsoid.

    Parameters
    ----------
    own, other : three (n,) arrays
        Latitude (deg), longitude (deg), altitude (m) of both ends.
    surface_m : float
        Height of the surface above the ellipsoid, 0 for the sea.
    refraction : {"none", "four_thirds"}

    Returns
    -------
    (n,) of bool
        An end below the surface is hidden from everywhere.
    """
    rays = rays_between(own, other, refraction)
    return rays.lowest_height_m() < surface_m - _GRAZING_M


def behind_terrain(
    own: Vector,
    other: Vector,
    raster: ElevationRaster,
    *,
    offset_m: float = 0.0,
    refraction: str = "none",
) -> BoolArray:
    """Tell which rays run through the ground of a raster.

    The ray's height over the ellipsoid is compared with the bilinear ground under it at points
    half a node's spacing apart, the ends left out. Beside the raster no ground is known, and
    nothing hides.

    Parameters
    ----------
    own, other : three (n,) arrays
        Latitude (deg), longitude (deg), altitude (m) of both ends.
    raster : ElevationRaster
    offset_m : float
        Height above the ellipsoid of the raster's zero.
    refraction : {"none", "four_thirds"}

    Returns
    -------
    (n,) of bool

    Notes
    -----
    Between two points the bilinear ground can rise above the higher of them by no more than its
    slope times a quarter of the spacing: a ray is taken for free although up to
    0.36 · `largest_step_m` of ground stand in it (`miss_bound_m`), never for hidden where nothing
    stands in it.
    """
    rays = rays_between(own, other, refraction)
    first, last = rays.below(raster.highest_m + offset_m)
    hidden = np.zeros(len(first), dtype=bool)
    spacing = 0.5 * raster.spacing_m
    count = np.ceil(rays.length_m * np.maximum(last - first, 0.0) / spacing).astype(np.int64) + 1
    wanted = np.flatnonzero(first < last)
    start = 0
    while start < len(wanted):
        total = np.cumsum(count[wanted[start:]])
        end = start + max(1, int(np.searchsorted(total, _POINTS_AT_ONCE, side="right")))
        part = wanted[start:end]
        hidden[part] = _meets_ground(rays, part, first, last, count, raster, offset_m)
        start = end
    return hidden


def miss_bound_m(raster: ElevationRaster) -> float:
    """Return how high ground may stand in a ray that is taken for free, at most."""
    return float(np.sqrt(2.0)) * 0.25 * raster.largest_step_m


def _meets_ground(
    rays: Rays,
    part: npt.NDArray[np.int64],
    first: FloatArray,
    last: FloatArray,
    count: npt.NDArray[np.int64],
    raster: ElevationRaster,
    offset_m: float,
) -> BoolArray:
    number = count[part]
    ends = np.cumsum(number)
    ray = np.repeat(part, number)
    place = np.arange(ends[-1]) - np.repeat(ends - number, number)
    # In the middles of equal pieces: never at an end, which may stand on the ground.
    share = first[ray] + (place + 0.5) / count[ray] * (last[ray] - first[ray])
    lat_rad, lon_deg, height = rays.places(share, ray)
    ground, _ = raster.height(lat_rad * DEG_PER_RAD, lon_deg)
    met = ground + offset_m > height + _GRAZING_M
    return np.logical_or.reduceat(met, ends - number)
