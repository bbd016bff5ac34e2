"""Derive velocity and attitude of an aircraft from where it flew."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from components.geometry.angles import FloatArray, Vector, local_axes, wrap_heading_rad
from components.geometry.ellipsoid import radii_of_curvature

STANDARD_GRAVITY_MPS2 = 9.80665
"""ISO 80000-3 standard acceleration of free fall."""

WINDOW_S = 4.0
"""Whole width of the smoothing window: ±2 s around each sample, and always both neighbours."""

SLOWEST_TRACK_MPS = 0.5
"""Below this ground speed a track is noise: yaw is held, pitch and roll are zero."""

MEDIAN_AZIMUTH_ERROR_DEG = 4.2
"""Median error in azimuth of targets seen in derived body axes, against the measured attitude of
flown intercepts: wind, sideslip and angle of attack are not in a path."""

_MOST_OFFSETS = 50
# A sample that lies half a window away lies in the window, whatever its time was rounded to:
# samples closer than a microsecond are one instant.
_EDGE_S = 1e-6
# Below this, the times in a window are too clumped to tell a curve from noise.
_POOREST_CONDITION = 1e-3


def fit_path(
    time_s: FloatArray,
    lat_deg: FloatArray,
    lon_deg: FloatArray,
    alt_m: FloatArray,
    *,
    window_s: float = WINDOW_S,
) -> tuple[Vector, Vector]:
    """Estimate velocity and acceleration at each sample by a parabola fitted around it.

    Parameters
    ----------
    time_s : ndarray, shape (n,)
        Strictly increasing.
    lat_deg, lon_deg, alt_m : ndarray, shape (n,) or (n, aircraft)
        The path of one aircraft, or those of several that have the same times.
    window_s : float
        Whole width of the window. Samples within half of it, and always the two neighbours,
        enter the least-squares parabola with equal weight.

    Returns
    -------
    velocity : tuple of three ndarray
        East, north, up in m/s, in each sample's own local frame.
    acceleration : tuple of three ndarray
        East, north, up in m/s², relative to the straight line over the ellipsoid; zero where
        the window holds fewer than three samples or too clumped ones (a straight line is fitted).
    """
    east, north, up = local_axes(lat_deg, lon_deg)
    meridian, prime_vertical = radii_of_curvature(lat_deg)

    def displacement(i: slice, j: slice) -> Vector:
        return (
            _dot(up, j, east, i) * (prime_vertical[i] + alt_m[i]),
            _dot(up, j, north, i) * (meridian[i] + alt_m[i]),
            alt_m[j] - alt_m[i],
        )

    # The reference sample is at the origin by definition, so only displacements are summed.
    return _fit(time_s, displacement, lat_deg.shape, degree=2, window_s=window_s)


def attitude_from_path(
    time_s: FloatArray,
    lat_deg: FloatArray,
    lon_deg: FloatArray,
    alt_m: FloatArray,
    *,
    velocity_enu_mps: Vector | None = None,
    wind_east_north_mps: tuple[float, float] = (0.0, 0.0),
    window_s: float = WINDOW_S,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Derive yaw, pitch and roll at each sample from the flight path.

    Yaw is the track over ground, pitch the flight-path angle, roll the bank of a coordinated
    turn, atan(V·(track rate)/g). No angle of attack or sideslip is known, so none is used. Where a
    wind is given, all three are those of the velocity through the air.

    Parameters
    ----------
    time_s : ndarray, shape (n,)
        Strictly increasing.
    lat_deg, lon_deg, alt_m : ndarray, shape (n,) or (n, aircraft)
        The path of one aircraft, or those of several that have the same times.
    velocity_enu_mps : tuple of three ndarray, optional
        Measured velocity (east, north, up). Yaw and pitch then come from it at the sample
        itself, and the track rate from a straight line fitted to it over the window. Without it
        a parabola is fitted to the positions.
    wind_east_north_mps : tuple of two float
        Where the air goes, the same everywhere.
    window_s : float
        Whole width of the smoothing window.

    Returns
    -------
    yaw_rad : ndarray
        Clockwise from true north in [0, 2 pi). While the aircraft is slower than 0.5 m/s the
        last yaw is held; before it first moves, its first one; 0 if it never moves.
    pitch_rad : ndarray
        Positive nose up, in (-pi/2, pi/2); 0 while slower than 0.5 m/s.
    roll_rad : ndarray
        Positive right wing down, in (-pi/2, pi/2); 0 while slower than 0.5 m/s.
    """
    if velocity_enu_mps is None:
        velocity, acceleration = fit_path(time_s, lat_deg, lon_deg, alt_m, window_s=window_s)
    else:
        velocity = velocity_enu_mps
        acceleration = _slope_of_velocity(time_s, lat_deg, lon_deg, velocity, window_s)
    v_east, v_north, v_up = velocity
    if wind_east_north_mps != (0.0, 0.0):
        v_east, v_north = v_east - wind_east_north_mps[0], v_north - wind_east_north_mps[1]
    speed = np.sqrt(v_east * v_east + v_north * v_north)
    moving = speed >= SLOWEST_TRACK_MPS
    across = v_north * acceleration[0] - v_east * acceleration[1]
    across = across / np.where(moving, speed, 1.0)
    yaw = wrap_heading_rad(_held(np.arctan2(v_east, v_north), moving))
    pitch = np.where(moving, np.arctan2(v_up, np.where(moving, speed, 1.0)), 0.0)
    roll = np.where(moving, np.arctan2(across, STANDARD_GRAVITY_MPS2), 0.0)
    return yaw, pitch, roll


def _slope_of_velocity(
    time_s: FloatArray, lat_deg: FloatArray, lon_deg: FloatArray, velocity: Vector, window_s: float
) -> Vector:
    """Fit a straight line to velocities, each turned into the sample's own frame; its slope."""
    east, north, _ = local_axes(lat_deg, lon_deg)
    x, y, z = (velocity[0] * e + velocity[1] * n for e, n in zip(east, north, strict=True))
    v_up = velocity[2]

    def change(i: slice, j: slice) -> Vector:
        return (
            _dot((x, y, z), j, east, i) - velocity[0][i],
            _dot((x, y, z), j, north, i) - velocity[1][i],
            v_up[j] - v_up[i],
        )

    return _fit(time_s, change, lat_deg.shape, degree=1, window_s=window_s)[0]


def _fit(
    time_s: FloatArray,
    difference: Callable[[slice, slice], Vector],
    shape: tuple[int, ...],
    degree: int,
    window_s: float,
) -> tuple[Vector, Vector]:
    """Fit a polynomial around each sample; returns first and second derivatives there.

    The loop runs over offsets within the window, each as one array operation over all samples:
    no running sums over the file, whose rounding would grow with its length.
    """
    n = len(time_s)
    half = 0.5 * window_s
    reach = 1
    while reach < n - 1 and np.any(time_s[reach + 1 :] - time_s[: -reach - 1] <= half + _EDGE_S):
        reach += 1
    step = -(-reach // _MOST_OFFSETS)
    offsets = sorted({1, *range(step, reach + 1, step)})
    time_s = time_s.reshape(n, *(1 for _ in shape[1:]))  # the same for all aircraft
    # Sums over the window of tau^0..tau^4, and of tau^0..tau^2 times each component.
    moments = [np.zeros_like(time_s) for _ in range(5)]
    moments[0] += 1.0
    sums = [[np.zeros(shape) for _ in range(3)] for _ in range(3)]
    for size in (k for k in offsets if k < n):
        ahead, behind = slice(0, n - size), slice(size, n)
        for i, j in ((ahead, behind), (behind, ahead)):
            tau = time_s[j] - time_s[i]
            weight = np.where((np.abs(tau) <= half + _EDGE_S) | (size == 1), 1.0, 0.0)
            components = difference(i, j)
            power = weight
            for order in range(5):
                moments[order][i] += power
                if order < 3:
                    for total, component in zip(sums[order], components, strict=True):
                        total[i] += power * component
                power = power * (tau / half)
    m0, m1, m2, m3, m4 = moments
    spread = m0 * m2 - m1 * m1
    straight = [_ratio(m0 * s1 - m1 * s0, spread) for s0, s1 in zip(sums[0], sums[1], strict=True)]
    zero = np.zeros(shape)
    if degree == 1:
        first, second = straight, [zero, zero, zero]
    else:
        det = m0 * (m2 * m4 - m3 * m3) - m1 * (m1 * m4 - m2 * m3) + m2 * (m1 * m3 - m2 * m2)
        curved = det > _POOREST_CONDITION * m0 * m2 * m4
        first, second = [], []
        for s0, s1, s2, line in zip(*sums, straight, strict=True):
            slope = -s0 * (m1 * m4 - m2 * m3) + s1 * (m0 * m4 - m2 * m2) - s2 * (m0 * m3 - m1 * m2)
            bend = s0 * (m1 * m3 - m2 * m2) - s1 * (m0 * m3 - m1 * m2) + s2 * spread
            first.append(np.where(curved, _ratio(slope, det), line))
            second.append(np.where(curved, 2.0 * _ratio(bend, det), 0.0))
    return (
        (first[0] / half, first[1] / half, first[2] / half),
        (second[0] / half**2, second[1] / half**2, second[2] / half**2),
    )


def _dot(a: Vector, j: slice, b: Vector, i: slice) -> FloatArray:
    return a[0][j] * b[0][i] + a[1][j] * b[1][i] + a[2][j] * b[2][i]


def _ratio(numerator: FloatArray, denominator: FloatArray) -> FloatArray:
    """Divide, giving 0 where there is nothing to divide by (a single sample)."""
    usable = denominator > 0.0
    return np.where(usable, numerator / np.where(usable, denominator, 1.0), 0.0)


def _held(yaw: FloatArray, moving: np.ndarray) -> FloatArray:
    """Carry the last yaw of a moving sample over those that stand still."""
    if moving.all():
        return yaw
    place = np.arange(len(yaw)).reshape(len(yaw), *(1 for _ in yaw.shape[1:]))
    last = np.maximum.accumulate(np.where(moving, place, -1), axis=0)
    held = np.where(last >= 0, last, np.argmax(moving, axis=0))
    return np.where(moving.any(axis=0), np.take_along_axis(yaw, held, axis=0), 0.0)
