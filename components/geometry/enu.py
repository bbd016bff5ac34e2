"""Turn local east-north-up offsets into latitude, longitude and altitude, and back."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from components.geometry.ellipsoid import (
    ECCENTRICITY_SQUARED,
    FLATTENING,
    SEMI_MAJOR_AXIS_M,
    line_of_sight_ned,
    radii_of_curvature,
)
from components.geometry.normals import FloatArray, local_axes
from components.geometry.wrapping import wrap_longitude_deg

LARGEST_OFFSET_M = 5e6
"""Offsets are refused beyond this: a tangent plane that long has left the Earth."""


def enu_to_geodetic(
    east_m: npt.ArrayLike,
    north_m: npt.ArrayLike,
    up_m: npt.ArrayLike,
    *,
    reference_lat_deg: npt.ArrayLike,
    reference_lon_deg: npt.ArrayLike,
    reference_alt_m: npt.ArrayLike,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Find the geodetic position of points given in the tangent frame of a reference point.

    Parameters
    ----------
    east_m, north_m, up_m : array_like
        Metres along the reference point's local axes; they broadcast. Up is along the ellipsoid
        normal *at the reference point*, so a point 10 km away with up 0 has an altitude 7.8 m
        above the reference.
    reference_lat_deg, reference_lon_deg, reference_alt_m : float or (n,)
        The reference point on WGS-84; or one for each of n points.

    Returns
    -------
    lat_deg, lon_deg, alt_m : ndarray
        Longitude in [-180, 180). The offsets are met to the resolution of the degrees
        themselves: 2e-9 m (a double near 45 degrees steps by 8e-10 m).

    Raises
    ------
    ValueError
        An offset that is not finite or larger than 5,000 km, or a bad reference point.

    Notes
    -----
    A first guess by Bowring's formula (Survey Review 23, 1976), then a Newton step on the residual
    of the difference-form line of sight, which does not carry the 1e-9 m of rounding that
    Earth-centred coordinates do.
    """
    arrays = [np.asarray(a, dtype=np.float64) for a in (east_m, north_m, up_m)]
    for name, array in zip(("east_m", "north_m", "up_m"), arrays, strict=True):
        bad = ~(np.abs(array) <= LARGEST_OFFSET_M)
        if bad.any():
            raise ValueError(
                f"{name} is {array[bad].flat[0]}: it must lie within ±{LARGEST_OFFSET_M:g} metres"
            )
    shape = np.broadcast_shapes(*(a.shape for a in arrays))
    east, north, up = (np.ascontiguousarray(np.broadcast_to(a, shape)).reshape(-1) for a in arrays)
    lat0, lon0, alt0 = (
        np.atleast_1d(np.asarray(part, dtype=np.float64))
        for part in (reference_lat_deg, reference_lon_deg, reference_alt_m)
    )
    lat, lon, alt = _first_guess(east, north, up, lat0, lon0, alt0)
    reference_axes = local_axes(lat0, lon0)
    got_north, got_east, got_down = line_of_sight_ned(
        lat0, lon0, alt0, lat, lon, alt, validate=False
    )
    error = (east - got_east, north - got_north, up + got_down)
    vector = [sum(e * a[i] for e, a in zip(error, reference_axes, strict=True)) for i in (0, 1, 2)]
    axes = local_axes(lat, lon)
    d_east, d_north, d_up = (sum(v * a[i] for i, v in enumerate(vector)) for a in axes)
    meridian, prime_vertical = radii_of_curvature(lat)
    to_axis = (prime_vertical + alt) * np.cos(np.radians(lat))
    # On the axis itself longitude is arbitrary and has nothing to correct.
    far = to_axis > 1e-3
    lon = lon + np.degrees(np.where(far, d_east / np.where(far, to_axis, 1.0), 0.0))
    lat = np.clip(lat + np.degrees(d_north / (meridian + alt)), -90.0, 90.0)
    alt = alt + d_up
    lon = wrap_longitude_deg(lon)
    return lat.reshape(shape)[()], lon.reshape(shape)[()], alt.reshape(shape)[()]


def _first_guess(
    east: FloatArray,
    north: FloatArray,
    up: FloatArray,
    lat0: FloatArray,
    lon0: FloatArray,
    alt0: FloatArray,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Bowring's one-step latitude, in the reference meridian's plane."""
    sin0, cos0 = np.sin(np.radians(lat0)), np.cos(np.radians(lat0))
    n0 = radii_of_curvature(lat0)[1]
    outward = (n0 + alt0) * cos0 - north * sin0 + up * cos0
    z = (n0 * (1.0 - ECCENTRICITY_SQUARED) + alt0) * sin0 + north * cos0 + up * sin0
    to_axis = np.hypot(outward, east)
    semi_minor = SEMI_MAJOR_AXIS_M * (1.0 - FLATTENING)
    reduced = np.arctan2(z, (1.0 - FLATTENING) * to_axis)
    e2_prime = ECCENTRICITY_SQUARED / (1.0 - ECCENTRICITY_SQUARED)
    lat = np.arctan2(
        z + e2_prime * semi_minor * np.sin(reduced) ** 3,
        to_axis - ECCENTRICITY_SQUARED * SEMI_MAJOR_AXIS_M * np.cos(reduced) ** 3,
    )
    sine, cosine = np.sin(lat), np.cos(lat)
    prime_vertical = SEMI_MAJOR_AXIS_M / np.sqrt(1.0 - ECCENTRICITY_SQUARED * sine * sine)
    alt = to_axis * cosine + z * sine - prime_vertical * (1.0 - ECCENTRICITY_SQUARED * sine * sine)
    lon = lon0 + np.degrees(np.arctan2(east, outward))
    return np.clip(np.degrees(lat), -90.0, 90.0), lon, alt
