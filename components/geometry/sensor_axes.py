"""Angles in a sensor's axes, and their variances where the axes are turned."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from components.arguments.checks import broadcast_results
from components.geometry.angles import direction_angle, slope_angle, wrap_pi_unchecked
from components.geometry.attitude import (
    body_angles,
    body_angles_unchecked,
    body_to_ned,
    common_shape_and_arrays,
    components_in_turned_axes,
    ned_to_body,
    ned_to_body_unchecked,
    normalize_azimuths,
    unit_vector,
    unit_vector_unchecked,
)
from dsa_des.arrays.column_values import first_row_if_stored_once
from dsa_des.arrays.types import FloatArray

# Of an azimuth of which nothing is known: uniform over the circle.
_ANY_AZIMUTH_RAD2 = math.pi**2 / 3.0


def rotate_variances(
    azimuth_rad: FloatArray,
    elevation_rad: FloatArray,
    azimuth_variance_rad2: FloatArray,
    elevation_variance_rad2: FloatArray,
    mounting_rad: tuple[float, float, float],
) -> tuple[FloatArray, FloatArray]:
    """Return azimuth, elevation variances (rad²) in body axes, from those in sensor axes.

    Small errors turn with the tangent plane: those of the elevation and, shortened by the cosine
    of the elevation, of the azimuth are turned by the angle between the two verticals there. What
    the turn leaves correlated is not returned.

    Parameters
    ----------
    azimuth_rad, elevation_rad : (n,) arrays
        Direction in the sensor's axes.
    azimuth_variance_rad2, elevation_variance_rad2 : (n,) arrays
        In the sensor's axes, uncorrelated.
    mounting_rad : (azimuth, elevation, roll)
        Turn from body axes to the sensor's, ZYX.

    Returns
    -------
    azimuth_variance_rad2, elevation_variance_rad2 : (n,) arrays
        In body axes; that of the azimuth at most π²/3, any azimuth, which straight up it is.
    """
    body = body_to_ned(*unit_vector_unchecked(azimuth_rad, elevation_rad), *mounting_rad)
    p, q = body_angles_unchecked(*(np.ascontiguousarray(axis) for axis in body))
    # The direction a quarter turn above another is the upward tangent there.
    up = body_to_ned(
        *unit_vector_unchecked(azimuth_rad, elevation_rad + 0.5 * np.pi), *mounting_rad
    )
    level_up = unit_vector_unchecked(p, q + 0.5 * np.pi)
    cosine2 = (up[0] * level_up[0] + up[1] * level_up[1] + up[2] * level_up[2]) ** 2
    sine2 = (up[1] * np.cos(p) - up[0] * np.sin(p)) ** 2
    across = np.cos(elevation_rad) ** 2 * azimuth_variance_rad2
    level2 = np.cos(q) ** 2
    sideways = cosine2 * across + sine2 * elevation_variance_rad2
    azimuth = np.full(len(level2), _ANY_AZIMUTH_RAD2)
    known = sideways < level2 * _ANY_AZIMUTH_RAD2
    np.divide(sideways, level2, out=azimuth, where=known)
    return azimuth, sine2 * across + cosine2 * elevation_variance_rad2


MODELS = ("exact", "small_angle")


def body_angles_of_sight_line(
    azimuth_rad: npt.ArrayLike,
    elevation_rad: npt.ArrayLike,
    yaw_rad: npt.ArrayLike,
    pitch_rad: npt.ArrayLike,
    roll_rad: npt.ArrayLike,
    model: str = "exact",
    *,
    validate: bool = True,
) -> tuple[FloatArray, FloatArray]:
    """Return azimuth, elevation (rad) of a sight line in the ownship's body axes (thesis p, q).

    Parameters
    ----------
    azimuth_rad, elevation_rad : array_like
        Absolute bearing (from true north) and elevation of the line of sight.
    yaw_rad, pitch_rad, roll_rad : array_like
        The ownship's attitude, ZYX. All five broadcast.
    model : {"exact", "small_angle"}
        "exact" rotates the line of sight into the body axes. "small_angle" is thesis eq. 4-5,
        corrected: p = wrap(azimuth - yaw), q = elevation - pitch, roll ignored. It is right dead
        ahead with the wings level; abeam, pitch is wrongly subtracted, astern it has the wrong
        sign.
    validate : bool
        False skips the checks, for a caller that has contiguous arrays of finite doubles with at
        least one axis, the directions of the broadcast shape.

    Returns
    -------
    body_azimuth_rad : ndarray
        Azimuth from the nose, clockwise seen from above, in (-pi, pi].
    body_elevation_rad : ndarray
        Elevation, in [-pi/2, pi/2]. Where elevation - pitch passes straight up or down, the
        direction comes down on the other side: q becomes ±pi - q, and p turns by pi.

    Raises
    ------
    ValueError
        An unknown model, NaN, infinity, or shapes that do not fit.
    """
    if model == "exact":
        if not validate:
            with np.errstate(under="ignore"):
                n, e, d = unit_vector_unchecked(azimuth_rad, elevation_rad)
                return body_angles_unchecked(
                    *ned_to_body_unchecked(n, e, d, yaw_rad, pitch_rad, roll_rad)
                )
        north, east, down = unit_vector(azimuth_rad, elevation_rad)
        return body_angles(*ned_to_body(north, east, down, yaw_rad, pitch_rad, roll_rad))
    if model != "small_angle":
        allowed = " or ".join(repr(name) for name in MODELS)
        raise ValueError(f"model is {model!r}: it must be {allowed}")
    if not validate:
        given: tuple[Any, ...] = azimuth_rad, elevation_rad, yaw_rad, pitch_rad
        return _angle_by_angle(*given)
    shape, (azimuth, elevation, yaw, pitch, _) = common_shape_and_arrays(
        azimuth_rad=azimuth_rad,
        elevation_rad=elevation_rad,
        yaw_rad=yaw_rad,
        pitch_rad=pitch_rad,
        roll_rad=roll_rad,
    )
    p, q = broadcast_results(shape, *_angle_by_angle(azimuth, elevation, yaw, pitch))
    return p, q


def _angle_by_angle(
    azimuth: FloatArray, elevation: FloatArray, yaw: FloatArray, pitch: FloatArray
) -> tuple[FloatArray, FloatArray]:
    p = wrap_pi_unchecked(azimuth - yaw)
    q = wrap_pi_unchecked(elevation - pitch)
    over = np.abs(q) > 0.5 * np.pi
    if np.count_nonzero(over) == 0:
        return p, q
    q = np.where(over, np.copysign(np.pi, q) - q, q)
    p, over = np.broadcast_arrays(p, over)
    p = np.where(over, wrap_pi_unchecked(np.where(p > 0.0, p - np.pi, p + np.pi)), p)
    return p, q


def body_angles_of_offsets(
    north_m: FloatArray,
    east_m: FloatArray,
    up_m: FloatArray,
    yaw_rad: FloatArray,
    pitch_rad: FloatArray,
    roll_rad: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Return body azimuth, elevation (rad) of north, east, up offsets from the ownship, unchecked.

    As `body_angles_of_sight_line`, to the last digit or two, at a third to half of its cost: the
    direction need not be taken apart into angles first. All are contiguous arrays of finite
    doubles, at least one axis, the offsets (in the ownship's local frame) of the broadcast shape.
    """
    x, y = components_in_turned_axes(north_m, east_m, yaw_rad)
    z = 0.0 - up_m
    if first_row_if_stored_once(
        pitch_rad
    ).any():  # straight and level, as most fly most of the time, these change nothing
        z, x = components_in_turned_axes(z, x, pitch_rad)
    if first_row_if_stored_once(roll_rad).any():
        y, z = components_in_turned_axes(y, z, roll_rad)
    level = x * x
    level += y * y
    np.sqrt(level, out=level)
    return normalize_azimuths(direction_angle(y, x), z, level), slope_angle(0.0 - z, level)
