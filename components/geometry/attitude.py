"""Turning directions between the local NED frame and the body axes of an aircraft.

Body axes are x nose, y right wing, z down. Attitude is yaw, pitch, roll in the order ZYX: from
north-east-down turn by yaw about down, by pitch about the new right wing, by roll about the nose.
All angles in radians; azimuth is clockwise from north (or from the nose), elevation is upwards.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from components.arguments.checks import broadcast_results, check_squarable, common_shape
from components.geometry.angles import Vector, sine_and_cosine, wrap_pi
from dsa_des.arrays.types import FloatArray

# Nearer to straight up or down than this, the azimuth is nothing but rounding.
_ZENITH_RAD = 4.0 * float(np.finfo(np.float64).eps)


@np.errstate(under="ignore")  # a product below 1e-308 is zero to every digit asked for
def ned_to_body(
    north: npt.ArrayLike,
    east: npt.ArrayLike,
    down: npt.ArrayLike,
    yaw_rad: npt.ArrayLike,
    pitch_rad: npt.ArrayLike,
    roll_rad: npt.ArrayLike,
) -> Vector:
    """Rotate a vector from the local NED frame into body axes.

    Parameters
    ----------
    north, east, down : array_like
        Components in NED, any unit.
    yaw_rad, pitch_rad, roll_rad : array_like
        The aircraft's attitude, ZYX. All six broadcast.

    Returns
    -------
    x, y, z : ndarray
        Components along nose, right wing and down through the floor, the same unit. The length
        is kept to 1e-15 of itself, also there and back (measured 5e-16 and 6e-16).
    """
    shape, arrays = common_shape_and_arrays(
        north=north, east=east, down=down, yaw_rad=yaw_rad, pitch_rad=pitch_rad, roll_rad=roll_rad
    )
    x, y, z = broadcast_results(shape, *ned_to_body_unchecked(*arrays))
    return x, y, z


@np.errstate(under="ignore")
def body_to_ned(
    x: npt.ArrayLike,
    y: npt.ArrayLike,
    z: npt.ArrayLike,
    yaw_rad: npt.ArrayLike,
    pitch_rad: npt.ArrayLike,
    roll_rad: npt.ArrayLike,
) -> Vector:
    """Rotate a vector from body axes into the local NED frame; undoes `ned_to_body`.

    Parameters
    ----------
    x, y, z : array_like
        Components along nose, right wing and down through the floor, any unit, which stays.
    yaw_rad, pitch_rad, roll_rad : array_like
        As for `ned_to_body`.

    Returns
    -------
    north, east, down : ndarray
    """
    shape, (bx, by, bz, yaw, pitch, roll) = common_shape_and_arrays(
        x=x, y=y, z=z, yaw_rad=yaw_rad, pitch_rad=pitch_rad, roll_rad=roll_rad
    )
    level_y, level_z = components_in_turned_axes(by, bz, -roll)
    down, level_x = components_in_turned_axes(level_z, bx, -pitch)
    north, east = components_in_turned_axes(level_x, level_y, -yaw)
    north, east, down = broadcast_results(shape, north, east, down)
    return north, east, down


@np.errstate(under="ignore")
def unit_vector(azimuth_rad: npt.ArrayLike, elevation_rad: npt.ArrayLike) -> Vector:
    """Return the unit vector (north, east, down) of a direction (rad).

    Parameters
    ----------
    azimuth_rad, elevation_rad : array_like
        Clockwise from north, and above the horizontal; broadcast.

    Returns
    -------
    north, east, down : ndarray
        Length 1. From body angles instead of NED angles it gives x, y, z in body axes.
    """
    shape, arrays = common_shape_and_arrays(azimuth_rad=azimuth_rad, elevation_rad=elevation_rad)
    north, east, down = broadcast_results(shape, *unit_vector_unchecked(*arrays))
    return north, east, down


@np.errstate(under="ignore")
def body_angles(
    x: npt.ArrayLike, y: npt.ArrayLike, z: npt.ArrayLike
) -> tuple[FloatArray, FloatArray]:
    """Return azimuth, elevation (rad) of a vector with components along nose, right wing and down.

    Parameters
    ----------
    x, y, z : array_like
        Components along nose, right wing and down, any length; broadcast.

    Returns
    -------
    body_azimuth_rad : ndarray
        Azimuth from the nose towards the right wing, in (-pi, pi]; 0 within 9e-16 rad of
        straight up and straight down (where only rounding would be left) and for a zero vector.
    body_elevation_rad : ndarray
        Elevation above the plane of the wings, in [-pi/2, pi/2].

    Notes
    -----
    p = atan2(y, x), q = atan2(-z, hypot(x, y)): no domain error and full accuracy near ±90
    degrees, where the asin of thesis eq. 5 loses half the digits.
    """
    shape, arrays = common_shape_and_arrays(x=x, y=y, z=z)
    wide = (np.ascontiguousarray(np.broadcast_to(a, shape or (1,))) for a in arrays)
    p, q = broadcast_results(shape, *body_angles_unchecked(*wide))
    return p, q


def relative_attitude(
    azimuth_rad: npt.ArrayLike,
    elevation_rad: npt.ArrayLike,
    target_yaw_rad: npt.ArrayLike,
    target_pitch_rad: npt.ArrayLike,
    target_roll_rad: npt.ArrayLike,
) -> Vector:
    """Return target yaw, pitch, roll relative to the line of sight, angle by angle (thesis eq. 6).

    A small-angle form of `line_of_sight_in_target_axes`, which has the same arguments: the sign of
    the elevation is right only for a receding target, and roll shares its axis with elevation only
    abeam. (Eq. 6 as printed takes p and q, which contain the ownship's own attitude, so that the
    aspect would change when we turn.)

    Returns
    -------
    psi_rel_rad, theta_rel_rad, phi_rel_rad : ndarray
        yaw - azimuth (0 when it flies away from us), elevation - pitch and elevation - roll, all
        wrapped into (-pi, pi].
    """
    shape, (azimuth, elevation, yaw, pitch, roll) = common_shape_and_arrays(
        azimuth_rad=azimuth_rad,
        elevation_rad=elevation_rad,
        target_yaw_rad=target_yaw_rad,
        target_pitch_rad=target_pitch_rad,
        target_roll_rad=target_roll_rad,
    )
    psi, theta, phi = broadcast_results(shape, yaw - azimuth, elevation - pitch, elevation - roll)
    return wrap_pi(psi), wrap_pi(theta), wrap_pi(phi)


def line_of_sight_in_target_axes(
    azimuth_rad: npt.ArrayLike,
    elevation_rad: npt.ArrayLike,
    target_yaw_rad: npt.ArrayLike,
    target_pitch_rad: npt.ArrayLike,
    target_roll_rad: npt.ArrayLike,
) -> Vector:
    """Return the unit vector from the observer to the target in the target's body axes.

    Parameters
    ----------
    azimuth_rad, elevation_rad : array_like
        Absolute bearing and elevation of the line of sight, from the observer to the target.
    target_yaw_rad, target_pitch_rad, target_roll_rad : array_like
        The target's attitude, ZYX. All five broadcast.

    Returns
    -------
    u_x, u_y, u_z : ndarray
        Along the target's nose, right wing and down; (-1, 0, 0) when it flies straight at us.

    Notes
    -----
    The target's attitude is taken in the observer's NED frame. The target's own NED frame leans
    by the angle between the two verticals, 0.009 degrees per km of distance, and its north
    differs by the convergence of the meridians, 0.009 degrees per km times tan(latitude) for a
    target east or west.
    """
    north, east, down = unit_vector(azimuth_rad, elevation_rad)
    return ned_to_body(north, east, down, target_yaw_rad, target_pitch_rad, target_roll_rad)


def aspect_angles(
    azimuth_rad: npt.ArrayLike,
    elevation_rad: npt.ArrayLike,
    target_yaw_rad: npt.ArrayLike,
    target_pitch_rad: npt.ArrayLike,
    target_roll_rad: npt.ArrayLike,
) -> tuple[FloatArray, FloatArray]:
    """Return azimuth, elevation (rad) from target to observer in the target's body axes.

    Arguments and frames are those of `line_of_sight_in_target_axes`.

    Returns
    -------
    aspect_azimuth_rad : ndarray
        Direction from the target to the observer in the target's body axes: 0 nose-on, pi/2 when
        the observer is off its right wing, pi from behind; in (-pi, pi].
    aspect_elevation_rad : ndarray
        Positive when the observer is above the plane of the target's wings; in [-pi/2, pi/2].
    """
    x, y, z = line_of_sight_in_target_axes(
        azimuth_rad, elevation_rad, target_yaw_rad, target_pitch_rad, target_roll_rad
    )
    return body_angles(-x, -y, -z)


def unit_vector_unchecked(azimuth: Any, elevation: Any) -> Vector:
    """Return unit vectors (north, east, down) of directions (rad): arrays of finite doubles."""
    level = np.cos(elevation)
    return level * np.cos(azimuth), level * np.sin(azimuth), -np.sin(elevation)


def ned_to_body_unchecked(n: Any, e: Any, d: Any, yaw: Any, pitch: Any, roll: Any) -> Vector:
    """Rotate vectors from local NED into body axes, unchecked: for arrays of finite doubles."""
    level_x, level_y = components_in_turned_axes(n, e, yaw)
    z, x = components_in_turned_axes(d, level_x, pitch)
    y, z = components_in_turned_axes(level_y, z, roll)
    return x, y, z


def body_angles_unchecked(
    x: FloatArray, y: FloatArray, z: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return azimuth, elevation (rad) of body-axes vectors: contiguous arrays of one shape."""
    level = np.hypot(x, y)
    return normalize_azimuths(np.arctan2(y, x), z, level), np.arctan2(0.0 - z, level)


def normalize_azimuths(azimuth: FloatArray, z: FloatArray, level: FloatArray) -> FloatArray:
    """Put azimuths into (-pi, pi] in place, 0 along z; return them; ``level`` is hypot(x, y)."""
    azimuth[azimuth <= -np.pi] = np.pi
    azimuth[level <= _ZENITH_RAD * np.abs(z)] = 0.0
    azimuth += 0.0
    return azimuth


def components_in_turned_axes(
    a: FloatArray, b: FloatArray, angle: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return a plane vector (a, b) in axes that are turned by the angle from a towards b."""
    sine, cosine = sine_and_cosine(angle)
    return cosine * a + sine * b, cosine * b - sine * a


def common_shape_and_arrays(**values: npt.ArrayLike) -> tuple[tuple[int, ...], list[FloatArray]]:
    """Check named arguments; return the common shape and each as float array, at least 1-D."""
    arrays = {name: check_squarable(name, value) for name, value in values.items()}
    shape = common_shape(**arrays)
    return shape, [a if a.ndim else a.reshape(1) for a in arrays.values()]
