"""Straight and level: motion along a geodesic of the ellipsoid, in closed form over arrays."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from components.geometry import (
    DEG_PER_RAD,
    ECCENTRICITY_SQUARED,
    FLATTENING,
    SEMI_MAJOR_AXIS_M,
    direction_angle,
    radii_of_curvature,
    slope_angle,
    wrap_heading_rad,
    wrap_longitude_deg,
)
from dsa_des.arrays.types import FloatArray

# Rows of the parameter table of one straight leg.
GEODESIC_ROWS = 20
(
    _SPEED_RADIUS,
    _CENTRE_DISTANCE,
    _CLIMB,
    _ALT,
    _TAU,
    _PER_METRE,
    _SIN_AZ0,
    _COS_AZ0,
    _LON_RAD,
    _LON_SLOPE,
    _SIGMA,
    _RADIUS,
) = range(12)
_INVERSE, _LONGITUDE = 12, 17
_INVERSE_TERMS, _LONGITUDE_TERMS = 5, 3


def geodesic_parameters(
    lat_deg: Any, lon_deg: Any, alt_m: Any, azimuth_rad: Any, speed_mps: Any, climb_mps: Any
) -> FloatArray:
    """Return the parameters of a straight leg along a geodesic, (rows,), or of many, (rows, n).

    The series are those of C. F. F. Karney, "Algorithms for geodesics", Journal of Geodesy 87
    (2013), eqs 15-18, 21, 24 and 25, to the fifth order: below 4 nm on WGS-84. Functions whose last
    bit may differ between libraries are those of `math`, one value at a time.
    """
    n = FLATTENING / (2.0 - FLATTENING)
    semi_minor = SEMI_MAJOR_AXIS_M * (1.0 - FLATTENING)
    # The cosine from the distance to the pole in degrees, which is exact, keeps its digits there.
    sin_beta = (1.0 - FLATTENING) * apply_elementwise(
        math.sin, apply_elementwise(math.radians, lat_deg)
    )
    cos_beta = apply_elementwise(math.sin, apply_elementwise(math.radians, 90.0 - abs(lat_deg)))
    length = apply_elementwise(math.hypot, sin_beta, cos_beta)
    # At the very pole every meridian starts; a tiny cosine keeps the one that was asked for.
    sin_beta, cos_beta = sin_beta / length, apply_elementwise(_avoid_zero, cos_beta / length)
    sin_az, cos_az = (
        apply_elementwise(math.sin, azimuth_rad),
        apply_elementwise(math.cos, azimuth_rad),
    )
    sin_az0 = sin_az * cos_beta
    cos_az0 = apply_elementwise(math.hypot, cos_az, sin_az * sin_beta)
    along = cos_az * cos_beta
    sigma1 = apply_elementwise(_angle_from_node, sin_beta, along, sin_beta, cos_az)
    # Not by the sine and cosine of sigma1: near a pole they have lost the longitude.
    omega1 = apply_elementwise(_angle_from_node, sin_az0 * sin_beta, along, sin_beta, cos_az)
    k2 = ECCENTRICITY_SQUARED / (1.0 - ECCENTRICITY_SQUARED) * cos_az0 * cos_az0
    eps = k2 / (2.0 * (1.0 + apply_elementwise(math.sqrt, 1.0 + k2)) + k2)
    a1, c1, c1_inverse = _distance_series(eps)
    a3, c3 = _longitude_series(eps, n)
    sines = [apply_elementwise(math.sin, 2 * (j + 1) * sigma1) for j in range(len(c1))]
    lon_slope = FLATTENING * sin_az0 * a3
    # Radius of curvature along the heading (Euler): what turns metres aloft into metres below.
    meridian, prime_vertical = radii_of_curvature(lat_deg)
    radius = 1.0 / (cos_az * cos_az / meridian + sin_az * sin_az / prime_vertical)
    table = np.zeros((GEODESIC_ROWS, *np.shape(lat_deg)))
    table[_SPEED_RADIUS] = speed_mps * radius
    table[_CENTRE_DISTANCE] = radius + alt_m
    table[_CLIMB], table[_ALT] = climb_mps, alt_m
    table[_TAU], table[_PER_METRE] = sigma1 + _sum_products(c1, sines), 1.0 / (semi_minor * a1)
    table[_SIN_AZ0], table[_COS_AZ0] = sin_az0, cos_az0
    i3 = sigma1 + _sum_products(c3, sines)
    table[_LON_RAD] = apply_elementwise(math.radians, lon_deg) - omega1 + lon_slope * i3
    table[_LON_SLOPE], table[_SIGMA], table[_RADIUS] = lon_slope, sigma1, radius
    table[_INVERSE : _INVERSE + _INVERSE_TERMS] = c1_inverse
    table[_LONGITUDE : _LONGITUDE + _LONGITUDE_TERMS] = c3[:_LONGITUDE_TERMS]
    return table


def apply_elementwise(function: Callable[..., float], *values: Any) -> Any:
    """Return the function's value for numbers, or for arrays its value for each element."""
    if not isinstance(values[0], np.ndarray):
        return function(*values)
    columns = (value.tolist() for value in values)
    return np.fromiter(map(function, *columns), dtype=np.float64, count=len(values[0]))


def _avoid_zero(cosine: float) -> float:
    return max(cosine, 1e-100)


def _angle_from_node(y: float, x: float, sin_beta: float, cos_az: float) -> float:
    """Return atan2(y, x), an angle from the geodesic's node; 0 along the equator, without node."""
    return math.atan2(y, x) if sin_beta or cos_az else 0.0


def power_rounded_as_python(base: Any, exponent: int) -> Any:
    """Return numbers to an integer power, rounded as Python does and NumPy does not."""
    return apply_elementwise(lambda value: value**exponent, base)


def _sum_products(factors: Sequence[Any], sines: Sequence[Any]) -> Any:
    """Return the sum of factor times sine, added from first to last so it always rounds alike."""
    total = factors[0] * sines[0]
    for factor, sine in zip(factors[1:], sines[1:], strict=False):
        total = total + factor * sine
    return total


def flight_time_s(
    distance_m: float, speed_mps: float, alt_m: float, end_alt_m: float, radius_m: float
) -> float:
    """Return how long (s) a straight leg on the ellipsoid takes, at the mean of its altitudes."""
    return distance_m * (radius_m + 0.5 * (alt_m + end_alt_m)) / (speed_mps * radius_m)


def leg_radius_m(parameters: FloatArray) -> float:
    """Return the radius of curvature (m) that is stored in a straight leg's parameters."""
    return float(parameters[_RADIUS])


def position_and_yaw_on_geodesic(
    table: FloatArray, elapsed: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return latitude, longitude (deg), altitude (m), yaw (rad) on straight legs at times (s)."""
    # Worked out in place: with a dozen arrays in flight less, the rest stays in the cache.
    # Flights that all keep their altitude have one row of them for all times.
    climbed = table[_CLIMB] * (elapsed if np.count_nonzero(table[_CLIMB]) else elapsed[:1])
    # Ground speed is flown at altitude: over the ellipsoid it is slower by R / (R + h), with h
    # the mean altitude so far. The bound only matters in a dive to the Earth's core.
    below = 0.5 * climbed
    below += table[_CENTRE_DISTANCE]
    np.maximum(below, 0.5 * table[_RADIUS], out=below)
    tau = table[_SPEED_RADIUS] * elapsed
    tau /= below
    tau *= table[_PER_METRE]
    tau += table[_TAU]
    sine, cosine, spare = np.sin(tau), np.cos(tau), np.empty_like(tau)
    delta = _sine_series(table, _INVERSE, _INVERSE_TERMS, sine, cosine, spare)
    sigma = np.add(tau, delta, out=tau)
    _advance_angle(sine, cosine, delta, spare)  # now those of sigma
    along = table[_COS_AZ0] * cosine
    sin_az0 = table[_SIN_AZ0]
    cos_beta = np.multiply(along, along, out=spare)
    cos_beta += sin_az0 * sin_az0
    np.sqrt(cos_beta, out=cos_beta)
    cos_beta *= 1.0 - FLATTENING
    sin_beta = np.multiply(sine, table[_COS_AZ0], out=delta)
    lat = slope_angle(sin_beta, cos_beta)
    lat *= DEG_PER_RAD
    lon = direction_angle(np.multiply(sine, sin_az0, out=delta), cosine)
    sigma += _sine_series(table, _LONGITUDE, _LONGITUDE_TERMS, sine, cosine, spare)
    sigma *= table[_LON_SLOPE]
    lon -= sigma
    lon += table[_LON_RAD]
    lon *= DEG_PER_RAD
    sine[...] = sin_az0
    yaw = direction_angle(sine, along)
    climbed += table[_ALT]
    return lat, wrap_longitude_deg(lon), climbed, wrap_heading_rad(yaw)


def _advance_angle(
    sine: FloatArray, cosine: FloatArray, delta: FloatArray, spare: FloatArray
) -> None:
    """Advance sine and cosine in place by at most 9e-4 rad; ``delta``, ``spare`` are overwritten.

    The small angle's own sine and cosine are series to its fifth power; then the addition theorem.
    """
    squared = np.multiply(delta, delta, out=spare)
    cos_delta = squared * (-1.0 / 24.0)
    cos_delta += 0.5
    cos_delta *= squared
    np.subtract(1.0, cos_delta, out=cos_delta)
    sin_delta = squared * (-1.0 / 120.0)
    sin_delta += 1.0 / 6.0
    sin_delta *= squared
    np.subtract(1.0, sin_delta, out=sin_delta)
    sin_delta *= delta
    np.multiply(cosine, sin_delta, out=delta)
    sin_delta *= sine
    sine *= cos_delta
    sine += delta
    cosine *= cos_delta
    cosine -= sin_delta


def _sine_series(
    table: FloatArray,
    row: int,
    terms: int,
    sine: FloatArray,
    cosine: FloatArray,
    spare: FloatArray,
) -> FloatArray:
    """Return the sum of c_j sin(2 j x) by Clenshaw's recurrence, from the sine and cosine of x."""
    two_cos = cosine - sine
    two_cos *= 2.0
    two_cos *= np.add(cosine, sine, out=spare)
    latest = np.empty_like(two_cos)
    latest[...] = table[row + terms - 1]
    later = two_cos * latest
    later += table[row + terms - 2]
    for j in range(terms - 3, -1, -1):
        np.multiply(two_cos, later, out=spare)
        spare += table[row + j]
        spare -= latest
        latest, later, spare = later, spare, latest
    later *= 2.0
    later *= sine
    later *= cosine
    return later


def _distance_series(eps: Any) -> tuple[Any, list[Any], list[Any]]:
    """Return A1 and the lists C1 and C1' of Karney (2013), eqs 17, 18, 21, at epsilon ``eps``."""
    e2 = eps * eps
    a1 = (1.0 + e2 * (1 / 4 + e2 * (1 / 64 + e2 / 256))) / (1.0 - eps)
    c1 = [
        eps * (-1 / 2 + e2 * (3 / 16 - e2 / 32)),
        e2 * (-1 / 16 + e2 * (1 / 32 - e2 * 9 / 2048)),
        eps * e2 * (-1 / 48 + e2 * 3 / 256),
        e2 * e2 * (-5 / 512 + e2 * 3 / 512),
        eps * e2 * e2 * (-7 / 1280),
    ]
    inverse = [
        eps * (1 / 2 + e2 * (-9 / 32 + e2 * 205 / 1536)),
        e2 * (5 / 16 + e2 * (-37 / 96 + e2 * 1335 / 4096)),
        eps * e2 * (29 / 96 - e2 * 75 / 128),
        e2 * e2 * (539 / 1536 - e2 * 2391 / 2560),
        eps * e2 * e2 * 3467 / 7680,
    ]
    return a1, c1, inverse


def _longitude_series(eps: Any, n: float) -> tuple[Any, list[Any]]:
    """Return A3 and the list C3 of Karney (2013), eqs 24 and 25, by epsilon and flattening."""
    a3 = 1.0 - eps * (
        1 / 2
        - n / 2
        + eps
        * (
            1 / 4
            + n * (1 / 8 - n * 3 / 8)
            + eps * (1 / 16 + n * (3 / 16 + n / 16) + eps * (3 / 64 + n / 32 + eps * 3 / 128))
        )
    )
    c3 = [
        eps
        * (
            1 / 4
            - n / 4
            + eps
            * (
                1 / 8
                - n * n / 8
                + eps * (3 / 64 + n * (3 / 64 - n / 64) + eps * (5 / 128 + n / 64 + eps * 3 / 128))
            )
        ),
        power_rounded_as_python(eps, 2)
        * (
            1 / 16
            - n * (3 / 32 - n / 32)
            + eps * (3 / 64 - n * (1 / 32 + n * 3 / 64) + eps * (3 / 128 + n / 128 + eps * 5 / 256))
        ),
        power_rounded_as_python(eps, 3)
        * (5 / 192 - n * (3 / 64 - n * 5 / 192) + eps * (3 / 128 - n * 5 / 192 + eps * 7 / 512)),
    ]
    return a3, c3
