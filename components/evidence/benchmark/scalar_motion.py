"""Straight flight and the line of sight for one aircraft at a time, in plain Python.

The formulas are those of `components.flights.geodesic_motion` and `components.geometry`; this is
how one writes them without arrays. Only the benchmark's yardstick uses them.
"""

from collections.abc import Callable
from math import atan2, cos, fmod, hypot, pi, sin, sqrt

from components.geometry.ellipsoid import (
    ECCENTRICITY_SQUARED,
    FLATTENING,
    SEMI_MAJOR_AXIS_M,
)

Position = tuple[float, float, float, float]
_DEG = 180.0 / pi
_RAD = pi / 180.0


def straight_flight(parameters: list[float]) -> Callable[[float], Position]:
    """Return a function from elapsed seconds to latitude, longitude (deg), altitude (m) and yaw.

    Parameters
    ----------
    parameters : list of float
        One straight leg's, from `components.flights.geodesic_motion.geodesic_parameters`.
    """
    speed_radius, centre, climb, alt0, tau0, per_metre, sin_az0, cos_az0 = parameters[:8]
    lon0, lon_slope, _, radius = parameters[8:12]
    i1, i2, i3, i4, i5, l1, l2, l3 = parameters[12:20]
    shrink = 1.0 - FLATTENING

    def position(elapsed: float) -> Position:
        climbed = climb * elapsed
        below = max(centre + 0.5 * climbed, 0.5 * radius)
        tau = speed_radius * elapsed / below * per_metre + tau0
        s, c = sin(tau), cos(tau)
        two = 2.0 * (c - s) * (c + s)
        b4 = i4 + two * i5
        b3 = i3 + two * b4 - i5
        b2 = i2 + two * b3 - b4
        delta = (i1 + two * b2 - b3) * 2.0 * s * c
        sigma = tau + delta
        s, c = sin(sigma), cos(sigma)
        along = cos_az0 * c
        lat = atan2(cos_az0 * s, sqrt(along * along + sin_az0 * sin_az0) * shrink) * _DEG
        two = 2.0 * (c - s) * (c + s)
        b2 = l2 + two * l3
        bend = (l1 + two * b2 - l3) * 2.0 * s * c
        lon = (atan2(sin_az0 * s, c) - (sigma + bend) * lon_slope + lon0) * _DEG
        return lat, fmod(lon + 540.0, 360.0) - 180.0, alt0 + climbed, atan2(sin_az0, along)

    return position


def line_of_sight(own: Position, target: Position) -> tuple[float, float, float]:
    """Return north, east and up offsets (m) of a target, exact on the WGS-84 ellipsoid."""
    e2 = ECCENTRICITY_SQUARED
    lat1, lon1, alt1, _ = own
    lat2, lon2, alt2, _ = target
    s1, c1 = sin(lat1 * _RAD), cos(lat1 * _RAD)
    dlat = lat2 - lat1
    half = dlat * 0.5 * _RAD
    sin_half, cos_half = sin(half), cos(half)
    ds = 2.0 * sin_half * (c1 * cos_half - s1 * sin_half)
    s2 = s1 + ds
    w1, w2 = sqrt(1.0 - e2 * s1 * s1), sqrt(1.0 - e2 * s2 * s2)
    n2 = SEMI_MAJOR_AXIS_M / w2
    dn = n2 * e2 * ds * (s1 + s2) / (w1 * (w1 + w2))
    dns = n2 * ds + dn * s1
    dlon = lon2 - lon1
    if dlon >= 180.0:
        dlon -= 360.0
    elif dlon < -180.0:
        dlon += 360.0
    half_lon = dlon * 0.5 * _RAD
    sin_half_lon = sin(half_lon)
    n2 += alt2
    across = 2.0 * n2 * cos(lat2 * _RAD) * sin_half_lon
    bulge = across * sin_half_lon
    north = 2.0 * n2 * sin_half * cos_half - e2 * c1 * dns + s1 * bulge
    up = dn + (alt2 - alt1) - 2.0 * n2 * sin_half * sin_half - e2 * s1 * dns - c1 * bulge
    return north, across * cos(half_lon), up


def level_body_axes(yaw_rad: float, pitch_rad: float, roll_rad: float) -> list[float]:
    """Return the nine cosines that turn north, east, down into nose, right wing, floor (ZYX)."""
    sy, cy = sin(yaw_rad), cos(yaw_rad)
    sp, cp = sin(pitch_rad), cos(pitch_rad)
    sr, cr = sin(roll_rad), cos(roll_rad)
    return [
        cp * cy, cp * sy, -sp,
        sr * sp * cy - cr * sy, sr * sp * sy + cr * cy, sr * cp,
        cr * sp * cy + sr * sy, cr * sp * sy - sr * cy, cr * cp,
    ]  # fmt: skip


def silhouette(
    north: float, east: float, up: float, range_m: float, attitude: tuple[float, float, float]
) -> tuple[float, float, float]:
    """Return the cosine and sine of the angle off a target's nose, and |u_z| in its body axes."""
    m = level_body_axes(*attitude)
    n, e, d = north / range_m, east / range_m, -up / range_m
    x = m[0] * n + m[1] * e + m[2] * d
    y = m[3] * n + m[4] * e + m[5] * d
    z = m[6] * n + m[7] * e + m[8] * d
    return x, hypot(y, z), abs(z)
