"""Angles between directions: of azimuths and elevations, of unit vectors, of chords.

Forms that differ in their last bits and in their cost, so each caller names the one it means:
`angle_between` is right to the last digits at every separation, `angle_by_haversine` takes half
of its time and loses digits near half a turn, and the chord serves where it is wanted itself.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from components.arguments.checks import broadcast_flat, check_angle_rad, unflatten
from components.geometry.angles import Vector
from components.geometry.attitude import unit_vector_unchecked
from dsa_des.arrays.types import FloatArray


def angle_between(
    first_azimuth_rad: ArrayLike,
    first_elevation_rad: ArrayLike,
    second_azimuth_rad: ArrayLike,
    second_elevation_rad: ArrayLike,
) -> Any:
    """Return the angle (rad, 0 to pi) between two directions, exact at every separation.

    atan2(|a × b|, a·b) of the two unit vectors, with cross and dot product written in differences
    of the angles so that a small separation keeps its digits: azimuths that wrap and directions
    near the zenith are nothing special.

    Parameters
    ----------
    first_azimuth_rad, first_elevation_rad, second_azimuth_rad, second_elevation_rad : array_like
        Directions in any one frame, rad.

    Returns
    -------
    array of the broadcast shape, rad
        In [0, pi].
    """
    shape, flat = broadcast_flat(
        first_azimuth_rad=check_angle_rad("first_azimuth_rad", first_azimuth_rad),
        first_elevation_rad=check_angle_rad("first_elevation_rad", first_elevation_rad),
        second_azimuth_rad=check_angle_rad("second_azimuth_rad", second_azimuth_rad),
        second_elevation_rad=check_angle_rad("second_elevation_rad", second_elevation_rad),
    )
    p1, q1, p2, q2 = flat
    turn, climb = p2 - p1, q2 - q1
    cos1, cos2, sin1 = np.cos(q1), np.cos(q2), np.sin(q1)
    versine = 2.0 * np.square(np.sin(0.5 * turn))
    across = cos2 * np.sin(turn)
    upward = np.sin(climb) + sin1 * cos2 * versine
    along = np.cos(climb) - cos1 * cos2 * versine
    return unflatten(np.arctan2(np.hypot(across, upward), along), shape)


def angle_by_haversine(
    azimuth_rad: FloatArray,
    elevation_rad: FloatArray,
    other_azimuth_rad: FloatArray,
    other_elevation_rad: FloatArray,
) -> FloatArray:
    """Return the angle between two directions (rad, of one shape) by the haversine; NaN stays NaN.

    Accurate when it is small; near pi only half of the digits are right.
    """
    high = np.sin(0.5 * (elevation_rad - other_elevation_rad))
    wide = np.sin(0.5 * (azimuth_rad - other_azimuth_rad))
    share = high * high + np.cos(elevation_rad) * np.cos(other_elevation_rad) * wide * wide
    apart: FloatArray = 2.0 * np.arcsin(np.sqrt(np.minimum(share, 1.0)))
    return apart


def unit_vectors(azimuth_rad: FloatArray, elevation_rad: FloatArray) -> FloatArray:
    """Return unit vectors in NED, components along the last axis; angles are not checked."""
    return np.stack(unit_vector_unchecked(azimuth_rad, elevation_rad), axis=-1)


def angle_between_vectors(one: FloatArray, other: FloatArray) -> FloatArray:
    """Return the angle (rad) between vectors (..., 3) of any length, accurate if small, too."""
    across = np.linalg.norm(np.cross(one, other), axis=-1)
    apart: FloatArray = np.arctan2(across, (one * other).sum(axis=-1))
    return apart


def chord_between(one: Vector, other: Vector) -> FloatArray:
    """Return the distance between the tips of two unit vectors, in [0, 2]."""
    x, y, z = (a - b for a, b in zip(one, other, strict=True))
    chord: FloatArray = np.sqrt(x * x + y * y + z * z)
    return chord


def angle_of_chord(chord: FloatArray) -> FloatArray:
    """Return the angle (rad, 0 to pi) between unit vectors from the distance of their tips."""
    apart: FloatArray = 2.0 * np.arcsin(np.minimum(1.0, 0.5 * chord))
    return apart
