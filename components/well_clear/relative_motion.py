"""The horizontal geometry of two straight flights: products, discriminant, times on a circle."""

from typing import NamedTuple

import numpy as np

from dsa_des.arrays.types import FloatArray


class Horizontal(NamedTuple):
    """Products of the relative position s and the relative velocity v, arrays of one shape.

    Parameters
    ----------
    range_sq_m2 : ndarray
        s·s.
    closing_m2_s : ndarray
        s·v, negative while the aircraft come closer.
    speed_sq_m2_s2 : ndarray
        v·v.
    cross_m2_s : ndarray
        East times north rate less north times east rate: miss distance times speed.
    """

    range_sq_m2: FloatArray
    closing_m2_s: FloatArray
    speed_sq_m2_s2: FloatArray
    cross_m2_s: FloatArray


def horizontal_of(
    east_m: FloatArray, north_m: FloatArray, east_mps: FloatArray, north_mps: FloatArray
) -> Horizontal:
    """Return the products of relative position and velocity, east and north."""
    return Horizontal(
        east_m * east_m + north_m * north_m,
        east_m * east_mps + north_m * north_mps,
        east_mps * east_mps + north_mps * north_mps,
        east_m * north_mps - north_m * east_mps,
    )


def time_to_closest_s(motion: Horizontal) -> FloatArray:
    """Return the time of the horizontal closest approach, negative if past; 0 without motion."""
    still = motion.speed_sq_m2_s2 == 0.0
    speed_sq = np.where(still, 1.0, motion.speed_sq_m2_s2)
    return np.asarray(np.where(still, 0.0, -motion.closing_m2_s / speed_sq))


def discriminant(motion: Horizontal, radius_m: float | FloatArray) -> FloatArray:
    """Return (radius · speed)² − cross², not negative where the line of flight meets the circle.

    As a product of sum and difference, so that a grazing flight is as exact as its radius.
    """
    reach = radius_m * np.sqrt(motion.speed_sq_m2_s2)
    cross = np.abs(motion.cross_m2_s)
    return np.asarray((reach - cross) * (reach + cross))


def entry_of_circle_s(
    motion: Horizontal, radius_m: float | FloatArray, root: FloatArray
) -> FloatArray:
    """Return when the line of flight enters a circle.

    Parameters
    ----------
    motion : Horizontal
    radius_m : float or ndarray
    root : ndarray
        Square root of the `discriminant`, not negative.

    Returns
    -------
    ndarray
        s; of either sign, meaningless where there is no relative motion.
    """
    p, outside = motion.closing_m2_s, motion.range_sq_m2 - radius_m * radius_m
    # Whichever form of the smaller root does not subtract nearly equal numbers.
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        return np.asarray(
            np.where(p < 0.0, outside / (root - p), (-p - root) / motion.speed_sq_m2_s2)
        )


def exit_of_circle_s(
    motion: Horizontal, radius_m: float | FloatArray, root: FloatArray
) -> FloatArray:
    """Return when the line of flight leaves a circle; as `entry_of_circle_s`."""
    p, outside = motion.closing_m2_s, motion.range_sq_m2 - radius_m * radius_m
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        return np.asarray(
            np.where(p > 0.0, -outside / (root + p), (root - p) / motion.speed_sq_m2_s2)
        )
