"""What samples of a flight may be, and its segments: cubics of position, lines of attitude."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from components.geometry import (
    SEMI_MAJOR_AXIS_M,
    TrajectoryState,
    Vector,
    east_north_up_axes,
    normal_to_degrees,
    radii_of_curvature,
    wrap_difference_rad,
    wrap_heading_rad,
    wrap_longitude_deg,
)
from dsa_des.arrays.types import FloatArray

RAD_PER_DEG = np.pi / 180.0

MOST_ACCELERATION_MPS2 = 20.0
MISFIT_MPS = 0.5
MISFIT_MPS2 = 1.0
"""Measured velocities bend the path of a segment of duration dt only if the mean of the two lies
within 0.5 m/s + 1 m/s²·dt of the segment's mean velocity (at constant acceleration they are
equal) and the two differ by less than 20 m/s²·dt + 1 m/s. Real files hold worse, and a wrong
velocity would bend a path that a straight line leaves good."""

# Rows of the coefficient table: position and attitude at the sample, how they change, and, where
# any segment is bent, terms of second and third order of the normal's x, y and z and of altitude.
_LAT, _LON, _YAW, _YAW_RATE, _TURN_WITH_LON = 0, 1, 2, 3, 4
_PITCH, _PITCH_RATE, _ROLL, _ROLL_RATE = 5, 6, 7, 8
_START, _SLOPE, _SECOND, _THIRD = 9, 13, 17, 21
STRAIGHT_ROWS, BENT_ROWS = 17, 25
#: Where samples stand: latitude, longitude (deg), altitude (m); yaw, pitch and roll (rad).
POSITION_ROWS, ATTITUDE_ROWS = (_LAT, _LON, _START + 3), (_YAW, _PITCH, _ROLL)


#: Times, longitudes and angles beyond this carry no useful digits any more.
_LARGEST = 1e12
_LIMITS = {
    "lat_deg": (90.0, "it must lie in [-90, 90] degrees"),
    "lon_deg": (1e6, "it must lie within ±1e6 degrees"),
    "alt_m": (1e6, "it must lie within ±1e6 metres"),
    "yaw_rad": (1e6, "it must lie within ±1e6 radians"),
    "pitch_rad": (np.pi / 2, "it must lie in [-pi/2, pi/2] radians"),
    "roll_rad": (1e6, "it must lie within ±1e6 radians"),
}


def checked_samples(name: str, **columns: npt.ArrayLike | None) -> dict[str, FloatArray]:
    """Return the given columns as contiguous float arrays, without copying read-only ones;
    ValueError for a bad shape, length, value or order of time.
    """
    checked: dict[str, FloatArray] = {}
    for column, values in columns.items():
        if values is None:
            continue
        array = np.asarray(values, dtype=np.float64, order="C")
        if array is values and array.flags.writeable:
            array = array.copy()
        if array.ndim != 1 or len(array) == 0:
            raise ValueError(
                f"{name}: {column} has shape {array.shape}: it must have one axis and at least "
                "one sample"
            )
        limit, allowed = _LIMITS.get(column, (_LARGEST, f"it must be finite, within ±{_LARGEST:g}"))
        bad = ~(np.abs(array) <= limit)
        if bad.any():
            first = int(np.argmax(bad))
            raise ValueError(f"{name}: {column} is {array[first]} (sample {first}): {allowed}")
        checked[column] = array
        if len(array) != len(checked["time_s"]):
            raise ValueError(
                f"{name}: {column} has {len(array)} samples: time_s has {len(checked['time_s'])}"
            )
    late = np.diff(checked["time_s"]) <= 0.0
    if late.any():
        first = int(np.argmax(late)) + 1
        raise ValueError(
            f"{name}: time_s is {checked['time_s'][first]} at sample {first}, after "
            f"{checked['time_s'][first - 1]}: times must strictly increase"
        )
    return checked


def all_within_limits(columns: Mapping[str, FloatArray]) -> bool:
    """Return whether all values of all columns are within the limits of `checked_samples`."""
    return all(bool((np.abs(array) <= _LIMITS[name][0]).all()) for name, array in columns.items())


def fit_segments(
    time_s: FloatArray,
    position: tuple[FloatArray, FloatArray, FloatArray],
    attitude_rad: tuple[FloatArray, FloatArray, FloatArray],
    velocity_enu_mps: Vector | None = None,
) -> FloatArray:
    """Return segments' polynomial coefficients, (rows, n), or (rows, n, aircraft) at common times.

    The last sample is a segment of its own; positions are latitude, longitude (deg), altitude (m).
    Without velocities all are straight, and there are `STRAIGHT_ROWS`, else `BENT_ROWS`.
    """
    lat_deg, lon_deg, alt_m = position
    yaw_rad, pitch_rad, roll_rad = attitude_rad
    rows = STRAIGHT_ROWS if velocity_enu_mps is None else BENT_ROWS
    table = np.zeros((rows, *lat_deg.shape))
    _, _, normal = east_north_up_axes(lat_deg, lon_deg)
    start = (*normal, alt_m)
    table[_LAT], table[_LON] = lat_deg, lon_deg
    table[_YAW], table[_PITCH], table[_ROLL] = attitude_rad
    duration = np.diff(time_s).reshape(-1, *(1 for _ in lat_deg.shape[1:]))
    tangents = None
    if velocity_enu_mps is not None:
        tangents = _normal_and_altitude_rates(lat_deg, lon_deg, alt_m, velocity_enu_mps)
    bent = None if tangents is None else _cubic_segment_mask(start, tangents, duration)
    for row, value in enumerate(start):
        table[_START + row] = value
        slope = np.diff(value, axis=0) / duration
        table[_SLOPE + row, :-1] = slope + 0.0  # a zero of either sign is a plain one
        if tangents is not None and bent is not None:
            m0, m1 = tangents[row][:-1], tangents[row][1:]
            table[_SLOPE + row, :-1] = np.where(bent, m0, slope)
            second = (3.0 * slope - 2.0 * m0 - m1) / duration
            third = (m0 + m1 - 2.0 * slope) / (duration * duration)
            table[_SECOND + row, :-1] = np.where(bent, second, 0.0)
            table[_THIRD + row, :-1] = np.where(bent, third, 0.0)
    # Near a pole yaw turns with longitude, by a whole turn for a whole turn, so that it is
    # yaw minus longitude (plus, in the south) that changes slowly and can be interpolated.
    turn = np.where(np.abs(lat_deg) > 60.0, np.sign(lat_deg), 0.0)
    lon_change = wrap_longitude_deg(np.diff(lon_deg, axis=0)) * RAD_PER_DEG
    yaw_change = wrap_difference_rad(np.diff(yaw_rad, axis=0) - turn[:-1] * lon_change)
    table[_YAW_RATE, :-1] = yaw_change / duration
    table[_TURN_WITH_LON] = turn * RAD_PER_DEG
    table[_PITCH_RATE, :-1] = np.diff(pitch_rad, axis=0) / duration
    table[_ROLL_RATE, :-1] = wrap_difference_rad(np.diff(roll_rad, axis=0)) / duration
    return table


def _normal_and_altitude_rates(
    lat_deg: FloatArray, lon_deg: FloatArray, alt_m: FloatArray, velocity_enu_mps: Vector
) -> tuple[FloatArray, ...]:
    """Return the rates of the normal's components (1/s) and altitude (m/s) for velocities."""
    east, north, _ = east_north_up_axes(lat_deg, lon_deg)
    meridian, prime_vertical = radii_of_curvature(lat_deg)
    v_east, v_north, v_up = velocity_enu_mps
    turn_east = v_east / (prime_vertical + alt_m)
    turn_north = v_north / (meridian + alt_m)
    rates = (turn_east * e + turn_north * n for e, n in zip(east, north, strict=True))
    return (*rates, v_up)


def _cubic_segment_mask(
    start: tuple[FloatArray, ...], tangents: tuple[FloatArray, ...], duration: FloatArray
) -> npt.NDArray[np.bool_]:
    """Return a mask over segments, True where both ends' velocities fit the mean between them."""
    misfit, change = np.zeros_like(duration), np.zeros_like(duration)
    for row, (value, tangent) in enumerate(zip(start, tangents, strict=True)):
        to_metres = 1.0 if row == 3 else SEMI_MAJOR_AXIS_M
        mean = 0.5 * (tangent[1:] + tangent[:-1])
        misfit = misfit + (to_metres * (np.diff(value, axis=0) / duration - mean)) ** 2
        change = change + (to_metres * np.diff(tangent, axis=0)) ** 2
    fits = misfit <= (MISFIT_MPS + MISFIT_MPS2 * duration) ** 2
    return fits & (change <= (MOST_ACCELERATION_MPS2 * duration + 1.0) ** 2)


def segments_elapsed_and_presence(
    sample_times: FloatArray, times: FloatArray
) -> tuple[npt.NDArray[np.intp], FloatArray, npt.NDArray[np.bool_]]:
    """Return each time's segment index, time (s) since that began, and a mask (True in samples).

    Times outside are moved to the nearest sample.
    """
    present = (times >= sample_times[0]) & (times <= sample_times[-1])
    inside = np.where(times > sample_times[0], times, sample_times[0])
    inside = np.where(inside < sample_times[-1], inside, sample_times[-1])
    segment = np.searchsorted(sample_times, inside, side="right") - 1
    return segment, inside - sample_times[segment], present


def evaluate_segments(
    table: FloatArray, elapsed: FloatArray, present: npt.NDArray[np.bool_]
) -> TrajectoryState:
    """Return states of segments, with coefficients column by column, each after its time (s)."""

    def at(part: int) -> FloatArray:
        slope = table[_SLOPE + part]
        if len(table) > STRAIGHT_ROWS:
            slope = (table[_THIRD + part] * elapsed + table[_SECOND + part]) * elapsed + slope
        return np.asarray(slope * elapsed + table[_START + part])

    lat, lon, alt = table[_LAT], table[_LON], at(3)
    between = elapsed != 0.0
    if between.any():
        lat, lon = (
            np.where(between, moved, sample)
            for moved, sample in zip(normal_to_degrees(*map(at, range(3))), (lat, lon), strict=True)
        )
    yaw = table[_YAW] + table[_YAW_RATE] * elapsed
    yaw += table[_TURN_WITH_LON] * wrap_longitude_deg(lon - table[_LON])
    pitch = table[_PITCH] + table[_PITCH_RATE] * elapsed
    roll = table[_ROLL] + table[_ROLL_RATE] * elapsed
    return TrajectoryState(lat, lon, alt, wrap_heading_rad(yaw), pitch, roll, present)
