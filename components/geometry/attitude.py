"""Turning directions between the local NED frame and the body axes of an aircraft.

Body axes are x nose, y right wing, z down. Attitude is yaw, pitch, roll in the order ZYX: from
north-east-down turn by yaw about down, by pitch about the new right wing, by roll about the nose.
All angles in radians; azimuth is clockwise from north (or from the nose), elevation is upwards.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from components.geometry.angles import (
    direction_angle,
    sine_and_cosine,
    slope_angle,
    wrap_pi,
    wrap_pi_unchecked,
)
from components.geometry.inputs import FloatArray, common_shape, finite, shaped

Triple = tuple[FloatArray, FloatArray, FloatArray]

# Nearer to straight up or down than this, the azimuth is nothing but rounding.
_ZENITH_RAD = 4.0 * float(np.finfo(np.float64).eps)

MODELS = ("exact", "small_angle")


@np.errstate(under="ignore")  # a product below 1e-308 is zero to every digit asked for
def ned_to_body(
    north: npt.ArrayLike,
    east: npt.ArrayLike,
    down: npt.ArrayLike,
    yaw_rad: npt.ArrayLike,
    pitch_rad: npt.ArrayLike,
    roll_rad: npt.ArrayLike,
) -> Triple:
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

    Raises
    ------
    ValueError
        NaN, infinity, or shapes that do not fit.
    """
    shape, arrays = _checked(
        north=north, east=east, down=down, yaw_rad=yaw_rad, pitch_rad=pitch_rad, roll_rad=roll_rad
    )
    x, y, z = shaped(shape, *_ned_to_body(*arrays))
    return x, y, z


@np.errstate(under="ignore")
def body_to_ned(
    x: npt.ArrayLike,
    y: npt.ArrayLike,
    z: npt.ArrayLike,
    yaw_rad: npt.ArrayLike,
    pitch_rad: npt.ArrayLike,
    roll_rad: npt.ArrayLike,
) -> Triple:
    """Rotate a vector from body axes into the local NED frame; undoes `ned_to_body`.

    Parameters
    ----------
    x, y, z : array_like
        Components along nose, right wing and down through the floor, any unit.
    yaw_rad, pitch_rad, roll_rad : array_like
        The aircraft's attitude, ZYX. All six broadcast.

    Returns
    -------
    north, east, down : ndarray
        The same unit.

    Raises
    ------
    ValueError
        NaN, infinity, or shapes that do not fit.
    """
    shape, (bx, by, bz, yaw, pitch, roll) = _checked(
        x=x, y=y, z=z, yaw_rad=yaw_rad, pitch_rad=pitch_rad, roll_rad=roll_rad
    )
    level_y, level_z = _turn(by, bz, -roll)
    down, level_x = _turn(level_z, bx, -pitch)
    north, east = _turn(level_x, level_y, -yaw)
    north, east, down = shaped(shape, north, east, down)
    return north, east, down


@np.errstate(under="ignore")
def unit_vector(azimuth_rad: npt.ArrayLike, elevation_rad: npt.ArrayLike) -> Triple:
    """Give the unit vector of a direction, in NED.

    Parameters
    ----------
    azimuth_rad, elevation_rad : array_like
        Clockwise from north, and above the horizontal; broadcast.

    Returns
    -------
    north, east, down : ndarray
        Length 1. From body angles instead of NED angles it gives x, y, z in body axes.

    Raises
    ------
    ValueError
        NaN, infinity, or shapes that do not fit.
    """
    shape, arrays = _checked(azimuth_rad=azimuth_rad, elevation_rad=elevation_rad)
    north, east, down = shaped(shape, *_unit_vector(*arrays))
    return north, east, down


@np.errstate(under="ignore")
def body_angles(
    x: npt.ArrayLike, y: npt.ArrayLike, z: npt.ArrayLike
) -> tuple[FloatArray, FloatArray]:
    """Find azimuth and elevation of a vector in body axes.

    Parameters
    ----------
    x, y, z : array_like
        Components along nose, right wing and down, any length; broadcast.

    Returns
    -------
    p_rad : ndarray
        Azimuth from the nose towards the right wing, in (-pi, pi]; 0 within 9e-16 rad of
        straight up and straight down (where only rounding would be left) and for a zero vector.
    q_rad : ndarray
        Elevation above the plane of the wings, in [-pi/2, pi/2].

    Raises
    ------
    ValueError
        NaN, infinity, or shapes that do not fit.

    Notes
    -----
    p = atan2(y, x), q = atan2(-z, hypot(x, y)): no domain error and full accuracy near ±90
    degrees, where the asin of thesis eq. 5 loses half the digits.
    """
    shape, arrays = _checked(x=x, y=y, z=z)
    p, q = shaped(shape, *_body_angles(*(np.ascontiguousarray(np.broadcast_to(a, shape or (1,)))
                                         for a in arrays)))  # fmt: skip
    return p, q


def sensor_angles(
    azimuth_rad: npt.ArrayLike,
    elevation_rad: npt.ArrayLike,
    yaw_rad: npt.ArrayLike,
    pitch_rad: npt.ArrayLike,
    roll_rad: npt.ArrayLike,
    model: str = "exact",
    *,
    validate: bool = True,
) -> tuple[FloatArray, FloatArray]:
    """Find where in its own axes the ownship sees a target: the thesis's angles p and q.

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
    p_rad : ndarray
        Azimuth from the nose, clockwise seen from above, in (-pi, pi].
    q_rad : ndarray
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
                n, e, d = _unit_vector(azimuth_rad, elevation_rad)
                return _body_angles(*_ned_to_body(n, e, d, yaw_rad, pitch_rad, roll_rad))
        north, east, down = unit_vector(azimuth_rad, elevation_rad)
        return body_angles(*ned_to_body(north, east, down, yaw_rad, pitch_rad, roll_rad))
    if model != "small_angle":
        allowed = " or ".join(repr(name) for name in MODELS)
        raise ValueError(f"model is {model!r}: it must be {allowed}")
    if not validate:
        given: tuple[Any, ...] = azimuth_rad, elevation_rad, yaw_rad, pitch_rad
        return _angle_by_angle(*given)
    shape, (azimuth, elevation, yaw, pitch, _) = _checked(
        azimuth_rad=azimuth_rad,
        elevation_rad=elevation_rad,
        yaw_rad=yaw_rad,
        pitch_rad=pitch_rad,
        roll_rad=roll_rad,
    )
    p, q = shaped(shape, *_angle_by_angle(azimuth, elevation, yaw, pitch))
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


def sensor_angles_of_offsets(
    north_m: FloatArray,
    east_m: FloatArray,
    up_m: FloatArray,
    yaw_rad: FloatArray,
    pitch_rad: FloatArray,
    roll_rad: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Find where in its own axes the ownship sees what lies at some offsets, without checks.

    Parameters
    ----------
    north_m, east_m, up_m : ndarray
        Offsets in the ownship's local frame, of the broadcast shape.
    yaw_rad, pitch_rad, roll_rad : ndarray
        The ownship's attitude, ZYX. All six are contiguous arrays of finite doubles, at least one
        axis.

    Returns
    -------
    p_rad, q_rad : ndarray
        As from `sensor_angles`, to the last digit or two; at a third of its cost, because the
        direction need not be taken apart into angles first.
    """
    x, y = _turn(north_m, east_m, yaw_rad)
    z = 0.0 - up_m
    if pitch_rad.any():  # straight and level, as most fly most of the time, these change nothing
        z, x = _turn(z, x, pitch_rad)
    if roll_rad.any():
        y, z = _turn(y, z, roll_rad)
    level = x * x
    level += y * y
    np.sqrt(level, out=level)
    return _azimuth(direction_angle(y, x), z, level), slope_angle(0.0 - z, level)


def relative_attitude(
    azimuth_rad: npt.ArrayLike,
    elevation_rad: npt.ArrayLike,
    target_yaw_rad: npt.ArrayLike,
    target_pitch_rad: npt.ArrayLike,
    target_roll_rad: npt.ArrayLike,
) -> Triple:
    """Find the target's attitude relative to the line of sight, angle by angle (thesis eq. 6).

    Parameters
    ----------
    azimuth_rad, elevation_rad : array_like
        Absolute bearing and elevation of the line of sight, from the observer to the target.
        (Eq. 6 as printed takes p and q, which contain the ownship's own attitude, so that the
        aspect would change when we turn.)
    target_yaw_rad, target_pitch_rad, target_roll_rad : array_like
        The target's attitude, ZYX. All five broadcast.

    Returns
    -------
    psi_rel_rad, theta_rel_rad, phi_rel_rad : ndarray
        yaw - azimuth (0 when it flies away from us), elevation - pitch and elevation - roll, all
        wrapped into (-pi, pi].

    Raises
    ------
    ValueError
        NaN, infinity, or shapes that do not fit.

    Notes
    -----
    A small-angle form: the sign of the elevation is right only for a receding target, and roll
    shares its axis with elevation only abeam. `line_of_sight_in_target_axes` is exact.
    """
    shape, (azimuth, elevation, yaw, pitch, roll) = _checked(
        azimuth_rad=azimuth_rad,
        elevation_rad=elevation_rad,
        target_yaw_rad=target_yaw_rad,
        target_pitch_rad=target_pitch_rad,
        target_roll_rad=target_roll_rad,
    )
    psi, theta, phi = shaped(shape, yaw - azimuth, elevation - pitch, elevation - roll)
    return wrap_pi(psi), wrap_pi(theta), wrap_pi(phi)


def line_of_sight_in_target_axes(
    azimuth_rad: npt.ArrayLike,
    elevation_rad: npt.ArrayLike,
    target_yaw_rad: npt.ArrayLike,
    target_pitch_rad: npt.ArrayLike,
    target_roll_rad: npt.ArrayLike,
) -> Triple:
    """Give the unit vector from the observer to the target in the target's body axes.

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

    Raises
    ------
    ValueError
        NaN, infinity, or shapes that do not fit.

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
    """Find from which side the observer sees the target, exactly.

    Parameters
    ----------
    azimuth_rad, elevation_rad : array_like
        Absolute bearing and elevation of the line of sight, from the observer to the target.
    target_yaw_rad, target_pitch_rad, target_roll_rad : array_like
        The target's attitude, ZYX. All five broadcast.

    Returns
    -------
    aspect_azimuth_rad : ndarray
        Direction from the target to the observer in the target's body axes: 0 nose-on, pi/2 when
        the observer is off its right wing, pi from behind; in (-pi, pi].
    aspect_elevation_rad : ndarray
        Positive when the observer is above the plane of the target's wings; in [-pi/2, pi/2].

    Raises
    ------
    ValueError
        NaN, infinity, or shapes that do not fit.

    Notes
    -----
    The remark on frames at `line_of_sight_in_target_axes` holds here too.
    """
    x, y, z = line_of_sight_in_target_axes(
        azimuth_rad, elevation_rad, target_yaw_rad, target_pitch_rad, target_roll_rad
    )
    return body_angles(-x, -y, -z)


def _unit_vector(azimuth: Any, elevation: Any) -> Triple:
    level = np.cos(elevation)
    return level * np.cos(azimuth), level * np.sin(azimuth), -np.sin(elevation)


def _ned_to_body(n: Any, e: Any, d: Any, yaw: Any, pitch: Any, roll: Any) -> Triple:
    level_x, level_y = _turn(n, e, yaw)
    z, x = _turn(d, level_x, pitch)
    y, z = _turn(level_y, z, roll)
    return x, y, z


def _body_angles(x: FloatArray, y: FloatArray, z: FloatArray) -> tuple[FloatArray, FloatArray]:
    """`body_angles` for contiguous arrays of one shape."""
    level = np.hypot(x, y)
    return _azimuth(np.arctan2(y, x), z, level), np.arctan2(0.0 - z, level)


def _azimuth(azimuth: FloatArray, z: FloatArray, level: FloatArray) -> FloatArray:
    """Put an azimuth into (-pi, pi], and to 0 for what points along z; level is hypot(x, y)."""
    azimuth[azimuth <= -np.pi] = np.pi
    azimuth[level <= _ZENITH_RAD * np.abs(z)] = 0.0
    azimuth += 0.0
    return azimuth


def _turn(a: FloatArray, b: FloatArray, angle: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Components of a plane vector in axes turned by the angle from a towards b."""
    sine, cosine = sine_and_cosine(angle)
    return cosine * a + sine * b, cosine * b - sine * a


def _checked(**values: npt.ArrayLike) -> tuple[tuple[int, ...], list[FloatArray]]:
    """Check named arguments; returns the broadcast shape and arrays of at least one axis."""
    arrays = {name: finite(name, value) for name, value in values.items()}
    shape = common_shape(**arrays)
    return shape, [a if a.ndim else a.reshape(1) for a in arrays.values()]
