"""Angles and normals of the ellipsoid: wrapping, degrees and longitudes without losing digits."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from components.arguments.checks import broadcast_results, check_squarable, common_shape
from dsa_des.arrays.column_values import first_row_if_stored_once
from dsa_des.arrays.types import FloatArray

Vector = tuple[FloatArray, FloatArray, FloatArray]

DEG_PER_RAD = 180.0 / np.pi
RAD_PER_DEG = np.pi / 180.0


def east_north_up_axes(lat_deg: FloatArray, lon_deg: FloatArray) -> tuple[Vector, Vector, Vector]:
    """Return the unit vectors east, north and up at a position (degrees), in Earth-centred axes.

    Each is its (x, y, z) components; up is the ellipsoid normal.
    """
    lat, lon = lat_deg * RAD_PER_DEG, lon_deg * RAD_PER_DEG
    sin_lat, cos_lat, sin_lon, cos_lon = np.sin(lat), np.cos(lat), np.sin(lon), np.cos(lon)
    east = (-sin_lon, cos_lon, np.zeros_like(sin_lon))
    north = (-sin_lat * cos_lon, -sin_lat * sin_lon, cos_lat)
    up = (cos_lat * cos_lon, cos_lat * sin_lon, sin_lat)
    return east, north, up


def normal_to_degrees(x: FloatArray, y: FloatArray, z: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return latitude, longitude (deg) of an ellipsoid normal, a vector of any length.

    Parameters
    ----------
    x, y, z : ndarray
        Components, one shape; only the direction counts. The null vector gives 0, 0.

    Returns
    -------
    lat_deg, lon_deg : ndarray
        Longitude in [-180, 180).
    """
    lat = np.arctan2(z, np.sqrt(x * x + y * y))
    lat *= DEG_PER_RAD
    lon = np.arctan2(y, x)
    lon *= DEG_PER_RAD
    # pi in degrees is exactly 180, which belongs to the other end of the interval.
    return lat, np.where(lon >= 180.0, -180.0, lon)


TWO_PI = 2.0 * np.pi
# What the double nearest to 2 pi leaves out of it (6.28318530717958647692528676655900577).
_TWO_PI_REST = 2.4492935982947064e-16


def wrap_pi(angle_rad: npt.ArrayLike) -> FloatArray:
    """Wrap angles into (-pi, pi]; an angle already there keeps its bits.

    Parameters
    ----------
    angle_rad : array_like
        Any shape, radians.

    Returns
    -------
    ndarray
        The same shape, radians, reduced by the true 2 pi (not the double nearest to it), so that
        many turns lose nothing beyond what the input itself had lost.
    """
    angle = check_squarable("angle_rad", angle_rad)
    (wrapped,) = broadcast_results(angle.shape, wrap_pi_unchecked(np.atleast_1d(angle)))
    return wrapped


def wrap_pi_unchecked(angle: FloatArray) -> FloatArray:
    """Return angles wrapped into (-pi, pi], unchecked: for a contiguous array of finite values."""
    result = angle + 0.0
    if angle.min(initial=0.0) > -np.pi and angle.max(initial=0.0) <= np.pi:
        return result
    size = np.abs(angle)
    outside = (size > np.pi) | (angle == -np.pi)
    # Within three half turns the first difference is exact, and the second brings the true 2 pi.
    once = angle - np.copysign(TWO_PI, angle)
    once -= np.copysign(_TWO_PI_REST, angle)
    far = size > 3.0 * np.pi
    if np.count_nonzero(far):
        once[far] = wrap_by_sines(angle[far])
    np.minimum(once, np.pi, out=once)
    once[once <= -np.pi] = np.pi
    once += 0.0
    np.copyto(result, once, where=outside)
    return result


def wrap_by_sines(angle: FloatArray) -> FloatArray:
    """Wrap angles into [-pi, pi] through their sines and cosines, whatever their size.

    The library's sine and cosine reduce by the true pi. An angle that is inside already may lose
    its last bit, which `wrap_pi` keeps.
    """
    wrapped: FloatArray = np.arctan2(np.sin(angle), np.cos(angle))
    return wrapped


def wrap_two_pi(angle_rad: npt.ArrayLike) -> FloatArray:
    """Wrap radians of any size into [0, 2 pi), as `wrap_pi` does; rounding never gives 2 pi."""
    angle = check_squarable("angle_rad", angle_rad)
    flat = np.atleast_1d(angle)
    inside = (flat >= 0.0) & (flat < TWO_PI)
    wrapped = np.where(inside, flat, wrap_negative_to_positive_rad(wrap_pi_unchecked(flat))) + 0.0
    (wrapped,) = broadcast_results(angle.shape, wrapped)
    return wrapped


def wrap_negative_to_positive_rad(angle: FloatArray) -> FloatArray:
    """Return angles in [-pi, pi], as arctan2 gives them, as angles in [0, 2 pi)."""
    below = angle < 0.0
    if not np.count_nonzero(below):
        return angle + 0.0
    turned: FloatArray = np.multiply(below, TWO_PI, dtype=np.float64)
    turned += angle
    # -1e-17 + 2 pi rounds to 2 pi; the nearest direction inside the interval is 0.
    if turned.max() >= TWO_PI:
        turned[turned >= TWO_PI] = 0.0
    return turned


def wrap_longitude_deg(lon_deg: FloatArray) -> FloatArray:
    """Wrap degrees into [-180, 180); a value already there keeps its bits."""
    if lon_deg.min(initial=0.0) >= -180.0 and lon_deg.max(initial=0.0) < 180.0:
        return lon_deg
    inside = (lon_deg >= -180.0) & (lon_deg < 180.0)
    wrapped = lon_deg - 360.0 * np.floor((lon_deg + 180.0) / 360.0)
    wrapped = np.where(inside, lon_deg, wrapped)
    return np.where((wrapped >= 180.0) | (wrapped < -180.0), -180.0, wrapped)


def wrap_difference_rad(angle: FloatArray) -> FloatArray:
    """Wrap radians into [-pi, pi], for differences of two angles a few turns apart at most."""
    return angle - TWO_PI * np.rint(angle * (1.0 / TWO_PI))


def wrap_heading_rad(angle: FloatArray) -> FloatArray:
    """Wrap radians into [0, 2 pi); a value already there keeps its bits."""
    if angle.min(initial=0.0) >= 0.0 and angle.max(initial=0.0) < TWO_PI:
        return angle
    inside = (angle >= 0.0) & (angle < TWO_PI)
    wrapped = angle - TWO_PI * np.floor(angle * (1.0 / TWO_PI))
    wrapped = np.where(inside, angle, wrapped)
    # A tiny negative angle plus 2 pi rounds to 2 pi; the direction meant is 0.
    return np.where((wrapped >= TWO_PI) | (wrapped < 0.0), 0.0, wrapped)


def remainder(angle: FloatArray, turn: float) -> FloatArray:
    """Return the remainder of angles by a turn, in [0, turn)."""
    rest = np.mod(angle, turn)
    return np.where(rest >= turn, 0.0, rest)


def heading_rad_from_deg(heading_deg: float) -> float:
    """Turn a heading in degrees, any number of turns, into radians in [0, 2 pi]."""
    return math.radians(heading_deg % 360.0)


# No offset in metres between two aircraft squares to less than this, unless it is 0.
_SHORTEST_RUN = 1e-200

# With so many angles it pays to look whether they are all the same.
_LOOK_FOR_ONE_ANGLE = 64

# A difference of this size has no turns to take off, whatever its rounding error.
_LESS_THAN_HALF_A_TURN_DEG = 179.0

# Below this size 360·n and longitude - 360·n are exact in doubles; above it fmod does the work.
_LARGE_LONGITUDE_DEG = 1e12


def sine_and_cosine(angle_rad: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return sine and cosine of angles, computed once where all are the same.

    Parameters
    ----------
    angle_rad : ndarray
        At least one axis. Pitch and roll are the same in level flight, for example.

    Returns
    -------
    sine, cosine : ndarray
        The angle's shape, one row of it where all rows are known to be the same, or (1,) in its
        place where all angles are.
    """
    angle_rad = first_row_if_stored_once(angle_rad)
    if angle_rad.size > _LOOK_FOR_ONE_ANGLE and angle_rad.min() == angle_rad.max():
        angle_rad = angle_rad.reshape(-1)[:1]
    return np.sin(angle_rad), np.cos(angle_rad)


def slope_angle(rise: FloatArray, run: FloatArray) -> FloatArray:
    """Return arctan2(rise, run) for a run of 0 or more; 0 where both are 0.

    Parameters
    ----------
    rise, run : ndarray
        Contiguous, of one shape, any unit; a run is 0 or at least 1e-200, a rise below 1e100.

    Returns
    -------
    ndarray
        Radians in [-pi/2, pi/2], within two units in the last place. Without the quadrants to look
        after it takes half of the time of arctan2.
    """
    slope: FloatArray = np.maximum(run, _SHORTEST_RUN)
    np.divide(rise, slope, out=slope)
    return np.arctan(slope, out=slope)


def direction_angle(across: FloatArray, along: FloatArray) -> FloatArray:
    """Return arctan2(across, along), 0 where both are 0: as `slope_angle`, for all four quadrants.

    Within 4e-16 rad, in [-pi, pi], in 0.6 of the time of arctan2; `along` is 0 or at least 1e-200
    in size.
    """
    ahead = slope_angle(across, np.abs(along))
    backward = along < 0.0
    if np.count_nonzero(backward):
        behind = np.copysign(np.pi, across)
        behind -= ahead
        np.copyto(ahead, behind, where=backward)
    return ahead


def longitude_difference_deg(
    lon1_deg: npt.ArrayLike, lon2_deg: npt.ArrayLike
) -> tuple[FloatArray, FloatArray]:
    """Return lon2 - lon1 (deg) wrapped into [-180, 180), and the rounding error left out of it.

    Parameters
    ----------
    lon1_deg, lon2_deg : array_like
        Degrees, any size (359.9 and 540 are fine), broadcast.

    Returns
    -------
    difference_deg : ndarray
        The double nearest to the exact difference, in [-180, 180).
    error_deg : ndarray
        What that rounding left out: modulo 360, `difference_deg + error_deg` is lon2 - lon1
        exactly. Below 1.5e-14 in size.

    Notes
    -----
    Knuth's two-sum gives lon2 - lon1 and its rounding error; taking off whole turns is exact.
    The idea is that of `AngDiff` in GeographicLib (C. F. F. Karney, "Algorithms for geodesics",
    Journal of Geodesy 87, 2013).
    """
    lon1, lon2 = check_squarable("lon1_deg", lon1_deg), check_squarable("lon2_deg", lon2_deg)
    shape = common_shape(lon1_deg=lon1, lon2_deg=lon2)
    difference, error = _longitude_difference(np.atleast_1d(lon1), np.atleast_1d(lon2))
    difference, error = broadcast_results(shape, difference, error)
    return difference, error


def longitude_difference_rounded(lon1: FloatArray, lon2: FloatArray) -> FloatArray:
    """Return the double nearest to lon2 - lon1 in [-180, 180), for checked arrays."""
    total, low = _two_difference(lon1, lon2)
    largest = max(total.max(initial=0.0), -total.min(initial=0.0))
    if largest < _LESS_THAN_HALF_A_TURN_DEG:
        total += low
        return total
    # The two-sum is exact for any size; only whole turns of an absurd total are not.
    if largest > _LARGE_LONGITUDE_DEG:
        total, low = _two_difference(_reduce_longitude(lon1), _reduce_longitude(lon2))
    return _wrap_sum(total, low)[0]


def _longitude_difference(lon1: FloatArray, lon2: FloatArray) -> tuple[FloatArray, FloatArray]:
    turn, low = _two_difference(_reduce_longitude(lon1), _reduce_longitude(lon2))
    difference, rest = _wrap_sum(turn, low)
    # |rest| >= |low| or rest = 0, so this fast two-sum leaves the exact error.
    unwrapped = rest + low
    return difference, low - (unwrapped - rest)


def _reduce_longitude(lon: FloatArray) -> FloatArray:
    """Return longitudes with whole turns removed from absurdly large ones, exactly."""
    if lon.size == 0 or max(lon.max(), -lon.min()) <= _LARGE_LONGITUDE_DEG:
        return lon
    return np.where(np.abs(lon) > _LARGE_LONGITUDE_DEG, np.fmod(lon, 360.0), lon)


def _two_difference(lon1: FloatArray, lon2: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return lon2 - lon1 as rounded, and the rounding error (Knuth's two-sum)."""
    total = lon2 - lon1
    part1 = total - lon2
    part2 = total - part1
    part2 = lon2 - part2
    part1 += lon1
    part2 -= part1
    return total, part2


def _wrap_sum(total: FloatArray, low: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return total + low wrapped to [-180, 180) degrees, and total less its nearest whole turns."""
    rest = total - 360.0 * np.rint(total * (1.0 / 360.0))
    difference = rest + low
    over = (difference >= 180.0) | (difference < -180.0)
    if np.count_nonzero(over):
        difference = np.where(
            over, difference - np.where(difference > 0.0, 360.0, -360.0), difference
        )
    return difference, rest
