"""False alarms of camera frames, and their places in the picture.

Pure functions of uniform numbers in [0, 1), which the block draws with its own keys.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from components.arguments.checks import broadcast_flat, finite, refuse, unflatten

#: AFRL flight tests with a Beech Bonanza (thesis section 2.4.1): 0.045 % and 0.01 %, read as the
#: probability of a false detection per frame (assumption).
AFRL_LOW_THRESHOLD = 0.00045
AFRL_HIGH_THRESHOLD = 0.0001


def false_alarm_in_frame(uniform: ArrayLike, false_alarm_probability: ArrayLike) -> Any:
    """Say which frames bring a false alarm; a frame brings one at most.

    Parameters
    ----------
    uniform : array_like
        In [0, 1), one per frame.
    false_alarm_probability : array_like
        Per frame, in [0, 1]; `AFRL_LOW_THRESHOLD` or `AFRL_HIGH_THRESHOLD` for the thesis's camera.

    Returns
    -------
    array of bool, the broadcast shape

    Raises
    ------
    ValueError
        If an argument is out of range or not finite.
    """
    draws = _unit("uniform", uniform)
    probability = finite("false_alarm_probability", false_alarm_probability)
    allowed = (probability >= 0.0) & (probability <= 1.0)
    refuse("false_alarm_probability", probability, ~allowed, "be in [0, 1]")
    return draws < probability


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


def false_alarm_signature(
    uniform: ArrayLike, *, threshold: float, false_alarm_probability: float
) -> Any:
    """Return the signature that false alarms have: noise, given that it crosses the threshold.

    Parameters
    ----------
    uniform : array_like
        In [0, 1), one per false alarm.
    threshold : float
        The signature that is detected (eq. 19); noise below 0 is no signature, whatever it is.
    false_alarm_probability : float
        Per frame, in (0, 1].

    Returns
    -------
    array of the shape of `uniform`
        In the unit of the threshold, never below it, nor below 0.

    Raises
    ------
    ValueError
        If an argument is out of range or not finite.

    Notes
    -----
    Assumption: the largest noise of a frame is Gaussian with mean 0, and a false alarm is a frame
    in which it crosses the threshold (as the AFRL cameras' two thresholds are told apart, see
    configs/sensors/). So its standard deviation is threshold / z, where z is the quantile that the
    probability lies beyond, and what crosses has the tail of that distribution. Where more frames
    have a false alarm than lie beyond one standard deviation, it is the threshold itself; without
    a threshold above 0 nothing is known of the noise, and it is 1.
    """
    from statistics import NormalDist

    draws = _unit("uniform", uniform)
    level = max(float(finite("threshold", threshold)), 0.0)
    probability = finite("false_alarm_probability", false_alarm_probability)
    allowed = (probability > 0.0) & (probability <= 1.0)
    refuse("false_alarm_probability", probability, ~allowed, "be in (0, 1]")
    normal = NormalDist()
    beyond_one = normal.cdf(-1.0)
    crossed = -normal.inv_cdf(min(float(probability), beyond_one))
    deviation = level / crossed or 1.0
    tail = normal.cdf(-level / deviation)
    # One by one: there are few, and the library's quantile is good to the last places.
    found = [-deviation * normal.inv_cdf(tail * (1.0 - u)) for u in draws.reshape(-1).tolist()]
    return np.maximum(np.array(found), level).reshape(draws.shape)


def _unit(name: str, value: ArrayLike) -> Any:
    array = finite(name, value)
    refuse(name, array, ~((array >= 0.0) & (array < 1.0)), "be in [0, 1)")
    return array
