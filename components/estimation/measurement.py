"""What a sensor would measure of a target: angles in body axes, range, range rate.

Azimuth is clockwise from the nose, elevation upward, both in the ownship's body axes; the range
rate is positive when the range grows. Which of them a sensor measures is its `Kind`.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from components.estimation.batched import squared_length, times
from components.estimation.frame import Place
from components.geometry.angles import wrap_pi_unchecked
from dsa_des.arrays.types import FloatArray

# At the zenith of the body axes azimuth has no derivative: this far from it, as a share of the
# range, derivatives are those of the edge.
_ZENITH = 1e-6
# A target at the sensor itself has no direction: derivatives are those of one this far away.
_NEAREST_M = 1e-3


@dataclass(frozen=True)
class Kind:
    """Which quantities are measured, in this order: azimuth, elevation, range, range rate."""

    has_range: bool = True
    has_range_rate: bool = False

    @property
    def size(self) -> int:
        """How many quantities there are."""
        return 2 + self.has_range + self.has_range_rate


def expected(kind: Kind, state: FloatArray, place: Place) -> FloatArray:
    """Return what would be measured without error.

    Parameters
    ----------
    kind : Kind
    state : (d, n)
        Position and velocity first, in the frame.
    place : Place
        Of n sensors.

    Returns
    -------
    ndarray of shape (kind.size, n)
        Azimuth in [-pi, pi] and elevation in rad, range in m, range rate in m/s.
    """
    away = state[:3] - place.position_m
    x, y, z = times(place.to_body, away)
    found = np.empty((kind.size, state.shape[-1]))
    np.arctan2(y, x, out=found[0])
    np.arctan2(-z, np.hypot(x, y), out=found[1])
    if kind.size == 2:
        return found
    distance = np.sqrt(squared_length(away))
    if kind.has_range:
        found[2] = distance
    if kind.has_range_rate:
        found[-1] = _along(away, _closing(state, place)) / np.maximum(distance, _NEAREST_M)
    return found


def linearised(kind: Kind, state: FloatArray, place: Place) -> tuple[FloatArray, FloatArray]:
    """Return what would be measured, and its derivative by position and velocity.

    Returns
    -------
    expected : (kind.size, n)
    jacobian : (kind.size, 6, n), or (kind.size, 3, n) where no range rate is measured
        Exact but at the zenith of the body axes.
    """
    away = state[:3] - place.position_m
    turned = place.to_body
    x, y, z = times(turned, away)
    distance = np.maximum(np.sqrt(squared_length(away)), _NEAREST_M)
    square = distance * distance
    level = np.hypot(x, y)
    safe = np.maximum(level, _ZENITH * distance)
    found = np.empty((kind.size, state.shape[-1]))
    np.arctan2(y, x, out=found[0])
    np.arctan2(-z, level, out=found[1])
    jacobian = np.zeros((kind.size, 6 if kind.has_range_rate else 3, state.shape[-1]))
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
        return found, jacobian
    unit = away / distance
    if kind.has_range:
        found[2] = distance
        jacobian[2, :3] = unit
    if kind.has_range_rate:
        closing = _closing(state, place)
        rate = _along(away, closing) / distance
        found[-1] = rate
        jacobian[-1, :3] = (closing - rate * unit) / distance
        jacobian[-1, 3:6] = unit
    return found, jacobian


def direction(
    away: FloatArray, covariance: Mapping[tuple[int, int], FloatArray] | FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return azimuth and elevation of vectors (3, n) along the axes they are in, and variances.

    Parameters
    ----------
    away : (3, n)
        North, east, down or nose, right, floor.
    covariance : (3, 3, n), or its elements (n,) by row and column
        Its upper triangle is read.

    Returns
    -------
    azimuth_rad, elevation_rad, azimuth_variance_rad2, elevation_variance_rad2 : (n,) arrays
        Variances by the derivatives of `linearised`.
    """
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
    """Return measured less expected, azimuth and elevation wrapped into (-pi, pi].

    Parameters
    ----------
    measured, expected : (m, n)
    """
    found = measured - expected
    found[0] = wrap_pi_unchecked(np.ascontiguousarray(found[0]))
    found[1] = wrap_pi_unchecked(np.ascontiguousarray(found[1]))
    return found


def position_of(measured: FloatArray, place: Place) -> tuple[FloatArray, FloatArray]:
    """Return where in the frame a measurement with range lies, and the derivative by it.

    Parameters
    ----------
    measured : (3 or 4, n)
        Azimuth, elevation (rad), range (m); a range rate is not used.
    place : Place

    Returns
    -------
    position_m : (3, n)
    jacobian : (3, 3, n)
        By azimuth, elevation and range.
    """
    azimuth, elevation, distance = measured[:3]
    cos_a, sin_a = np.cos(azimuth), np.sin(azimuth)
    cos_e, sin_e = np.cos(elevation), np.sin(elevation)
    body = np.stack([cos_e * cos_a, cos_e * sin_a, -sin_e])
    by_azimuth = np.stack([-cos_e * sin_a, cos_e * cos_a, np.zeros_like(azimuth)])
    by_elevation = np.stack([-sin_e * cos_a, -sin_e * sin_a, -cos_e])
    to_frame = place.to_body.swapaxes(0, 1)
    unit = times(to_frame, body)
    jacobian = np.stack(
        [distance * times(to_frame, by_azimuth), distance * times(to_frame, by_elevation), unit],
        axis=1,
    )
    return place.position_m + distance * unit, jacobian


def _closing(state: FloatArray, place: Place) -> FloatArray:
    if place.velocity_m_s is None:
        raise ValueError("a range rate needs the velocity of the sensor")
    return state[3:6] - place.velocity_m_s


def _along(one: FloatArray, other: FloatArray) -> FloatArray:
    return one[0] * other[0] + one[1] * other[1] + one[2] * other[2]
