"""Unit normals of the ellipsoid: positions without a seam at the antimeridian or the poles."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from components.geometry.ellipsoid import ECCENTRICITY_SQUARED, SEMI_MAJOR_AXIS_M

FloatArray = npt.NDArray[np.float64]
Vector = tuple[FloatArray, FloatArray, FloatArray]

TWO_PI = 2.0 * np.pi
DEG_PER_RAD = 180.0 / np.pi
RAD_PER_DEG = np.pi / 180.0


def radii_of_curvature(lat_deg: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Find the meridian radius M and the prime-vertical radius N of WGS-84, in metres.

    Parameters
    ----------
    lat_deg : array_like
        Geodetic latitude, degrees.

    Returns
    -------
    meridian_m, prime_vertical_m : ndarray
        Metres on the ellipsoid; at altitude h add h to either.
    """
    sine = np.sin(np.asarray(lat_deg, dtype=np.float64) * RAD_PER_DEG)
    w_squared = 1.0 - ECCENTRICITY_SQUARED * sine * sine
    prime_vertical = SEMI_MAJOR_AXIS_M / np.sqrt(w_squared)
    return prime_vertical * (1.0 - ECCENTRICITY_SQUARED) / w_squared, prime_vertical


def local_axes(lat_deg: FloatArray, lon_deg: FloatArray) -> tuple[Vector, Vector, Vector]:
    """Give the unit vectors east, north and up of a place, in Earth-centred axes.

    Parameters
    ----------
    lat_deg, lon_deg : ndarray
        Degrees, one shape.

    Returns
    -------
    east, north, up : tuple of three ndarray
        Each the (x, y, z) components. Up is the ellipsoid normal.
    """
    lat, lon = lat_deg * RAD_PER_DEG, lon_deg * RAD_PER_DEG
    sin_lat, cos_lat, sin_lon, cos_lon = np.sin(lat), np.cos(lat), np.sin(lon), np.cos(lon)
    east = (-sin_lon, cos_lon, np.zeros_like(sin_lon))
    north = (-sin_lat * cos_lon, -sin_lat * sin_lon, cos_lat)
    up = (cos_lat * cos_lon, cos_lat * sin_lon, sin_lat)
    return east, north, up


def normal_to_degrees(x: FloatArray, y: FloatArray, z: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Turn a normal of any length into latitude and longitude in degrees.

    Parameters
    ----------
    x, y, z : ndarray
        Components, one shape; only the direction counts. The null vector gives 0, 0.

    Returns
    -------
    lat_deg, lon_deg : ndarray
        Longitude in [-180, 180).
    """
    lat = np.arctan2(z, np.sqrt(x * x + y * y))
    lat *= DEG_PER_RAD
    lon = np.arctan2(y, x)
    lon *= DEG_PER_RAD
    # pi in degrees is exactly 180, which belongs to the other end of the interval.
    return lat, np.where(lon >= 180.0, -180.0, lon)


def wrap_longitude_deg(lon_deg: FloatArray) -> FloatArray:
    """Wrap degrees into [-180, 180); a value already there keeps its bits."""
    inside = (lon_deg >= -180.0) & (lon_deg < 180.0)
    if inside.all():
        return lon_deg
    wrapped = lon_deg - 360.0 * np.floor((lon_deg + 180.0) / 360.0)
    wrapped = np.where(inside, lon_deg, wrapped)
    return np.where(wrapped >= 180.0, -180.0, np.where(wrapped < -180.0, -180.0, wrapped))


def wrap_difference_rad(angle: FloatArray) -> FloatArray:
    """Wrap radians into [-pi, pi], for differences of two angles a few turns apart at most."""
    return angle - TWO_PI * np.rint(angle * (1.0 / TWO_PI))


def wrap_heading_rad(angle: FloatArray) -> FloatArray:
    """Wrap radians into [0, 2 pi); a value already there keeps its bits."""
    inside = (angle >= 0.0) & (angle < TWO_PI)
    if inside.all():
        return angle
    wrapped = angle - TWO_PI * np.floor(angle * (1.0 / TWO_PI))
    wrapped = np.where(inside, angle, wrapped)
    # A tiny negative angle plus 2 pi rounds to 2 pi; the direction meant is 0.
    return np.where((wrapped >= TWO_PI) | (wrapped < 0.0), 0.0, wrapped)
