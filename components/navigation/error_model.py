"""The error model of the ownship's own position and attitude, as it believes them.

A constant bias and white noise on what the navigation system reports, as TECVOL simulated it
(thesis section 2.3.1). Pure functions of standard normal numbers, which the block draws with its
own keys.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from components.arguments.checks import (
    HIGHEST_ALTITUDE_M,
    LOWEST_ALTITUDE_M,
    FloatArray,
    broadcast_flat,
    finite,
    require_between,
    unflatten,
)
from components.geometry.ellipsoid import radii_of_curvature

# Beyond this a displacement along the tangent plane would no longer be a small error.
LARGEST_POSITION_ERROR_M = 100_000.0


def position_with_error(
    lat_deg: ArrayLike,
    lon_deg: ArrayLike,
    alt_m: ArrayLike,
    *,
    bias_north_east_down_m: tuple[float, float, float] = (0.0, 0.0, 0.0),
    sigma_north_east_down_m: tuple[float, float, float] = (0.0, 0.0, 0.0),
    normals: tuple[ArrayLike, ArrayLike, ArrayLike] = (0.0, 0.0, 0.0),
) -> tuple[Any, Any, Any]:
    """Return the position that the ownship believes it has.

    Parameters
    ----------
    lat_deg, lon_deg : array_like, deg
        True geodetic position; latitude in [-90, 90].
    alt_m : array_like, m
        True height above the ellipsoid.
    bias_north_east_down_m, sigma_north_east_down_m : three floats, m
        Constant error and standard deviation of the white noise, believed minus true.
    normals : three array_like
        Standard normal numbers for north, east and down.

    Returns
    -------
    lat_deg, lon_deg, alt_m : arrays of the broadcast shape
        Where the error is 0 they are the true ones to the bit. Longitude is not wrapped.

    Raises
    ------
    ValueError
        If an argument is out of range or not finite, a sigma negative, or an error over 100 km.

    Notes
    -----
    The displacement is an arc along a sphere with the local radii of the ellipsoid, so it also
    works across a pole. Against a straight displacement in the tangent plane an error of 10 m
    comes out 0.1 µm off horizontally and, as it follows the Earth, 8 µm lower (100 m: 8 µm and
    0.8 mm), at any latitude.
    """
    north, east, down = _errors(
        "north_east_down_m", bias_north_east_down_m, sigma_north_east_down_m, normals
    )
    shape, (lat, lon, alt, north, east, down) = broadcast_flat(
        lat_deg=finite("lat_deg", lat_deg),
        lon_deg=finite("lon_deg", lon_deg),
        alt_m=finite("alt_m", alt_m),
        north=north,
        east=east,
        down=down,
    )
    require_between("lat_deg", lat, -90.0, 90.0, "lie in [-90, 90] degrees")
    require_between(
        "alt_m",
        alt,
        LOWEST_ALTITUDE_M,
        HIGHEST_ALTITUDE_M,
        f"lie in [{LOWEST_ALTITUDE_M:g}, {HIGHEST_ALTITUDE_M:g}] metres",
    )
    for error in (north, east, down):
        require_between(
            "position error",
            error,
            -LARGEST_POSITION_ERROR_M,
            LARGEST_POSITION_ERROR_M,
            f"be within ±{LARGEST_POSITION_ERROR_M:g} m",
        )
    new_lat, new_lon = _displaced(lat, lon, alt - down, north, east)
    stays = (north == 0.0) & (east == 0.0)
    return (
        unflatten(np.where(stays, lat, new_lat), shape),
        unflatten(np.where(stays, lon, new_lon), shape),
        unflatten(np.where(down == 0.0, alt, alt - down), shape),
    )


def attitude_with_error(
    yaw_rad: ArrayLike,
    pitch_rad: ArrayLike,
    roll_rad: ArrayLike,
    *,
    bias_rad: tuple[float, float, float] = (0.0, 0.0, 0.0),
    sigma_rad: tuple[float, float, float] = (0.0, 0.0, 0.0),
    normals: tuple[ArrayLike, ArrayLike, ArrayLike] = (0.0, 0.0, 0.0),
) -> tuple[Any, Any, Any]:
    """Return the attitude that the ownship believes it has.

    Parameters
    ----------
    yaw_rad, pitch_rad, roll_rad : array_like, rad
        True attitude, ZYX.
    bias_rad, sigma_rad : three floats, rad
        Constant error and standard deviation of the white noise of yaw, pitch and roll.
    normals : three array_like
        Standard normal numbers for yaw, pitch and roll.

    Returns
    -------
    yaw_rad, pitch_rad, roll_rad : arrays of the broadcast shape
        Angle plus error, not wrapped; where an error is 0 the true angle to the bit.

    Raises
    ------
    ValueError
        If an argument is not finite or a sigma negative.

    Notes
    -----
    The error is one of the reported angles, as a data sheet states it, not of the axes; a pitch
    beyond ±90° means what its rotation means.
    """
    errors = _errors("rad", bias_rad, sigma_rad, normals)
    truth = {"yaw_rad": yaw_rad, "pitch_rad": pitch_rad, "roll_rad": roll_rad}
    shape, flat = broadcast_flat(
        **{name: finite(name, value) for name, value in truth.items()},
        **{f"error of {name}": error for name, error in zip(truth, errors, strict=True)},
    )
    yaw, pitch, roll = (
        unflatten(np.where(error == 0.0, angle, angle + error), shape)
        for angle, error in zip(flat[:3], flat[3:], strict=True)
    )
    return yaw, pitch, roll


def _errors(
    unit: str,
    bias: tuple[float, float, float],
    sigma: tuple[float, float, float],
    normals: tuple[ArrayLike, ArrayLike, ArrayLike],
) -> list[FloatArray]:
    errors = []
    for axis_bias, axis_sigma, normal in zip(bias, sigma, normals, strict=True):
        offset = float(finite(f"bias_{unit}", axis_bias))
        spread = float(finite(f"sigma_{unit}", axis_sigma))
        if spread < 0.0:
            raise ValueError(f"sigma_{unit} is {spread:g}: it must be 0 or more")
        errors.append(np.asarray(offset + spread * finite("normals", normal)))
    return errors


def _displaced(
    lat_deg: FloatArray, lon_deg: FloatArray, alt: FloatArray, north: FloatArray, east: FloatArray
) -> tuple[FloatArray, FloatArray]:
    lat = np.radians(lat_deg)
    sine, cosine = np.sin(lat), np.cos(lat)
    along, across = radii_of_curvature(lat_deg)
    a, b = north / (along + alt), east / (across + alt)
    arc = np.hypot(a, b)
    moved = arc > 0.0
    ratio = np.where(moved, np.sin(arc) / np.where(moved, arc, 1.0), 1.0)
    cos_arc = np.cos(arc)
    # The new direction in the meridian plane of the old position: axis, outwards, and east.
    up = sine * cos_arc + cosine * a * ratio
    out = cosine * cos_arc - sine * a * ratio
    side = b * ratio
    new_lat = np.degrees(np.arctan2(up, np.hypot(out, side)))
    new_lon = lon_deg + np.degrees(np.arctan2(side, out))
    return np.clip(new_lat, -90.0, 90.0), new_lon
