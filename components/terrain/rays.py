"""Rays between two positions over the ellipsoid: how high they run, straight or bent by the air.

A straight ray is the chord in Earth-centred axes, so the Earth's curvature is exact. Where the
air bends it (`four_thirds`), it arches above the chord by x (D - x) / (8 R): the standard
atmosphere's gradient of refractivity bends a level ray with a quarter of the Earth's curvature,
the same as a straight ray over an Earth of 4/3 of its radius (Recommendation ITU-R P.834-9, §3.2,
with the gradient of P.453-14; M. I. Skolnik, Introduction to Radar Systems, 3rd ed., §8.4).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from components.geometry import (
    DEG_PER_RAD,
    ECCENTRICITY_SQUARED,
    SEMI_MAJOR_AXIS_M,
    Vector,
    east_north_up_axes,
)
from components.terrain.raster import ElevationRaster
from dsa_des.arrays.types import FloatArray

REFRACTIONS = ("none", "four_thirds")
"""From crude to good: straight rays, and those of the 4/3 Earth."""

MEAN_RADIUS_M = 6371008.8
"""Mean radius of WGS-84 (2a + b)/3; the law of 4/3 is not so exact that the latitude mattered."""

_FOUR_THIRDS = 0.25
_SECOND_ECCENTRICITY_SQUARED = ECCENTRICITY_SQUARED / (1.0 - ECCENTRICITY_SQUARED)
_AXIS_RATIO = float(np.sqrt(1.0 - ECCENTRICITY_SQUARED))


def ray_curvature_share(refraction: str) -> float:
    """Return a level ray's curvature over Earth's by refraction model; ValueError if unknown."""
    if refraction not in REFRACTIONS:
        raise ValueError(
            f"refraction is {refraction!r}: it must be one of {', '.join(REFRACTIONS)}"
        )
    return _FOUR_THIRDS if refraction == "four_thirds" else 0.0


def refracted_elevation_rad(
    elevation_rad: Any, range_m: Any, refraction: str = "four_thirds"
) -> Any:
    """Return a refracted ray's apparent elevation (rad, <= pi/2) by chord elevation and length.

    The ray is an arc with a quarter of the Earth's curvature, less the steeper it is: it leaves
    its chord by D cos(elevation) / (8 R), 0.022° at 20 km.
    """
    share = ray_curvature_share(refraction)
    bent = elevation_rad + (0.5 * share / MEAN_RADIUS_M) * range_m * np.cos(elevation_rad)
    return np.minimum(bent, 0.5 * np.pi)


def horizon_dip_rad(height_m: Any, refraction: str = "none") -> Any:
    """Return the angle (rad, 0 or more) of the horizon below the horizontal at a height (m).

    acos(R' / (R' + h)) over a sphere of radius R' = R / (1 - share): 1.01° from 1000 m with
    straight rays, 0.88° with those of the 4/3 Earth; 0 from below the surface.
    """
    radius = MEAN_RADIUS_M / (1.0 - ray_curvature_share(refraction))
    above = np.maximum(height_m, 0.0)
    # acos(1 - x) in a form that keeps its digits for small x.
    return 2.0 * np.arcsin(np.sqrt(0.5 * above / (radius + above)))


def geodetic_lat_rad_lon_deg(x: FloatArray, y: FloatArray, z: FloatArray) -> Vector:
    """Return latitude (rad), longitude (deg) and height (m) of Earth-centred coordinates (m).

    Bowring's formula (Survey Review 23, 1976): heights are good to a micrometre up to 50 km.
    """
    across = np.sqrt(x * x + y * y)
    up, out = z, across * _AXIS_RATIO
    length = np.sqrt(up * up + out * out)
    sine, cosine = up / length, out / length
    top = z + _SECOND_ECCENTRICITY_SQUARED * _AXIS_RATIO * SEMI_MAJOR_AXIS_M * sine**3
    side = across - ECCENTRICITY_SQUARED * SEMI_MAJOR_AXIS_M * cosine**3
    length = np.sqrt(top * top + side * side)
    sine, cosine = top / length, side / length
    w = np.sqrt(1.0 - ECCENTRICITY_SQUARED * sine * sine)
    height = across * cosine + z * sine - SEMI_MAJOR_AXIS_M * w
    return np.arctan2(top, side), np.arctan2(y, x) * DEG_PER_RAD, height


def earth_centred_xyz_m(lat_deg: FloatArray, lon_deg: FloatArray, alt_m: FloatArray) -> Vector:
    """Return Earth-centred x, y, z (m) of flat arrays of latitude, longitude (deg), height (m)."""
    _, _, (ux, uy, uz) = east_north_up_axes(lat_deg, lon_deg)
    n = SEMI_MAJOR_AXIS_M / np.sqrt(1.0 - ECCENTRICITY_SQUARED * uz * uz)
    level = n + alt_m
    return level * ux, level * uy, (n * (1.0 - ECCENTRICITY_SQUARED) + alt_m) * uz


@dataclass(frozen=True, eq=False)
class Rays:
    """Rays from some positions to others."""

    # three (n,) arrays, m: Where they start, Earth-centred, and from there to where they end
    start: Vector
    step: Vector
    length_m: FloatArray  # (n,): of the chord
    start_alt_m: FloatArray  # (n,)
    end_alt_m: FloatArray
    sag_m: FloatArray  # (n,): how far the ray's middle lies below the mean of its ends' heights
    arch_m: FloatArray  # (n,): how far the air lifts its middle above the chord's

    def points_at_shares(self, share: FloatArray, rays: Any = slice(None)) -> Vector:
        """Return latitude (rad), longitude (deg), height (m) at fractions of rays' lengths."""
        x, y, z = (a[rays] + share * d[rays] for a, d in zip(self.start, self.step, strict=True))
        lat, lon, height = geodetic_lat_rad_lon_deg(x, y, z)
        return lat, lon, height + 4.0 * self.arch_m[rays] * share * (1.0 - share)

    def lowest_height_m(self) -> FloatArray:
        """Return the height of the lowest point of each ray, (n,) m above the ellipsoid.

        The point is where the parabola through both ends and the middle is lowest, the height
        there that of the ray itself: short of its lowest by less than 1 mm for rays up to 100 km,
        0.1 m up to 300 km.
        """
        rise = self.end_alt_m - self.start_alt_m
        sagging = self.sag_m > 1e-9
        share = 0.5 - rise / np.where(sagging, 8.0 * self.sag_m, np.inf)
        share = np.clip(share, 0.0, 1.0)
        ends = np.minimum(self.start_alt_m, self.end_alt_m)
        return np.where(sagging, np.minimum(self.points_at_shares(share)[2], ends), ends)

    def shares_possibly_below(self, height_m: float) -> tuple[FloatArray, FloatArray]:
        """Return the length fractions between which rays may lie below a height, (n,) each.

        Empty, with the first above the last, where it surely is not. The parabola stands for the
        ray, with a margin of 5 m (and more for rays beyond 300 km).
        """
        margin = 5.0 + 1e-4 * np.maximum(self.sag_m, 0.0)
        a = 4.0 * self.sag_m
        b = self.end_alt_m - self.start_alt_m - a
        c = self.start_alt_m - (height_m + margin)
        under = b * b - 4.0 * a * c
        root = np.sqrt(np.maximum(under, 0.0))
        bent = a > 1e-6
        two_a = np.where(bent, 2.0 * a, 1.0)
        first = np.where(bent, (-b - root) / two_a, 0.0)
        last = np.where(bent, (-b + root) / two_a, 1.0)
        high = np.where(bent, under <= 0.0, np.minimum(c, c + b) > 0.0)
        return np.where(high, 1.0, np.clip(first, 0.0, 1.0)), np.where(
            high, 0.0, np.clip(last, 0.0, 1.0)
        )


def rays_between(own: Vector, other: Vector, refraction: str = "none") -> Rays:
    """Return the rays between positions, each three (n,) arrays: lat (deg), lon (deg), alt (m)."""
    start = earth_centred_xyz_m(*own)
    end = earth_centred_xyz_m(*other)
    step = (end[0] - start[0], end[1] - start[1], end[2] - start[2])
    length = np.sqrt(step[0] ** 2 + step[1] ** 2 + step[2] ** 2)
    middle = geodetic_lat_rad_lon_deg(*(a + 0.5 * d for a, d in zip(start, step, strict=True)))[2]
    rise = other[2] - own[2]
    # The air bends a steep ray less: what counts is how level it runs.
    level = 1.0 - np.square(rise / np.where(length > 0.0, length, 1.0))
    share = ray_curvature_share(refraction)
    arch = share * np.square(length) * np.clip(level, 0.0, 1.0) / (8.0 * MEAN_RADIUS_M)
    sag = 0.5 * (own[2] + other[2]) - middle - arch
    return Rays(start, step, length, own[2], other[2], sag, arch)


BoolArray = npt.NDArray[np.bool_]

# A ray that only grazes the ground, as the one that ends on it, is not hidden by rounding.
_GRAZING_M = 1e-6
# Between points half a spacing apart the ground rises above the higher one by this share of the
# raster's largest step at most: its slope, sqrt(2) steps per spacing, times a quarter spacing.
_COARSE = 0.25 * float(np.sqrt(2.0))
_COMB = (np.arange(16) + 0.5) / 16.0 - 0.5
# Points worked on together stay in the cache; so do those of the largest single ray.
_POINTS_AT_ONCE = 1 << 17


def is_behind_limb(
    own: Vector, other: Vector, *, surface_m: float = 0.0, refraction: str = "none"
) -> BoolArray:
    """Return a mask of rays that dip below a surface of constant ellipsoidal height (m; 0: sea).

    Both ends are three (n,) arrays: latitude (deg), longitude (deg), altitude (m). One below the
    surface is hidden from everywhere.
    """
    rays = rays_between(own, other, refraction)
    return rays.lowest_height_m() < surface_m - _GRAZING_M


def is_behind_terrain(
    own: Vector,
    other: Vector,
    raster: ElevationRaster,
    *,
    offset_m: float = 0.0,
    refraction: str = "none",
) -> BoolArray:
    """Return a mask over rays: True where the ray runs through the ground of the raster.

    The ray's height over the ellipsoid is compared with the bilinear ground under it at points
    half a node's spacing apart, the ends left out. Beside the raster no ground is known, and
    nothing hides. Ends are as for `is_behind_limb`; `offset_m` is the height above the ellipsoid
    of the raster's zero.

    Notes
    -----
    Between two points the bilinear ground can rise above the higher of them by no more than its
    slope times half their distance, and a ray can sink by its sag. Rays that come so near to the
    ground are looked at again, sixteen times as finely and where they cross rows and columns of
    nodes. In a cell the ground is a parabola along the ray, so that one may be taken for free
    although ground stands in it up to `max_ground_above_clear_ray_m`, 0.0005 ·
    `largest_height_step_m` where nodes lie close; never for hidden where none does.
    """
    rays = rays_between(own, other, refraction)
    first, last = rays.shares_possibly_below(raster.highest_m + offset_m)
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


def max_ground_above_clear_ray_m(raster: ElevationRaster) -> float:
    """Return an upper bound, m, of how far ground may rise above a ray judged clear of it."""
    # Second derivative 2 · twist, twist at most twice the largest step; an eighth of the squared
    # distance of points a thirty-second of a cell apart. The same of the Earth's curvature.
    return (
        4.0 / 8.0 / 32.0**2 * raster.largest_height_step_m
        + _max_ray_sag_m(raster) / len(_COMB) ** 2
    )


def _max_ray_sag_m(raster: ElevationRaster) -> float:
    """Return an upper bound, m, on a ray's sag towards level ground between two samples."""
    return float((0.5 * raster.spacing_m) ** 2 / (8.0 * MEAN_RADIUS_M))


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
    step = np.arange(ends[-1]) - np.repeat(ends - number, number)
    # In the middles of equal pieces: never at an end, which may stand on the ground.
    share = first[ray] + (step + 0.5) / count[ray] * (last[ray] - first[ray])
    stands = terrain_height_above_ray_m(rays, ray, share, raster, offset_m)
    met: BoolArray = np.logical_or.reduceat(stands > _GRAZING_M, ends - number)
    # Where it is a near thing, once more with a finer comb around the points that were near.
    nearest_m = _COARSE * raster.largest_height_step_m + _max_ray_sag_m(raster)
    near = np.flatnonzero((stands > -nearest_m) & ~np.repeat(met, number))
    for start in range(0, len(near), _POINTS_AT_ONCE // len(_COMB)):
        some = near[start : start + _POINTS_AT_ONCE // len(_COMB)]
        piece = (last[ray[some]] - first[ray[some]]) / count[ray[some]]
        finer = share[some, np.newaxis] + piece[:, np.newaxis] * _COMB
        crossings = _shares_of_grid_crossings(rays, ray[some], share[some], piece, raster)
        finer = np.column_stack([finer, *crossings])
        again = terrain_height_above_ray_m(
            rays, np.repeat(ray[some], finer.shape[1]), finer.ravel(), raster, offset_m
        )
        hit = ray[some[(again.reshape(finer.shape) > _GRAZING_M).any(axis=1)]]
        met[np.isin(part, hit)] = True
    return met


def _shares_of_grid_crossings(
    rays: Rays,
    ray: npt.NDArray[np.int64],
    share: FloatArray,
    piece: FloatArray,
    raster: ElevationRaster,
) -> list[FloatArray]:
    """Return where pieces of rays cross a raster row and column, as fractions of the ray."""
    ends = []
    for side in (-0.5, 0.5):
        lat_rad, lon_deg, _ = rays.points_at_shares(share + side * piece, ray)
        ends.append(raster.fractional_row_and_column(lat_rad * DEG_PER_RAD, lon_deg))
    shares = []
    for a, b in zip(*ends, strict=True):
        line = np.maximum(np.floor(a), np.floor(b))
        crosses = np.floor(a) != np.floor(b)
        along = np.where(crosses, (line - a) / np.where(crosses, b - a, 1.0), 0.5)
        shares.append(share + (np.clip(along, 0.0, 1.0) - 0.5) * piece)
    return shares


def terrain_height_above_ray_m(
    rays: Rays,
    ray: npt.NDArray[np.int64],
    share: FloatArray,
    raster: ElevationRaster,
    offset_m: float,
) -> FloatArray:
    """Return the height of the ground above rays, m, at shares of their lengths."""
    lat_rad, lon_deg, height = rays.points_at_shares(share, ray)
    ground, _ = raster.heights_and_coverage(lat_rad * DEG_PER_RAD, lon_deg)
    return ground + (offset_m - height)
