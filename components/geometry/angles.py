"""Sines in degrees, arc tangents and differences of longitudes, without losing digits."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from components.arguments.checks import FloatArray, common_shape, shaped, squarable

RAD_PER_DEG = np.pi / 180.0

# No offset in metres between two aircraft squares to less than this, unless it is 0.
_SHORTEST_RUN = 1e-200

# With so many angles it pays to look whether they are all the same.
_LOOK_FOR_ONE_ANGLE = 64

# Below this size 360·n and longitude - 360·n are exact in doubles; above it fmod does the work.
_LARGE_LONGITUDE_DEG = 1e12


def sine_and_cosine(angle_rad: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Take sine and cosine; once, where all angles are the same.

    Parameters
    ----------
    angle_rad : ndarray
        Contiguous, at least one axis. Pitch and roll are the same in level flight, for example.

    Returns
    -------
    sine, cosine : ndarray
        The angle's shape, or (1,) in its place where they are all the same.
    """
    if angle_rad.size > _LOOK_FOR_ONE_ANGLE and angle_rad.min() == angle_rad.max():
        angle_rad = angle_rad.reshape(-1)[:1]
    return np.sin(angle_rad), np.cos(angle_rad)


def slope_angle(rise: FloatArray, run: FloatArray) -> FloatArray:
    """Give arctan2(rise, run) for a run of 0 or more; 0 where both are 0.

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
    """Give arctan2(across, along), 0 where both are 0.

    Parameters
    ----------
    across, along : ndarray
        Contiguous, of one shape, any unit; `along` is 0 or at least 1e-200 in size, `across`
        below 1e100.

    Returns
    -------
    ndarray
        Radians in [-pi, pi], within 4e-16; in 0.6 of the time of arctan2.
    """
    ahead = slope_angle(across, np.abs(along))
    behind = np.copysign(np.pi, across)
    behind -= ahead
    np.copyto(ahead, behind, where=along < 0.0)
    return ahead


def longitude_difference_deg(
    lon1_deg: npt.ArrayLike, lon2_deg: npt.ArrayLike
) -> tuple[FloatArray, FloatArray]:
    """Find lon2 - lon1 in degrees, wrapped and without any rounding error.

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

    Raises
    ------
    ValueError
        NaN or infinity.

    Notes
    -----
    Knuth's two-sum gives lon2 - lon1 and its rounding error; taking off whole turns is exact.
    The idea is that of `AngDiff` in GeographicLib (C. F. F. Karney, "Algorithms for geodesics",
    Journal of Geodesy 87, 2013).
    """
    lon1, lon2 = squarable("lon1_deg", lon1_deg), squarable("lon2_deg", lon2_deg)
    shape = common_shape(lon1_deg=lon1, lon2_deg=lon2)
    difference, error = _longitude_difference(np.atleast_1d(lon1), np.atleast_1d(lon2))
    difference, error = shaped(shape, difference, error)
    return difference, error


def longitude_difference_rounded(lon1: FloatArray, lon2: FloatArray) -> FloatArray:
    """Give the double nearest to lon2 - lon1 in [-180, 180), for checked arrays of one axis up."""
    total, low = _two_difference(lon1, lon2)
    # The two-sum is exact for any size; only whole turns of an absurd total are not.
    if total.size and max(total.max(), -total.min()) > _LARGE_LONGITUDE_DEG:
        total, low = _two_difference(_reduced(lon1), _reduced(lon2))
    return _add_wrapped(total, low)[0]


def _longitude_difference(lon1: FloatArray, lon2: FloatArray) -> tuple[FloatArray, FloatArray]:
    turn, low = _two_difference(_reduced(lon1), _reduced(lon2))
    difference, rest = _add_wrapped(turn, low)
    # |rest| >= |low| or rest = 0, so this fast two-sum leaves the exact error.
    unwrapped = rest + low
    return difference, low - (unwrapped - rest)


def _reduced(lon: FloatArray) -> FloatArray:
    """Take whole turns off absurdly large longitudes, exactly, and leave all others alone."""
    if lon.size == 0 or max(lon.max(), -lon.min()) <= _LARGE_LONGITUDE_DEG:
        return lon
    return np.where(np.abs(lon) > _LARGE_LONGITUDE_DEG, np.fmod(lon, 360.0), lon)


def _two_difference(lon1: FloatArray, lon2: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Knuth's two-sum of lon2 and -lon1: the rounded sum and what rounding left out."""
    total = lon2 - lon1
    part1 = total - lon2
    part2 = total - part1
    part2 = lon2 - part2
    part1 += lon1
    part2 -= part1
    return total, part2


def _add_wrapped(total: FloatArray, low: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Wrap total + low; returns the wrapped double and total less its whole turns."""
    rest = total - 360.0 * np.rint(total * (1.0 / 360.0))
    difference = rest + low
    over = (difference >= 180.0) | (difference < -180.0)
    if np.count_nonzero(over):
        difference = np.where(
            over, difference - np.where(difference > 0.0, 360.0, -360.0), difference
        )
    return difference, rest
