"""Unit normals of the ellipsoid: positions without a seam at the antimeridian or the poles."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
Vector = tuple[FloatArray, FloatArray, FloatArray]

DEG_PER_RAD = 180.0 / np.pi
RAD_PER_DEG = np.pi / 180.0


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
