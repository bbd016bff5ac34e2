"""Rays between two places over the ellipsoid: how high they run, straight or bent by the air.

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

from components.arguments.checks import FloatArray
from components.geometry.ellipsoid import ECCENTRICITY_SQUARED, SEMI_MAJOR_AXIS_M
from components.geometry.normals import DEG_PER_RAD, Vector, local_axes

REFRACTIONS = ("none", "four_thirds")
"""From crude to good: straight rays, and those of the 4/3 Earth."""

MEAN_RADIUS_M = 6371008.8
"""Mean radius of WGS-84 (2a + b)/3; the law of 4/3 is not so exact that the place mattered."""

_FOUR_THIRDS = 0.25
_SECOND_ECCENTRICITY_SQUARED = ECCENTRICITY_SQUARED / (1.0 - ECCENTRICITY_SQUARED)
_AXIS_RATIO = float(np.sqrt(1.0 - ECCENTRICITY_SQUARED))


def share_of_curvature(refraction: str) -> float:
    """Return the curvature of a level ray as a share of the Earth's.

    Raises
    ------
    ValueError
        If the name is unknown.
    """
    if refraction not in REFRACTIONS:
        raise ValueError(
            f"refraction is {refraction!r}: it must be one of {', '.join(REFRACTIONS)}"
        )
    return _FOUR_THIRDS if refraction == "four_thirds" else 0.0


def bent_elevation_rad(elevation_rad: Any, range_m: Any, refraction: str = "four_thirds") -> Any:
    """Return the elevation at which a ray arrives whose chord rises by `elevation_rad`.

    The ray is an arc with a quarter of the Earth's curvature, less the steeper it is: it leaves
    its chord by D cos(elevation) / (8 R), 0.022° at 20 km.

    Parameters
    ----------
    elevation_rad, range_m : array_like
        Of the chord; they broadcast.
    refraction : {"none", "four_thirds"}

    Returns
    -------
    array, rad
        At most pi/2.
    """
    share = share_of_curvature(refraction)
    bent = elevation_rad + (0.5 * share / MEAN_RADIUS_M) * range_m * np.cos(elevation_rad)
    return np.minimum(bent, 0.5 * np.pi)


def dip_rad(height_m: Any, refraction: str = "none") -> Any:
    """Return how far the horizon lies below the horizontal, seen from a height.

    acos(R' / (R' + h)) over a sphere of radius R' = R / (1 - share): 1.01° from 1000 m with
    straight rays, 0.88° with those of the 4/3 Earth.

    Parameters
    ----------
    height_m : array_like, m
        Above the surface; 0 where it is below.
    refraction : {"none", "four_thirds"}

    Returns
    -------
    array, rad
        0 or more.
    """
    radius = MEAN_RADIUS_M / (1.0 - share_of_curvature(refraction))
    above = np.maximum(height_m, 0.0)
    # acos(1 - x) in a form that keeps its digits for small x.
    return 2.0 * np.arcsin(np.sqrt(0.5 * above / (radius + above)))


def geodetic_of(x: FloatArray, y: FloatArray, z: FloatArray) -> Vector:
    """Return latitude (rad), longitude (deg) and height (m) of Earth-centred coordinates.

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


def earth_centred(lat_deg: FloatArray, lon_deg: FloatArray, alt_m: FloatArray) -> Vector:
    """Return the Earth-centred coordinates (m) of flat arrays of places."""
    _, _, (ux, uy, uz) = local_axes(lat_deg, lon_deg)
    n = SEMI_MAJOR_AXIS_M / np.sqrt(1.0 - ECCENTRICITY_SQUARED * uz * uz)
    level = n + alt_m
    return level * ux, level * uy, (n * (1.0 - ECCENTRICITY_SQUARED) + alt_m) * uz


@dataclass(frozen=True, eq=False)
class Rays:
    """Rays from some places to others.

    Parameters
    ----------
    start, step : three (n,) arrays, m
        Where they start, Earth-centred, and from there to where they end.
    length_m : (n,)
        Of the chord.
    start_alt_m, end_alt_m : (n,)
    sag_m : (n,)
        How far the ray's middle lies below the mean of its ends' heights.
    arch_m : (n,)
        How far the air lifts its middle above the chord's.
    """

    start: Vector
    step: Vector
    length_m: FloatArray
    start_alt_m: FloatArray
    end_alt_m: FloatArray
    sag_m: FloatArray
    arch_m: FloatArray

    def places(self, share: FloatArray, rays: Any = slice(None)) -> Vector:
        """Return latitude (rad), longitude (deg) and height (m) at shares of some rays' lengths."""
        x, y, z = (a[rays] + share * d[rays] for a, d in zip(self.start, self.step, strict=True))
        lat, lon, height = geodetic_of(x, y, z)
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
        return np.where(sagging, np.minimum(self.places(share)[2], ends), ends)

    def below(self, height_m: float) -> tuple[FloatArray, FloatArray]:
        """Return the shares of its length between which each ray may be below a height, (n,).

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
    """Return the rays between places, each three flat arrays: lat (deg), lon (deg), alt (m).

    Parameters
    ----------
    own, other : three (n,) arrays
    refraction : {"none", "four_thirds"}
    """
    start = earth_centred(*own)
    end = earth_centred(*other)
    step = (end[0] - start[0], end[1] - start[1], end[2] - start[2])
    length = np.sqrt(step[0] ** 2 + step[1] ** 2 + step[2] ** 2)
    middle = geodetic_of(*(a + 0.5 * d for a, d in zip(start, step, strict=True)))[2]
    rise = other[2] - own[2]
    # The air bends a steep ray less: what counts is how level it runs.
    level = 1.0 - np.square(rise / np.where(length > 0.0, length, 1.0))
    share = share_of_curvature(refraction)
    arch = share * np.square(length) * np.clip(level, 0.0, 1.0) / (8.0 * MEAN_RADIUS_M)
    sag = 0.5 * (own[2] + other[2]) - middle - arch
    return Rays(start, step, length, own[2], other[2], sag, arch)
