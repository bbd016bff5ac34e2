"""Attitude that follows from a path, over the ground and in wind."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from components.arguments.units import STANDARD_GRAVITY_M_S2
from components.flights.fleet import CELLS_AT_ONCE
from components.geometry import Vector, east_north_up_axes, radii_of_curvature, wrap_heading_rad
from dsa_des.arrays.types import FloatArray

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


def fit_velocity_and_acceleration(
    time_s: FloatArray,
    lat_deg: FloatArray,
    lon_deg: FloatArray,
    alt_m: FloatArray,
    *,
    window_s: float = WINDOW_S,
    offsets: Sequence[int] | None = None,
) -> tuple[Vector, Vector]:
    """Return velocity (m/s) and acceleration (m/s²) of a parabola fitted around each sample.

    Both are east, north and up in the sample's own frame, of one aircraft (n,) or of several that
    have the same times (n, aircraft). Samples within half of the window, and always the two
    neighbours, have equal weight; where there are fewer than three, or too clumped ones, a straight
    line is fitted. Of a block of a path, `offsets` are those of the whole
    (`overlapping_path_blocks`).
    """
    east, north, up = east_north_up_axes(lat_deg, lon_deg)
    meridian, prime_vertical = radii_of_curvature(lat_deg)

    def displacement(i: slice, j: slice) -> Vector:
        return (
            _dot(up, j, east, i) * (prime_vertical[i] + alt_m[i]),
            _dot(up, j, north, i) * (meridian[i] + alt_m[i]),
            alt_m[j] - alt_m[i],
        )

    # The reference sample is at the origin by definition, so only displacements are summed.
    offsets = _neighbour_offsets(time_s, window_s) if offsets is None else offsets
    return _fit_derivatives(
        time_s, displacement, lat_deg.shape, offsets, degree=2, window_s=window_s
    )


def overlapping_path_blocks(
    time_s: FloatArray,
) -> Iterator[tuple[slice, slice, slice, Sequence[int]]]:
    """Yield blocks of a path as (slice with neighbours, the block within that slice, the block
    within the path, offsets for `fit_velocity_and_acceleration`).

    Each is a block with its neighbours on either side, which rows of that are its own, which these
    are of the path, and the offsets of `fit_velocity_and_acceleration`.
    """
    offsets = _neighbour_offsets(time_s, WINDOW_S)
    reach, count = offsets[-1], len(time_s)
    for first in range(0, count, CELLS_AT_ONCE):
        end, start = min(first + CELLS_AT_ONCE, count), max(first - reach, 0)
        inner = slice(first - start, end - start)
        yield slice(start, end + reach), inner, slice(first, end), offsets


def _neighbour_offsets(time_s: FloatArray, window_s: float) -> Sequence[int]:
    """Return how many samples away (1, 2, ...) the neighbours used in a fit around a sample are."""
    within_s, reach = 0.5 * window_s + _EDGE_S, 1
    while reach < len(time_s) - 1 and np.any(
        time_s[reach + 1 :] - time_s[: -reach - 1] <= within_s
    ):
        reach += 1
    step = -(-reach // _MOST_OFFSETS)
    return sorted({1, *range(step, reach + 1, step)})


def attitude_from_path(
    time_s: FloatArray,
    lat_deg: FloatArray,
    lon_deg: FloatArray,
    alt_m: FloatArray,
    *,
    velocity_enu_mps: Vector | None = None,
    wind_east_north_mps: tuple[float, float] = (0.0, 0.0),
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return yaw, pitch and roll (rad) at each sample of a path (n,) or of several (n, aircraft).

    Yaw and pitch are those of the velocity, measured or fitted to the positions, through the air;
    the roll is the bank of a coordinated turn. Slower than 0.5 m/s the last yaw is held, and pitch
    and roll are 0.
    """
    yaw, pitch, roll = (np.empty(lat_deg.shape) for _ in range(3))
    moving = np.empty(lat_deg.shape, dtype=bool)
    for part, inner, rows, offsets in overlapping_path_blocks(time_s):
        times, lat, lon = time_s[part], lat_deg[part], lon_deg[part]
        if velocity_enu_mps is None:
            velocity, acceleration = fit_velocity_and_acceleration(
                times, lat, lon, alt_m[part], offsets=offsets
            )
        else:
            east, north, up = (along[part] for along in velocity_enu_mps)
            velocity = east, north, up
            acceleration = _fit_acceleration(times, lat, lon, velocity, offsets)
        v_east, v_north, v_up = velocity
        if wind_east_north_mps != (0.0, 0.0):
            v_east, v_north = v_east - wind_east_north_mps[0], v_north - wind_east_north_mps[1]
        speed = np.sqrt(v_east * v_east + v_north * v_north)
        moves = speed >= SLOWEST_TRACK_MPS
        across = v_north * acceleration[0] - v_east * acceleration[1]
        across = across / np.where(moves, speed, 1.0)
        moving[rows], yaw[rows] = moves[inner], wrap_heading_rad(np.arctan2(v_east, v_north))[inner]
        climb = np.arctan2(v_up, np.where(moves, speed, 1.0))
        pitch[rows] = np.where(moves, climb, 0.0)[inner]
        roll[rows] = np.where(moves, np.arctan2(across, STANDARD_GRAVITY_M_S2), 0.0)[inner]
    return _fill_yaw_where_still(yaw, moving), pitch, roll


def _fit_acceleration(
    time_s: FloatArray, lat_deg: FloatArray, lon_deg: FloatArray, velocity: Vector,
    offsets: Sequence[int],
) -> Vector:  # fmt: skip
    """Return accelerations (m/s²) from lines fitted to nearby velocities, in samples' frames."""
    east, north, _ = east_north_up_axes(lat_deg, lon_deg)
    x, y, z = (velocity[0] * e + velocity[1] * n for e, n in zip(east, north, strict=True))
    v_up = velocity[2]

    def change(i: slice, j: slice) -> Vector:
        return (
            _dot((x, y, z), j, east, i) - velocity[0][i],
            _dot((x, y, z), j, north, i) - velocity[1][i],
            v_up[j] - v_up[i],
        )

    return _fit_derivatives(time_s, change, lat_deg.shape, offsets, degree=1)[0]


def _fit_derivatives(
    time_s: FloatArray,
    difference: Callable[[slice, slice], Vector],
    shape: tuple[int, ...],
    offsets: Sequence[int],
    degree: int,
    window_s: float = WINDOW_S,
) -> tuple[Vector, Vector]:
    """Fit a polynomial around each sample and return its first and its second derivatives there.

    The loop runs over offsets within the window, each as one array operation over all samples:
    no running sums over the file, whose rounding would grow with its length.
    """
    n = len(time_s)
    half = 0.5 * window_s
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
    straight = [
        _ratio_or_zero(m0 * s1 - m1 * s0, spread) for s0, s1 in zip(sums[0], sums[1], strict=True)
    ]
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
            first.append(np.where(curved, _ratio_or_zero(slope, det), line))
            second.append(np.where(curved, 2.0 * _ratio_or_zero(bend, det), 0.0))
    return (
        (first[0] / half, first[1] / half, first[2] / half),
        (second[0] / half**2, second[1] / half**2, second[2] / half**2),
    )


def _dot(a: Vector, j: slice, b: Vector, i: slice) -> FloatArray:
    return a[0][j] * b[0][i] + a[1][j] * b[1][i] + a[2][j] * b[2][i]


def _ratio_or_zero(numerator: FloatArray, denominator: FloatArray) -> FloatArray:
    """Return numerator / denominator, and 0 where the denominator is not above 0."""
    usable = denominator > 0.0
    return np.where(usable, numerator / np.where(usable, denominator, 1.0), 0.0)


def _fill_yaw_where_still(yaw: FloatArray, moving: np.ndarray) -> FloatArray:
    """Return yaws; still samples take that of the last moving one before, or else of the first."""
    if moving.all():
        return yaw
    index = np.arange(len(yaw)).reshape(len(yaw), *(1 for _ in yaw.shape[1:]))
    last = np.maximum.accumulate(np.where(moving, index, -1), axis=0)
    held = np.where(last >= 0, last, np.argmax(moving, axis=0))
    return np.where(moving.any(axis=0), np.take_along_axis(yaw, held, axis=0), 0.0)


@dataclass(frozen=True)
class Wind:
    """A wind that is the same everywhere and always: the air's velocity east and north."""

    east_mps: float
    north_mps: float

    @classmethod
    def from_direction(cls, speed_mps: float, from_deg: float) -> Wind:
        """Return the wind of a speed that blows *from* a direction, as meteorologists say it."""
        turn = math.radians(from_deg)
        return cls(-speed_mps * math.sin(turn), -speed_mps * math.cos(turn))

    @property
    def speed_mps(self) -> float:
        """Return the wind's speed."""
        return math.hypot(self.east_mps, self.north_mps)


def scene_wind(weather: Any) -> Wind | None:
    """Return the wind of ``[weather]``, or None where there is none."""
    if weather is None or weather.wind_mps == 0.0:
        return None
    return Wind.from_direction(weather.wind_mps, weather.wind_from_deg)


def heading_and_airspeed(
    track_rad: FloatArray, ground_speed_mps: FloatArray, wind: Wind
) -> tuple[FloatArray, FloatArray]:
    """Return the heading (rad) and horizontal airspeed (m/s) for a track and speed in a wind.

    The velocity through the air is that over the ground less the wind; below 0.5 m/s of either,
    which point nowhere, the heading is the track.
    """
    east = ground_speed_mps * np.sin(track_rad) - wind.east_mps
    north = ground_speed_mps * np.cos(track_rad) - wind.north_mps
    airspeed = np.hypot(east, north)
    flown = (airspeed >= SLOWEST_TRACK_MPS) & (ground_speed_mps >= SLOWEST_TRACK_MPS)
    return np.where(flown, wrap_heading_rad(np.arctan2(east, north)), track_rad), airspeed


def ground_speed_mps(track_rad: float, airspeed_mps: float, wind: Wind) -> float:
    """Return the ground speed (m/s) along a track at a given airspeed, by the wind triangle.

    tail + sqrt(airspeed² - cross²), with the wind's parts along and across the track.
    """
    tail = wind.east_mps * math.sin(track_rad) + wind.north_mps * math.cos(track_rad)
    cross = wind.east_mps * math.cos(track_rad) - wind.north_mps * math.sin(track_rad)
    if abs(cross) > airspeed_mps:
        raise ValueError(
            f"airspeed_mps is {airspeed_mps:g}: it must be at least the wind across the track, "
            f"{abs(cross):.4g} m/s, or no heading keeps it"
        )
    speed = tail + math.sqrt((airspeed_mps - cross) * (airspeed_mps + cross))
    if speed <= 0.0:
        raise ValueError(
            f"airspeed_mps is {airspeed_mps:g}: it must be more than that, for the wind of "
            f"{wind.speed_mps:.4g} m/s against the track stops it ({speed:.4g} m/s over the ground)"
        )
    return speed


def attitude_in_wind(
    track_rad: FloatArray,
    pitch_rad: FloatArray,
    roll_rad: FloatArray,
    ground_speed: FloatArray,
    wind: Wind,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return yaw, pitch and roll (rad) in wind, from an attitude derived from the ground path.

    That is heading, climb over the airspeed, and the bank for the part of the turn's acceleration
    that is across the nose. Where the ground speed (m/s) is NaN the attitude stays as it is.
    """
    known = np.isfinite(ground_speed)
    speed = np.where(known, ground_speed, 0.0)
    heading, airspeed = heading_and_airspeed(track_rad, speed, wind)
    flown = known & (speed >= SLOWEST_TRACK_MPS) & (airspeed >= SLOWEST_TRACK_MPS)
    climb = np.tan(pitch_rad) * speed
    pitch = np.where(flown, np.arctan2(climb, airspeed), pitch_rad)
    across = np.cos(heading - track_rad)
    roll = np.where(flown, np.arctan(np.tan(roll_rad) * across), roll_rad)
    return np.where(flown, heading, track_rad), pitch, roll
