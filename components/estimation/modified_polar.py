"""Corrections of tracks without a range, in modified polar coordinates.

Directions say nothing of the range; a filter whose state is Cartesian believes that they do, as its
covariance, long as it is along the line of sight, keeps the direction of before while the state
turns. In angles, the inverse of the range, and velocity by range, all is nearly linear: the
direction, and how it changes with the target's motion and with the sensor's own.

A filter in these coordinates whose motion is Cartesian is one in Cartesian coordinates whose
corrections go by way of these: the state is moved in them, and the covariance goes into them where
the state was and comes back where it is.

Source: Aidala, Hammel, *Utilization of modified polar coordinates for bearings-only tracking*, IEEE
Trans. AC 28 (1983); here in three dimensions, with the target's own velocity in place of the
relative one.
"""

import numpy as np

from components.estimation.batched import (
    matrix_product,
    matrix_times_vector,
    multiply_by_transpose,
    squared_length,
    symmetrised,
)
from components.estimation.frame import dot
from dsa_des.arrays.types import FloatArray

# Tracks are kept between these.
_NEAREST_M, _FARTHEST_M = 1.0, 1e7
# An inverse range is never below 0: the least is the mean of one that is all but 0, in units of its
# standard deviation, sqrt(2 / pi). Less of it would have spreads far beyond the range.
_LEAST = 0.8
# A line of sight steeper than this (sine of its distance from the vertical) is turned about north.
_UPRIGHT = 0.1


def apply_correction_in_polar(
    before: FloatArray, after: FloatArray, covariance: FloatArray, sensor_m: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return state, covariance with a Cartesian correction made in modified polar coordinates."""
    axes, distance, by_range, to_polar = _polar_geometry(before, sensor_m)
    change = matrix_times_vector(to_polar, after[:6] - before[:6])
    return _apply_polar_change(
        axes, distance, by_range, to_polar, change, after, covariance, sensor_m
    )


def apply_correction_by_rotation(
    before: FloatArray,
    after: FloatArray,
    covariance: FloatArray,
    sensor_m: FloatArray,
    sensor_m_s: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Return state and covariance with a correction applied as a turn about the vertical and a
    change of ground distance and height.

    Where range and height are known far better than the bearing, what is known of a target lies on
    an arc about the vertical through the sensor, and of its motion past the sensor along and across
    the arc: a bearing turns both, and changes neither distance nor how fast that grows.
    """
    away, velocity = before[:3] - sensor_m, before[3:6] - sensor_m_s
    moved, spread = after.copy(), covariance.copy()
    ground = np.maximum(np.hypot(away[0], away[1]), _NEAREST_M)
    cos, sin = away[0] / ground, away[1] / ground
    change = after[:6] - before[:6]

    def radial_and_tangential(vector: FloatArray) -> tuple[FloatArray, FloatArray]:
        return cos * vector[0] + sin * vector[1], cos * vector[1] - sin * vector[0]

    outward, aside = radial_and_tangential(change)
    angle = aside / ground
    along, across = radial_and_tangential(velocity)
    gained, beside = radial_and_tangential(change[3:])
    distance = np.maximum(ground + outward, _NEAREST_M)
    along_then = along + gained + across * angle
    across_then = across + beside - along * angle
    cos_then, sin_then = (
        np.cos(angle) * cos - np.sin(angle) * sin,
        np.sin(angle) * cos + (np.cos(angle) * sin),
    )
    moved[0] = sensor_m[0] + distance * cos_then
    moved[1] = sensor_m[1] + distance * sin_then
    moved[3] = sensor_m_s[0] + along_then * cos_then - across_then * sin_then
    moved[4] = sensor_m_s[1] + along_then * sin_then + across_then * cos_then
    # The derivative of the state there by the one here: of the level parts, by way of the arc.
    here = np.zeros((4, 4, len(ground)))  # bearing, distance, motion along and across
    here[0, 0], here[0, 1] = -sin / ground, cos / ground
    here[1, 0], here[1, 1] = cos, sin
    here[2, 0], here[2, 1], here[2, 2], here[2, 3] = *(across * here[0, :2]), cos, sin
    here[3, 0], here[3, 1], here[3, 2], here[3, 3] = *(-along * here[0, :2]), -sin, cos
    there = np.zeros_like(here)
    there[0, 0], there[0, 1] = -distance * sin_then, cos_then
    there[1, 0], there[1, 1] = distance * cos_then, sin_then
    there[2, 0] = -along_then * sin_then - across_then * cos_then
    there[3, 0] = along_then * cos_then - across_then * sin_then
    there[2, 2], there[2, 3], there[3, 2], there[3, 3] = cos_then, -sin_then, sin_then, cos_then
    step, rows = matrix_product(there, here), [0, 1, 3, 4]
    spread[rows] = matrix_product(step, covariance[rows])
    spread[:, rows] = multiply_by_transpose(spread[:, rows], step)
    return moved, symmetrised(spread)


def update_with_first_range(
    state: FloatArray,
    covariance: FloatArray,
    range_m: FloatArray,
    variance_m2: FloatArray,
    sensor_m: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Return Cartesian states and covariances updated with tracks' first range (m), corrected
    linearly in its inverse by way of modified polar coordinates.
    """
    measured = np.maximum(range_m, np.maximum(np.sqrt(variance_m2), _NEAREST_M))
    axes, distance, by_range, to_polar = _polar_geometry(state, sensor_m)
    whole = np.zeros_like(covariance)  # derivative of the polar state by the Cartesian one
    whole[:6, :6] = to_polar
    for i in range(6, len(state)):
        whole[i, i] = 1.0
    spread = symmetrised(multiply_by_transpose(matrix_product(whole, covariance), whole))
    error = variance_m2 / (measured * measured) / (measured * measured)
    gain = spread[:, 2] / (spread[2, 2] + error)
    left = -np.concatenate(
        [np.zeros((len(state), 2, len(distance))), gain[:, np.newaxis]], axis=1
    )  # (I - K H), by its first three columns
    for i in range(3):
        left[i, i] += 1.0
    shrunk = matrix_product(left, spread[:3])
    shrunk[3:] += spread[3:]
    joseph = matrix_product(left, shrunk.swapaxes(0, 1)[:3])
    joseph[3:] += shrunk.swapaxes(0, 1)[3:]
    joseph += gain[:, np.newaxis] * gain[np.newaxis] * error
    change = gain * (1.0 / measured - 1.0 / distance)
    moved = state.copy()
    moved[6:] += change[6:]
    identity = np.zeros_like(to_polar)
    for i in range(6):
        identity[i, i] = 1.0
    return _apply_polar_change(
        axes, distance, by_range, identity, change[:6], moved, joseph, sensor_m
    )


def _polar_geometry(
    state: FloatArray, sensor_m: FloatArray
) -> tuple[list[FloatArray], FloatArray, FloatArray, FloatArray]:
    """Return axes at the line of sight, range, velocity along axes over range, polar derivative."""
    away, velocity = state[:3] - sensor_m, state[3:6]
    distance = np.maximum(np.sqrt(squared_length(away)), _NEAREST_M)
    axes = _line_of_sight_axes(away / distance)
    by_range = np.array([dot(axis, velocity) for axis in axes]) / distance
    return axes, distance, by_range, _polar_jacobian(axes, distance, velocity)


def _apply_polar_change(
    axes: list[FloatArray],
    distance: FloatArray,
    by_range: FloatArray,
    to_polar: FloatArray,
    change: FloatArray,
    state: FloatArray,
    covariance: FloatArray,
    sensor_m: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Return Cartesian state and covariance after polar coordinates change by `change` (6, n)."""
    row = to_polar[2:3]
    spread = multiply_by_transpose(matrix_product(row, covariance[:6, :6]), row)[0, 0]
    least = np.maximum(_LEAST * np.sqrt(np.maximum(spread, 0.0)), 1.0 / _FARTHEST_M)
    inverse = np.minimum(np.maximum(1.0 / distance + change[2], least), 1.0 / _NEAREST_M)
    by_range = by_range + change[3:]
    turned = _rotate_axes(axes, change[0], change[1])
    moved = state.copy()
    moved[:3] = sensor_m + turned[0] / inverse
    moved[3:6] = sum(w * axis for w, axis in zip(by_range, turned, strict=True)) / inverse
    step = matrix_product(_state_by_polar_jacobian(turned, change[1], inverse, by_range), to_polar)
    whole = covariance.copy()
    whole[:6, :6] = multiply_by_transpose(matrix_product(step, covariance[:6, :6]), step)
    if len(state) > 6:
        whole[:6, 6:] = matrix_product(step, covariance[:6, 6:])
        whole[6:, :6] = whole[:6, 6:].swapaxes(0, 1)
    return moved, symmetrised(whole)


def _line_of_sight_axes(line: FloatArray) -> list[FloatArray]:
    """Return three orthogonal unit vectors, each (3, n): the line of sight and two across it."""
    upright = np.hypot(line[0], line[1]) < _UPRIGHT
    one = np.where(upright, np.array([[1.0], [0.0], [0.0]]), np.array([[0.0], [0.0], [1.0]]))
    across = _cross(one, line)
    across = across / np.sqrt(squared_length(across))
    return [line, across, _cross(line, across)]


def _polar_jacobian(
    axes: list[FloatArray], distance: FloatArray, velocity: FloatArray
) -> FloatArray:
    """Return polar coordinates' derivative (6, 6, n) by position and velocity, at a line of sight.

    They are two angles, the inverse of the range, and the velocity along the line of sight and
    across it, divided by the range.
    """
    line, across, third = axes
    result = np.zeros((6, 6, len(distance)))
    inverse = 1.0 / distance
    result[0, :3], result[1, :3] = across * inverse, third * inverse
    result[2, :3] = -line * (inverse * inverse)
    along, side, up = (dot(axis, velocity) for axis in axes)
    result[3, :3] = along * result[2, :3] + inverse * (side * result[0, :3] + up * result[1, :3])
    result[4, :3] = side * result[2, :3] - inverse * along * result[0, :3]
    result[5, :3] = up * result[2, :3] - inverse * along * result[1, :3]
    for i, axis in enumerate(axes):
        result[3 + i, 3:] = axis * inverse
    return result


def _rotate_axes(axes: list[FloatArray], one: FloatArray, other: FloatArray) -> list[FloatArray]:
    """Return the axes turned by the first angle about the third, then by the second towards it."""
    line, across, third = axes
    level = np.cos(one) * line + np.sin(one) * across
    return [
        np.cos(other) * level + np.sin(other) * third,
        np.cos(one) * across - np.sin(one) * line,
        np.cos(other) * third - np.sin(other) * level,
    ]


def _state_by_polar_jacobian(
    axes: list[FloatArray], other: FloatArray, inverse: FloatArray, by_range: FloatArray
) -> FloatArray:
    """Return the derivative (6, 6, n) of position and velocity by polar coordinates."""
    line, across, third = axes
    along, side, up = by_range
    distance, cos, sin = 1.0 / inverse, np.cos(other), np.sin(other)
    result = np.zeros((6, 6, len(inverse)))
    result[:3, 0], result[:3, 1] = distance * cos * across, distance * third
    result[:3, 2] = -distance * distance * line
    result[3:, 0] = distance * (
        (along * cos - up * sin) * across + side * (sin * third - cos * line)
    )
    result[3:, 1] = distance * (along * third - up * line)
    result[3:, 2] = -distance * distance * (along * line + side * across + up * third)
    for i, axis in enumerate(axes):
        result[3:, 3 + i] = distance * axis
    return result


def _cross(one: FloatArray, other: FloatArray) -> FloatArray:
    return np.array(
        [
            one[1] * other[2] - one[2] * other[1],
            one[2] * other[0] - one[0] * other[2],
            one[0] * other[1] - one[1] * other[0],
        ]
    )
