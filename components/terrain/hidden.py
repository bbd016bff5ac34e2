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
# Between points half a spacing apart the ground rises above the higher one by this share of the
# raster's largest step at most: its slope, sqrt(2) steps per spacing, times a quarter spacing.
_COARSE = 0.25 * float(np.sqrt(2.0))
_COMB = (np.arange(16) + 0.5) / 16.0 - 0.5
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
    slope times half their distance. Rays that come so near to the ground are looked at again,
    sixteen times as finely and where they cross rows and columns of nodes. In a cell the ground is
    a parabola along the ray, so that one may be taken for free although up to 0.0005 ·
    `largest_step_m` of ground stand in it (`miss_bound_m`), never for hidden where none does.
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
    # Second derivative 2 · twist, twist at most twice the largest step; an eighth of the squared
    # distance of points a thirty-second of a cell apart.
    return 4.0 / 8.0 / 32.0**2 * raster.largest_step_m


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
    stands = _stands_m(rays, ray, share, raster, offset_m)
    met: BoolArray = np.logical_or.reduceat(stands > _GRAZING_M, ends - number)
    # Where it is a near thing, once more with a finer comb around the points that were near.
    near = np.flatnonzero((stands > -_COARSE * raster.largest_step_m) & ~np.repeat(met, number))
    for start in range(0, len(near), _POINTS_AT_ONCE // len(_COMB)):
        some = near[start : start + _POINTS_AT_ONCE // len(_COMB)]
        piece = (last[ray[some]] - first[ray[some]]) / count[ray[some]]
        finer = share[some, np.newaxis] + piece[:, np.newaxis] * _COMB
        crossings = _crossings(rays, ray[some], share[some], piece, raster)
        finer = np.column_stack([finer, *crossings])
        again = _stands_m(
            rays, np.repeat(ray[some], finer.shape[1]), finer.ravel(), raster, offset_m
        )
        hit = ray[some[(again.reshape(finer.shape) > _GRAZING_M).any(axis=1)]]
        met[np.isin(part, hit)] = True
    return met


def _crossings(
    rays: Rays,
    ray: npt.NDArray[np.int64],
    share: FloatArray,
    piece: FloatArray,
    raster: ElevationRaster,
) -> list[FloatArray]:
    """Return where pieces of rays cross a row and a column of nodes, where the ground has edges."""
    ends = []
    for side in (-0.5, 0.5):
        lat_rad, lon_deg, _ = rays.places(share + side * piece, ray)
        ends.append(raster.place(lat_rad * DEG_PER_RAD, lon_deg))
    found = []
    for a, b in zip(*ends, strict=True):
        line = np.maximum(np.floor(a), np.floor(b))
        crosses = np.floor(a) != np.floor(b)
        along = np.where(crosses, (line - a) / np.where(crosses, b - a, 1.0), 0.5)
        found.append(share + (np.clip(along, 0.0, 1.0) - 0.5) * piece)
    return found


def _stands_m(
    rays: Rays,
    ray: npt.NDArray[np.int64],
    share: FloatArray,
    raster: ElevationRaster,
    offset_m: float,
) -> FloatArray:
    """Return how high the ground stands above rays, at shares of their lengths."""
    lat_rad, lon_deg, height = rays.places(share, ray)
    ground, _ = raster.height(lat_rad * DEG_PER_RAD, lon_deg)
    return ground + (offset_m - height)
