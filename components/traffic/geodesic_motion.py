"""Straight and level: motion along a geodesic of the ellipsoid, in closed form over arrays."""

from __future__ import annotations

import math

import numpy as np

from components.geometry.angles import direction_angle, slope_angle
from components.geometry.ellipsoid import ECCENTRICITY_SQUARED, FLATTENING, SEMI_MAJOR_AXIS_M
from components.traffic.normals import (
    DEG_PER_RAD,
    FloatArray,
    radii_of_curvature,
    wrap_heading_rad,
    wrap_longitude_deg,
)

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
    lat_deg: float,
    lon_deg: float,
    alt_m: float,
    azimuth_rad: float,
    speed_mps: float,
    climb_mps: float,
) -> FloatArray:
    """Prepare a straight leg: everything that does not depend on time.

    Parameters
    ----------
    lat_deg, lon_deg, alt_m : float
        Where the leg starts.
    azimuth_rad : float
        Heading at the start, clockwise from north.
    speed_mps, climb_mps : float
        Ground speed (at the flight's altitude) and rate of climb.

    Returns
    -------
    ndarray, shape (20,)
        For `geodesic_state`.

    Notes
    -----
    The series are those of C. F. F. Karney, "Algorithms for geodesics", Journal of Geodesy 87
    (2013), eqs 15-18, 21, 24 and 25, to the fifth order: below 4 nm on WGS-84.
    """
    n = FLATTENING / (2.0 - FLATTENING)
    semi_minor = SEMI_MAJOR_AXIS_M * (1.0 - FLATTENING)
    # The cosine from the distance to the pole in degrees, which is exact, keeps its digits there.
    sin_beta = (1.0 - FLATTENING) * math.sin(math.radians(lat_deg))
    cos_beta = math.sin(math.radians(90.0 - abs(lat_deg)))
    length = math.hypot(sin_beta, cos_beta)
    # At the very pole every meridian starts; a tiny cosine keeps the one that was asked for.
    sin_beta, cos_beta = sin_beta / length, max(cos_beta / length, 1e-100)
    sin_az, cos_az = math.sin(azimuth_rad), math.cos(azimuth_rad)
    sin_az0 = sin_az * cos_beta
    cos_az0 = math.hypot(cos_az, sin_az * sin_beta)
    sigma1 = math.atan2(sin_beta, cos_az * cos_beta) if sin_beta or cos_az else 0.0
    # Not by the sine and cosine of sigma1: near a pole they have lost the longitude.
    omega1 = math.atan2(sin_az0 * sin_beta, cos_az * cos_beta) if sin_beta or cos_az else 0.0
    k2 = ECCENTRICITY_SQUARED / (1.0 - ECCENTRICITY_SQUARED) * cos_az0 * cos_az0
    eps = k2 / (2.0 * (1.0 + math.sqrt(1.0 + k2)) + k2)
    a1, c1, c1_inverse = _distance_series(eps)
    a3, c3 = _longitude_series(eps, n)
    tau1 = sigma1 + sum(c * math.sin(2 * (j + 1) * sigma1) for j, c in enumerate(c1))
    lon_slope = FLATTENING * sin_az0 * a3
    i3 = sigma1 + sum(c * math.sin(2 * (j + 1) * sigma1) for j, c in enumerate(c3))
    # Radius of curvature along the heading (Euler): what turns metres aloft into metres below.
    meridian, prime_vertical = (float(r) for r in radii_of_curvature(lat_deg))
    radius = 1.0 / (cos_az * cos_az / meridian + sin_az * sin_az / prime_vertical)
    table = np.zeros(GEODESIC_ROWS)
    table[_SPEED_RADIUS] = speed_mps * radius
    table[_CENTRE_DISTANCE] = radius + alt_m
    table[_CLIMB], table[_ALT] = climb_mps, alt_m
    table[_TAU], table[_PER_METRE] = tau1, 1.0 / (semi_minor * a1)
    table[_SIN_AZ0], table[_COS_AZ0] = sin_az0, cos_az0
    table[_LON_RAD] = math.radians(lon_deg) - omega1 + lon_slope * i3
    table[_LON_SLOPE] = lon_slope
    table[_SIGMA] = sigma1
    table[_RADIUS] = radius
    table[_INVERSE : _INVERSE + _INVERSE_TERMS] = c1_inverse
    table[_LONGITUDE : _LONGITUDE + _LONGITUDE_TERMS] = c3[:_LONGITUDE_TERMS]
    return table


def flight_time_s(
    distance_m: float, speed_mps: float, alt_m: float, end_alt_m: float, radius_m: float
) -> float:
    """Find how long a straight leg over a distance on the ellipsoid takes at an altitude.

    Parameters
    ----------
    distance_m : float
        Geodesic distance on the ellipsoid.
    speed_mps : float
        Ground speed at altitude.
    alt_m, end_alt_m : float
        Altitudes at the two ends.
    radius_m : float
        The leg's radius of curvature, from `leg_radius_m`.

    Returns
    -------
    float
        Seconds.
    """
    return distance_m * (radius_m + 0.5 * (alt_m + end_alt_m)) / (speed_mps * radius_m)


def leg_radius_m(parameters: FloatArray) -> float:
    """Return the radius of curvature that a leg's parameters were made with."""
    return float(parameters[_RADIUS])


def geodesic_state(
    table: FloatArray, elapsed: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Evaluate straight legs.

    Parameters
    ----------
    table : ndarray, shape (20, …)
        Parameters, broadcasting against `elapsed` after the first axis.
    elapsed : ndarray
        Seconds since the start of the leg.

    Returns
    -------
    lat_deg, lon_deg, alt_m, yaw_rad : ndarray
        Yaw is the geodesic's azimuth there, in [0, 2 pi).
    """
    climbed = table[_CLIMB] * elapsed
    # Ground speed is flown at altitude: over the ellipsoid it is slower by R / (R + h), with h
    # the mean altitude so far. The bound only matters when someone dives to the Earth's core.
    below = np.maximum(table[_CENTRE_DISTANCE] + 0.5 * climbed, 0.5 * table[_RADIUS])
    tau = table[_SPEED_RADIUS] * elapsed
    tau /= below
    tau *= table[_PER_METRE]
    tau += table[_TAU]
    sin_tau, cos_tau = np.sin(tau), np.cos(tau)
    delta = _sine_series(table, _INVERSE, _INVERSE_TERMS, sin_tau, cos_tau)
    sigma = tau + delta
    # sin and cos of the small delta (below 9e-4) to its fifth power; then the addition theorem.
    d2 = delta * delta
    cos_delta = 1.0 - d2 * (0.5 - d2 * (1.0 / 24.0))
    sin_delta = delta * (1.0 - d2 * (1.0 / 6.0 - d2 * (1.0 / 120.0)))
    sin_sigma = sin_tau * cos_delta + cos_tau * sin_delta
    cos_sigma = cos_tau * cos_delta - sin_tau * sin_delta
    sin_beta = table[_COS_AZ0] * sin_sigma
    along = table[_COS_AZ0] * cos_sigma
    sin_az0 = table[_SIN_AZ0]
    cos_beta = np.sqrt(along * along + sin_az0 * sin_az0)
    cos_beta *= 1.0 - FLATTENING
    lat = slope_angle(sin_beta, cos_beta)
    lat *= DEG_PER_RAD
    lon = direction_angle(sin_az0 * sin_sigma, cos_sigma)
    sigma += _sine_series(table, _LONGITUDE, _LONGITUDE_TERMS, sin_sigma, cos_sigma)
    sigma *= table[_LON_SLOPE]
    lon -= sigma
    lon += table[_LON_RAD]
    lon *= DEG_PER_RAD
    yaw = direction_angle(sin_az0 + np.zeros_like(along), along)
    return lat, wrap_longitude_deg(lon), table[_ALT] + climbed, wrap_heading_rad(yaw)


def _sine_series(
    table: FloatArray, row: int, terms: int, sine: FloatArray, cosine: FloatArray
) -> FloatArray:
    """Sum c_j sin(2 j x) by Clenshaw's recurrence, given the sine and cosine of x."""
    two_cos = 2.0 * (cosine - sine) * (cosine + sine)
    later, latest = table[row + terms - 1] + 0.0 * two_cos, 0.0 * two_cos
    for j in range(terms - 2, -1, -1):
        later, latest = table[row + j] + two_cos * later - latest, later
    later *= 2.0 * sine * cosine
    return later


def _distance_series(eps: float) -> tuple[float, list[float], list[float]]:
    """A1, C1 and C1' of Karney (2013), eqs 17, 18 and 21."""
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


def _longitude_series(eps: float, n: float) -> tuple[float, list[float]]:
    """A3 and C3 of Karney (2013), eqs 24 and 25."""
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
        eps**2
        * (
            1 / 16
            - n * (3 / 32 - n / 32)
            + eps * (3 / 64 - n * (1 / 32 + n * 3 / 64) + eps * (3 / 128 + n / 128 + eps * 5 / 256))
        ),
        eps**3
        * (5 / 192 - n * (3 / 64 - n * 5 / 192) + eps * (3 / 128 - n * 5 / 192 + eps * 7 / 512)),
    ]
    return a3, c3
