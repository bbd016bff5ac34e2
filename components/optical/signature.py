"""The strength of a target's signature on the image, and the threshold of its detection."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from components.arguments.checks import (
    FloatArray,
    broadcast_flat,
    finite,
    not_negative,
    positive,
    unflatten,
)
from components.optical.line_of_sight_rate import line_of_sight_rate

__all__ = [
    "confidence",
    "detection_range",
    "line_of_sight_rate",
    "pixels_covered",
    "total_signature",
]

# Longer than any line of sight; keeps the square of a range inside a double.
_FARTHEST_M = 1e120


def pixels_covered(
    area_m2: ArrayLike,
    range_m: ArrayLike,
    *,
    pixel_azimuth_rad: ArrayLike,
    pixel_elevation_rad: ArrayLike,
    sensor_pixels: ArrayLike,
) -> Any:
    """Count the pixels that a target's image covers, at most all of them (thesis eq. 14-15).

    Q = area / (R² · pixel azimuth · pixel elevation), capped at the sensor's own pixel count
    (errata 10). At range 0 a target of any area fills the sensor.

    Parameters
    ----------
    area_m2 : array_like, m²
        Visible area.
    range_m : array_like, m
        Slant range, 0 or more.
    pixel_azimuth_rad, pixel_elevation_rad : array_like, rad
        Angular size of one pixel: field of view / number of pixels.
    sensor_pixels : array_like
        Pixels of the whole sensor (azimuth count times elevation count).

    Returns
    -------
    array of the broadcast shape
        Pixels, not rounded to whole ones.

    Raises
    ------
    ValueError
        If an argument is not finite, an area or range is negative, or a pixel size or count is
        not above 0.
    """
    shape, (area, distance, across, upward, most) = broadcast_flat(
        area_m2=not_negative("area_m2", area_m2),
        range_m=not_negative("range_m", range_m),
        pixel_azimuth_rad=positive("pixel_azimuth_rad", pixel_azimuth_rad),
        pixel_elevation_rad=positive("pixel_elevation_rad", pixel_elevation_rad),
        sensor_pixels=positive("sensor_pixels", sensor_pixels),
    )
    return unflatten(pixels_of_cells(area, distance, across, upward, most), shape)


def pixels_of_cells(
    area: FloatArray, distance: FloatArray, across: Any, upward: Any, most: Any
) -> FloatArray:
    """`pixels_covered` for flat arrays that were checked; the pixels may be plain numbers."""
    distance = np.minimum(distance, _FARTHEST_M)
    pixel_m2 = (distance * across) * (distance * upward)
    fills = area >= pixel_m2 * most
    pixels = np.where(fills, most, area / np.where(fills, 1.0, pixel_m2))
    return np.where(area > 0.0, pixels, 0.0)


def total_signature(
    pixels: ArrayLike,
    rate_rad_s: ArrayLike = 0.0,
    *,
    contrast_gain: ArrayLike = 1.0,
    static_weight: ArrayLike = 0.3,
    dynamic_weight: ArrayLike = 0.0,
) -> Any:
    """Weigh size, contrast and speed into one signature (thesis eq. 18).

    E = a · Q · P + b · V. The defaults a = 0.3, P = 1, b = 0 are the ones that reproduce
    Table 4.4 (errata 23).

    Parameters
    ----------
    pixels : array_like
        Static signature Q, pixels covered.
    rate_rad_s : array_like, rad/s
        Dynamic signature V.
    contrast_gain : array_like
        P, 0 or more.
    static_weight : array_like
        a, per pixel.
    dynamic_weight : array_like, s/rad
        b.

    Returns
    -------
    array of the broadcast shape
        E, dimensionless.

    Raises
    ------
    ValueError
        If an argument is negative or not finite.
    """
    return (
        not_negative("static_weight", static_weight)
        * not_negative("pixels", pixels)
        * not_negative("contrast_gain", contrast_gain)
    ) + not_negative("dynamic_weight", dynamic_weight) * not_negative("rate_rad_s", rate_rad_s)


def confidence(signature: ArrayLike, threshold: ArrayLike = 1.0) -> Any:
    """Give the margin of the signature over the threshold, C = E - threshold (thesis eq. 19).

    The target is detected when C >= 0 (errata 10). C is in the units of E: weighted pixels.

    Parameters
    ----------
    signature : array_like
        E of `total_signature`.
    threshold : array_like

    Returns
    -------
    array of the broadcast shape

    Raises
    ------
    ValueError
        If an argument is not finite.
    """
    return finite("signature", signature) - finite("threshold", threshold)


def detection_range(
    area_m2: ArrayLike,
    *,
    pixel_azimuth_rad: ArrayLike,
    pixel_elevation_rad: ArrayLike,
    contrast_gain: ArrayLike = 1.0,
    static_weight: ArrayLike = 0.3,
    dynamic_signature: ArrayLike = 0.0,
    threshold: ArrayLike = 1.0,
    sensor_pixels: ArrayLike | None = None,
) -> Any:
    """Give the range at which a target is just detected, in closed form.

    R = sqrt(a · area · P / (pixel azimuth · pixel elevation · (threshold - bV))). Infinity where
    the speed alone reaches the threshold. With `sensor_pixels`, 0 where not even an image that
    fills the sensor is enough.

    Parameters
    ----------
    area_m2 : array_like, m²
    pixel_azimuth_rad, pixel_elevation_rad : array_like, rad
    contrast_gain, static_weight, threshold : array_like
        P, a and the threshold of eq. 18-19, each 0 or more.
    dynamic_signature : array_like
        b · V.
    sensor_pixels : array_like, optional
        Pixels of the whole sensor.

    Returns
    -------
    array of the broadcast shape, m

    Raises
    ------
    ValueError
        If an argument is negative or not finite, or a pixel has no size.

    Notes
    -----
    Thesis eq. 14, 15, 18 and 19 solved for R; errata 10 and 23.
    """
    pixels = np.float64(1.0) if sensor_pixels is None else positive("sensor_pixels", sensor_pixels)
    shape, flat = broadcast_flat(
        area_m2=not_negative("area_m2", area_m2),
        pixel_azimuth_rad=positive("pixel_azimuth_rad", pixel_azimuth_rad),
        pixel_elevation_rad=positive("pixel_elevation_rad", pixel_elevation_rad),
        contrast_gain=not_negative("contrast_gain", contrast_gain),
        static_weight=not_negative("static_weight", static_weight),
        dynamic_signature=not_negative("dynamic_signature", dynamic_signature),
        threshold=finite("threshold", threshold),
        sensor_pixels=np.asarray(pixels),
    )
    area, across, upward, gain, weight, dynamic, level, most = flat
    wanted = level - dynamic
    needs_image = wanted > 0.0
    wanted = np.where(needs_image, wanted, 1.0)
    distance = np.sqrt(weight * area * gain / (across * upward * wanted))
    if sensor_pixels is not None:
        distance = np.where(weight * gain * most >= wanted, distance, 0.0)
    return unflatten(np.where(needs_image, distance, np.inf), shape)
