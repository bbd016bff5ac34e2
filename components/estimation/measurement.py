"""The measurement function: angles in body axes, range, range rate and velocity of a target.

Azimuth is clockwise from the nose, elevation upward, both in the ownship's body axes; the range
rate is positive when the range grows. Which of them a sensor measures is its `Kind`.
"""

from dataclasses import dataclass

import numpy as np

from components.estimation.batched import (
    matrix_product,
    matrix_times_vector,
    multiply_by_transpose,
    squared_length,
)
from components.estimation.frame import SensorPose, dot
from components.geometry import unit_vector_unchecked, wrap_pi_unchecked
from dsa_des.arrays.types import BoolArray, FloatArray

# At the zenith of the body axes azimuth has no derivative: this far from it, as a share of the
# range, derivatives are those of the edge.
_ZENITH = 1e-6
# A target at the sensor itself has no direction: derivatives are those of one this far away.
_NEAREST_M = 1e-3


@dataclass(frozen=True)
class Kind:
    """Quantities measured, in order: azimuth, elevation (always), range, range rate, velocity.

    The target's velocity is along the frame's axes.
    """

    has_range: bool = True
    has_range_rate: bool = False
    has_velocity: bool = False

    @property
    def size(self) -> int:
        """Number of quantities of the measurement."""
        return 2 + self.has_range + self.has_range_rate + 3 * self.has_velocity


def expected_measurement(kind: Kind, state: FloatArray, pose: SensorPose) -> FloatArray:
    """Return the error-free measurement (m, n) that sensors at these poses would make of states."""
    away = state[:3] - pose.position_m
    x, y, z = matrix_times_vector(pose.to_body, away)
    seen = np.empty((kind.size, state.shape[-1]))
    np.arctan2(y, x, out=seen[0])
    np.arctan2(-z, np.hypot(x, y), out=seen[1])
    if kind.size == 2:
        return seen
    distance = np.sqrt(squared_length(away))
    if kind.has_range:
        seen[2] = distance
    if kind.has_range_rate:
        closing = _relative_velocity(state, pose)
        seen[2 + kind.has_range] = dot(away, closing) / np.maximum(distance, _NEAREST_M)
    if kind.has_velocity:
        seen[-3:] = state[3:6]
    return seen


def linearise(kind: Kind, state: FloatArray, pose: SensorPose) -> tuple[FloatArray, FloatArray]:
    """Return the exact measurement (m, n), its derivative by position, and velocity if needed."""
    away = state[:3] - pose.position_m
    turned = pose.to_body
    x, y, z = matrix_times_vector(turned, away)
    distance = np.maximum(np.sqrt(squared_length(away)), _NEAREST_M)
    square = distance * distance
    level = np.hypot(x, y)
    safe = np.maximum(level, _ZENITH * distance)
    seen = np.empty((kind.size, state.shape[-1]))
    np.arctan2(y, x, out=seen[0])
    np.arctan2(-z, level, out=seen[1])
    moving = kind.has_range_rate or kind.has_velocity
    jacobian = np.zeros((kind.size, 6 if moving else 3, state.shape[-1]))
    level_square = safe * safe
    steep = z / (safe * square)
    term = np.empty_like(away)
    for row, parts in (
        (0, (-y / level_square, x / level_square)),
        (1, (x * steep, y * steep, -safe / square)),
    ):
        slope = jacobian[row, :3]
        np.multiply(parts[0], turned[0], out=slope)
        for part, axis in zip(parts[1:], turned[1:], strict=False):
            np.multiply(part, axis, out=term)
            slope += term
    if kind.size == 2:
        return seen, jacobian
    unit = away / distance
    if kind.has_range:
        seen[2] = distance
        jacobian[2, :3] = unit
    if kind.has_range_rate:
        closing = _relative_velocity(state, pose)
        rate = dot(away, closing) / distance
        row = 2 + kind.has_range
        seen[row] = rate
        jacobian[row, :3] = (closing - rate * unit) / distance
        jacobian[row, 3:6] = unit
    if kind.has_velocity:
        seen[-3:] = state[3:6]
        for axis in range(3):
            jacobian[axis - 3, 3 + axis] = 1.0
    return seen, jacobian


def relative_range_deviation(away: FloatArray, covariance: FloatArray) -> FloatArray:
    """Return the range's relative standard deviation, of vectors (3, n), covariances (3, 3, n)."""
    squared = squared_length(away)
    along = sum(away[i] * away[j] * covariance[i, j] for i in range(3) for j in range(3))
    return np.asarray(np.sqrt(np.maximum(along, 0.0)) / np.maximum(squared, _NEAREST_M**2))


def azimuth_elevation_and_variances(
    away: FloatArray, covariance: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return azimuth and elevation (rad) of vectors (3, n), and the variance of each (rad²)."""
    x, y, z = away
    distance = np.maximum(np.sqrt(squared_length(away)), _NEAREST_M)
    level = np.hypot(x, y)
    safe = np.maximum(level, _ZENITH * distance)
    c, s = x / safe, y / safe
    across = s * s * covariance[0, 0] - 2.0 * c * s * covariance[0, 1] + c * c * covariance[1, 1]
    # Along the unit vector in which the elevation grows.
    a, b, up = c * (z / distance), s * (z / distance), -safe / distance
    upward = a * a * covariance[0, 0] + b * b * covariance[1, 1] + up * up * covariance[2, 2]
    upward += 2.0 * (a * b * covariance[0, 1] + up * (a * covariance[0, 2] + b * covariance[1, 2]))
    return (
        np.arctan2(y, x), np.arctan2(-z, level),
        across / (safe * safe), upward / (distance * distance),
    )  # fmt: skip


def residual(measured: FloatArray, expected: FloatArray) -> FloatArray:
    """Return measured less expected, differences of azimuth and elevation wrapped to (-pi, pi]."""
    apart = measured - expected
    apart[:2] = wrap_pi_unchecked(np.ascontiguousarray(apart[:2]))
    return apart


def position_and_jacobian(measured: FloatArray, pose: SensorPose) -> tuple[FloatArray, FloatArray]:
    """Return a measured position (3, n), and its derivative by azimuth, elevation and range."""
    azimuth, elevation, distance = measured[:3]
    cos_a, sin_a = np.cos(azimuth), np.sin(azimuth)
    cos_e, sin_e = np.cos(elevation), np.sin(elevation)
    body = np.stack([cos_e * cos_a, cos_e * sin_a, -sin_e])
    by_azimuth = np.stack([-cos_e * sin_a, cos_e * cos_a, np.zeros_like(azimuth)])
    by_elevation = np.stack([-sin_e * cos_a, -sin_e * sin_a, -cos_e])
    to_frame = pose.to_body.swapaxes(0, 1)
    unit = matrix_times_vector(to_frame, body)
    jacobian = np.stack(
        [
            distance * matrix_times_vector(to_frame, by_azimuth),
            distance * matrix_times_vector(to_frame, by_elevation),
            unit,
        ],
        axis=1,
    )
    return pose.position_m + distance * unit, jacobian


def _relative_velocity(state: FloatArray, pose: SensorPose) -> FloatArray:
    if pose.velocity_m_s is None:
        raise ValueError("a range rate needs the velocity of the sensor")
    return state[3:6] - pose.velocity_m_s


def cone_half_angle_rad(
    position_m: FloatArray, covariance: FloatArray, pose: SensorPose, sigmas: float
) -> FloatArray:
    """Return the half angle, rad, of the cone about the expected direction of so many sigmas."""
    seen, by_position = linearise(Kind(has_range=False), position_m, pose)
    spread = multiply_by_transpose(matrix_product(by_position, covariance), by_position)
    level = np.cos(seen[1])
    across, upward = spread[0, 0] * level * level, spread[1, 1]
    both = spread[0, 1] * level
    # The larger eigenvalue of two by two.
    mean, half = 0.5 * (across + upward), 0.5 * (across - upward)
    widest = mean + np.sqrt(half * half + both * both)
    return np.minimum(sigmas * np.sqrt(np.maximum(widest, 0.0)), np.pi)


def cone_axis_in_body(
    ahead_s: FloatArray,
    state: FloatArray,
    direction: FloatArray,
    has_range: BoolArray,
    pose: SensorPose,
) -> FloatArray:
    """Return body-axes unit vectors (3, n) to predicted positions, or directions without range."""
    pointed = np.stack(unit_vector_unchecked(direction[0], direction[1]))
    away = state[:3] + ahead_s * state[3:] - pose.position_m
    away = np.where(has_range, away, pointed)
    length = np.sqrt(away[0] ** 2 + away[1] ** 2 + away[2] ** 2)
    return matrix_times_vector(pose.to_body, away / np.maximum(length, 1e-9))
