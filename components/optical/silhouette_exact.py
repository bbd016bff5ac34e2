"""The exact silhouette area of an aircraft of sphere, cylinder and plate from a direction."""

from __future__ import annotations

import numpy as np

from components.arguments.checks import FloatArray
from components.geometry.angles import sine_and_cosine


def line_of_sight_in_target_axes(
    relative_heading_rad: FloatArray,
    pitch_rad: FloatArray,
    roll_rad: FloatArray,
    elevation_rad: FloatArray,
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Rotate the line of sight into the target's body axes (x nose, y right wing, z down).

    The line of sight runs from us to the target. Seen in a north-east-down frame turned so that
    its bearing is 0 it is (cos elevation, 0, -sin elevation); the target's yaw in that frame is
    its relative heading, and the rotation is yaw, pitch, roll (ZYX). Written out,

        u_x = cos(pitch) cos(yaw) cos(elevation) + sin(pitch) sin(elevation)
        m   = sin(pitch) cos(yaw) cos(elevation) - cos(pitch) sin(elevation)
        n   = sin(yaw) cos(elevation)
        u_y = sin(roll) m - cos(roll) n
        u_z = cos(roll) m + sin(roll) n

    m cancels when we look along the target's long axis, so it is evaluated as
    sin(pitch - elevation) - 2 sin(pitch) cos(elevation) sin²(yaw/2), or with the sum and the
    cosine when the target comes towards us. The sine of the angle off the nose, sqrt(m² + n²), then
    keeps full relative accuracy down to 0. The yaw's own sine and cosine are those of twice its
    half; of a flight that holds its pitch and roll these are taken once.

    Parameters
    ----------
    relative_heading_rad, pitch_rad, roll_rad, elevation_rad : flat arrays of one shape, rad

    Returns
    -------
    u_x, u_y, u_z : flat arrays
        Unit vector components; u_x = 1 when the target flies straight away from us.
    sin_off_nose : flat array
        |x_body × u|, the sine of the angle between the long axis and the line of sight.

    Notes
    -----
    Replaces the small-angle subtraction of thesis eq. 6 (errata 4 and 9).
    """
    half_yaw = 0.5 * relative_heading_rad
    sin_half, cos_half = np.sin(half_yaw), np.cos(half_yaw)
    sin_yaw = 2.0 * sin_half * cos_half
    cos_yaw = (cos_half - sin_half) * (cos_half + sin_half)
    sin_pitch, cos_pitch = sine_and_cosine(pitch_rad)
    sin_roll, cos_roll = sine_and_cosine(roll_rad)
    sin_elevation, cos_elevation = np.sin(elevation_rad), np.cos(elevation_rad)

    leaving = cos_yaw >= 0.0
    tilt = np.sin(np.where(leaving, pitch_rad - elevation_rad, pitch_rad + elevation_rad))
    side = 2.0 * sin_pitch * cos_elevation
    m = np.where(leaving, tilt - side * np.square(sin_half), side * np.square(cos_half) - tilt)
    n = sin_yaw * cos_elevation

    u_x = cos_pitch * cos_yaw * cos_elevation + sin_pitch * sin_elevation
    u_y = sin_roll * m - cos_roll * n
    u_z = cos_roll * m + sin_roll * n
    return u_x, u_y, u_z, np.sqrt(m * m + n * n)


def front_and_back_area(
    cos_off_nose: FloatArray, front_m2: FloatArray, back_m2: FloatArray
) -> FloatArray:
    """Mix the front and the back sphere by aspect (thesis eq. 20-21, errata 12).

    (back - front)·(cos/2 + 1/2) + front: the back alone when the target flies away (cos = 1), the
    front alone when it comes head on (cos = -1). Written as a mean of the two so that it never
    leaves the interval between them by rounding.

    Parameters
    ----------
    cos_off_nose : flat array
        Cosine of the angle between the target's nose and the line of sight from us to it.
    front_m2, back_m2 : flat arrays, m²

    Returns
    -------
    flat array, m²
    """
    share_of_back = np.clip(0.5 * cos_off_nose + 0.5, 0.0, 1.0)
    return back_m2 * share_of_back + front_m2 * (1.0 - share_of_back)


def exact_area(
    relative_heading_rad: FloatArray,
    pitch_rad: FloatArray,
    roll_rad: FloatArray,
    elevation_rad: FloatArray,
    front_m2: FloatArray,
    side_m2: FloatArray,
    horizontal_m2: FloatArray,
    back_m2: FloatArray | None,
) -> FloatArray:
    """Sum the exact projections of sphere, cylinder and horizontal plane (errata 9).

    front + side·|x_body × u| + horizontal·|u_z|, with u the line of sight in the target's body
    axes. With `back_m2` the sphere becomes the mix of eq. 20-21 with cos g = x_body·u.

    Parameters
    ----------
    relative_heading_rad, pitch_rad, roll_rad, elevation_rad : flat arrays, rad
    front_m2, side_m2, horizontal_m2, back_m2 : flat arrays, m²

    Returns
    -------
    flat array, m²
    """
    u_x, _, u_z, sin_off_nose = line_of_sight_in_target_axes(
        relative_heading_rad, pitch_rad, roll_rad, elevation_rad
    )
    sphere = front_m2 if back_m2 is None else front_and_back_area(u_x, front_m2, back_m2)
    return sphere + side_m2 * sin_off_nose + horizontal_m2 * np.abs(u_z)
