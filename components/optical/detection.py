"""Detection in a camera's picture: signature, noise and threshold, and what noise alone does.

A look measures each target's signature (eq. 18) once, with Gaussian noise, and detects it where
that sample reaches the threshold. Noise alone is sampled so often in a frame as there are
independent places for a target's picture, and a false alarm is a sample that reaches the same
threshold. Pure functions; the block draws with its own keys.
"""

from __future__ import annotations

import math
from statistics import NormalDist
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from components.arguments.checks import (
    broadcast_flat,
    finite,
    not_negative,
    positive,
    refuse,
    unflatten,
)

_NORMAL = NormalDist()
_PIXEL_VARIANCE = 1.0 / 12.0
#: A look that is less likely to detect its target than this is none.
FAINTEST_PD = 1e-6
#: So many standard deviations below the threshold a target is never detected.
FAINTEST_DEVIATIONS = -_NORMAL.inv_cdf(FAINTEST_PD)


def noise_equivalent_pixels(blur_pixels: float) -> float:
    """Return over how many pixels the picture of a point is spread, to a filter that fits it.

    Parameters
    ----------
    blur_pixels : float
        Standard deviation of the blur, above 0.

    Returns
    -------
    float
        4 pi s², with s² the variance of the picture: that of the blur and of a pixel, 1/12. The
        noise of the signal that a matched filter finds is that of a pixel times its root, and a
        picture has one independent place for each such area.

    Raises
    ------
    ValueError
        If the blur is not above 0.

    Notes
    -----
    The inverse of the sum of the squared shares of its pixels, for a Gaussian spot; King, Accuracy
    of measurement of star images on a pixel array, Publications of the Astronomical Society of the
    Pacific 95, 1983.
    """
    blur = float(positive("blur_pixels", blur_pixels))
    return 4.0 * math.pi * (blur**2 + _PIXEL_VARIANCE)


def detection_probability(signature: ArrayLike, threshold: ArrayLike, noise: ArrayLike) -> Any:
    """Return the probability that a sample of a signature with noise reaches the threshold.

    Parameters
    ----------
    signature : array_like
        Without noise.
    threshold : array_like
    noise : array_like
        Standard deviation of the noise, 0 or more, in the unit of both.

    Returns
    -------
    array of the broadcast shape
        Q((threshold - signature) / noise), with its full relative precision in the tail, and 0
        where that is below `FAINTEST_PD`. Without noise 1 where the signature reaches the
        threshold, else 0 (eq. 19).

    Raises
    ------
    ValueError
        If an argument is not finite, or the noise is negative.
    """
    from scipy.special import ndtr

    shape, (level, needed, deviation) = broadcast_flat(
        signature=finite("signature", signature),
        threshold=finite("threshold", threshold),
        noise=not_negative("noise", noise),
    )
    silent = deviation == 0.0
    above = (level - needed) / np.where(silent, 1.0, deviation)
    drawn = np.where(above > -FAINTEST_DEVIATIONS, ndtr(above), 0.0)
    return unflatten(np.where(silent, np.where(level >= needed, 1.0, 0.0), drawn), shape)


def deviations_exceeded(probability: float) -> float:
    """Return how many standard deviations Gaussian noise exceeds with some probability.

    Parameters
    ----------
    probability : float
        In (0, 1).
    """
    return -_NORMAL.inv_cdf(probability)


def exceeding_probability(deviations: float) -> float:
    """Return the probability with which Gaussian noise exceeds so many standard deviations."""
    return 0.5 * math.erfc(deviations / math.sqrt(2.0))


def false_alarm_direction(
    azimuth_uniform: ArrayLike,
    elevation_uniform: ArrayLike,
    *,
    azimuth_start_rad: float,
    azimuth_width_rad: float,
    lowest_elevation_rad: float,
    highest_elevation_rad: float,
) -> tuple[Any, Any]:
    """Return where in the picture false alarms appear: every pixel is as likely.

    Parameters
    ----------
    azimuth_uniform, elevation_uniform : array_like
        In [0, 1), one of each per false alarm.
    azimuth_start_rad, azimuth_width_rad : float, rad
        The field of view runs clockwise from the start over the width, (0, 2π].
    lowest_elevation_rad, highest_elevation_rad : float, rad

    Returns
    -------
    azimuth_rad, elevation_rad : arrays of the broadcast shape
        Not yet rounded to the pixel grid; azimuth not wrapped.

    Raises
    ------
    ValueError
        If an argument is out of range or not finite.

    Notes
    -----
    Evenly over azimuth and elevation, as pixels are; not over solid angle.
    """
    width = finite("azimuth_width_rad", azimuth_width_rad)
    good = (width > 0.0) & (width <= 2.0 * np.pi * (1.0 + 1e-12))
    refuse("azimuth_width_rad", width, ~good, "be in (0, 2π]")
    lowest = finite("lowest_elevation_rad", lowest_elevation_rad)
    highest = finite("highest_elevation_rad", highest_elevation_rad)
    refuse(
        "highest_elevation_rad", highest, ~(highest >= lowest), "be at least the lowest elevation"
    )
    start = finite("azimuth_start_rad", azimuth_start_rad)
    shape, (across, upwards) = broadcast_flat(
        azimuth_uniform=_unit("azimuth_uniform", azimuth_uniform),
        elevation_uniform=_unit("elevation_uniform", elevation_uniform),
    )
    azimuth = start + width * across
    elevation = lowest + (highest - lowest) * upwards
    return unflatten(azimuth, shape), unflatten(elevation, shape)


def false_alarm_signature(uniform: ArrayLike, *, threshold: float, noise: float) -> Any:
    """Return the signature that false alarms have: noise, given that it reaches the threshold.

    Parameters
    ----------
    uniform : array_like
        In [0, 1), one per false alarm.
    threshold : float
        The signature that is detected (eq. 19); noise below 0 is no signature, whatever it is.
    noise : float
        Standard deviation of the noise, above 0.

    Returns
    -------
    array of the shape of `uniform`
        In the unit of the threshold, never below it, nor below 0.

    Raises
    ------
    ValueError
        If an argument is out of range or not finite.
    """
    draws = _unit("uniform", uniform)
    level = max(float(finite("threshold", threshold)), 0.0)
    deviation = float(positive("noise", noise))
    tail = exceeding_probability(level / deviation)
    # One by one: there are few, and the library's quantile is good to the last places.
    found = [deviation * deviations_exceeded(tail * (1.0 - u)) for u in draws.reshape(-1).tolist()]
    return np.maximum(np.array(found), level).reshape(draws.shape)


def _unit(name: str, value: ArrayLike) -> Any:
    array = finite(name, value)
    refuse(name, array, ~((array >= 0.0) & (array < 1.0)), "be in [0, 1)")
    return array
