"""Wrapping of angles: into a half turn either way, into one turn, and of longitudes.

Three forms of one idea, because what they keep differs: `wrap_pi` and `wrap_two_pi` reduce by the
true 2 pi and are right for angles of any size; `wrap_difference_rad` and `wrap_heading_rad` cost a
third and are for angles a few turns off at most; `past` is the remainder, for what is laid out
along a turn (a table's nodes, a sweep).
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from components.arguments.checks import FloatArray, shaped, squarable

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

    Raises
    ------
    ValueError
        NaN or infinity.
    """
    angle = squarable("angle_rad", angle_rad)
    (wrapped,) = shaped(angle.shape, wrap_pi_unchecked(np.atleast_1d(angle)))
    return wrapped


def wrap_pi_unchecked(angle: FloatArray) -> FloatArray:
    """`wrap_pi` for a contiguous array that is known to be finite."""
    result = angle + 0.0
    size = np.abs(angle)
    outside = (size > np.pi) | (angle == -np.pi)
    if np.count_nonzero(outside) == 0:
        return result
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
    """Wrap angles into [0, 2 pi); rounding never gives 2 pi itself.

    Parameters
    ----------
    angle_rad : array_like
        Any shape, radians.

    Returns
    -------
    ndarray
        The same shape, radians. An angle already there keeps its bits.

    Raises
    ------
    ValueError
        NaN or infinity.
    """
    angle = squarable("angle_rad", angle_rad)
    flat = np.atleast_1d(angle)
    inside = (flat >= 0.0) & (flat < TWO_PI)
    wrapped = np.where(inside, flat, positive_turn(wrap_pi_unchecked(flat))) + 0.0
    (wrapped,) = shaped(angle.shape, wrapped)
    return wrapped


def positive_turn(angle: FloatArray) -> FloatArray:
    """Move angles in [-pi, pi], as arctan2 gives them, to [0, 2 pi)."""
    turned: FloatArray = np.multiply(angle < 0.0, TWO_PI, dtype=np.float64)
    turned += angle
    # -1e-17 + 2 pi rounds to 2 pi; the nearest direction inside the interval is 0.
    turned[turned >= TWO_PI] = 0.0
    return turned


def wrap_longitude_deg(lon_deg: FloatArray) -> FloatArray:
    """Wrap degrees into [-180, 180); a value already there keeps its bits."""
    inside = (lon_deg >= -180.0) & (lon_deg < 180.0)
    if inside.all():
        return lon_deg
    wrapped = lon_deg - 360.0 * np.floor((lon_deg + 180.0) / 360.0)
    wrapped = np.where(inside, lon_deg, wrapped)
    return np.where(wrapped >= 180.0, -180.0, np.where(wrapped < -180.0, -180.0, wrapped))


def wrap_difference_rad(angle: FloatArray) -> FloatArray:
    """Wrap radians into [-pi, pi], for differences of two angles a few turns apart at most."""
    return angle - TWO_PI * np.rint(angle * (1.0 / TWO_PI))


def wrap_heading_rad(angle: FloatArray) -> FloatArray:
    """Wrap radians into [0, 2 pi); a value already there keeps its bits."""
    inside = (angle >= 0.0) & (angle < TWO_PI)
    if inside.all():
        return angle
    wrapped = angle - TWO_PI * np.floor(angle * (1.0 / TWO_PI))
    wrapped = np.where(inside, angle, wrapped)
    # A tiny negative angle plus 2 pi rounds to 2 pi; the direction meant is 0.
    return np.where((wrapped >= TWO_PI) | (wrapped < 0.0), 0.0, wrapped)


def past(angle: FloatArray, turn: float) -> FloatArray:
    """Give the remainder of angles by a turn, in [0, turn).

    Parameters
    ----------
    angle : ndarray
        In the unit of `turn`.
    turn : float
        2 pi or 360.

    Returns
    -------
    ndarray
        0 where the remainder rounds up to the turn itself, as that of -1e-20 does.
    """
    rest = np.mod(angle, turn)
    return np.where(rest >= turn, 0.0, rest)


def heading_from_deg(heading_deg: float) -> float:
    """Turn a heading in degrees, any number of turns, into radians in [0, 2 pi]."""
    return math.radians(heading_deg % 360.0)
