"""The luminance of a painted target and of its background."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from components.arguments.checks import (
    FloatArray,
    angle,
    broadcast_flat,
    finite,
    not_negative,
    positive,
    refuse,
    unflatten,
)
from components.geometry.directions import angle_between
from components.optical.sun_and_sky import (
    beam_illuminance,
    daylight_sun,
    sky_illuminance,
    sky_luminance,
)

BACKGROUNDS = ("sky", "ground", "auto")


def inherent_contrast(target_cd_m2: ArrayLike, background_cd_m2: ArrayLike) -> Any:
    """Give the contrast at the target, |Lt - Lb| / Lb.

    Parameters
    ----------
    target_cd_m2 : array_like, cd/m²
        0 or more.
    background_cd_m2 : array_like, cd/m²
        Above 0.

    Returns
    -------
    array of the broadcast shape
        At most 1 for a target darker than its background, unlimited for a brighter one.

    Raises
    ------
    ValueError
        If a luminance is out of range or not finite.
    """
    target = not_negative("target_cd_m2", target_cd_m2)
    behind = positive("background_cd_m2", background_cd_m2)
    return np.abs(target - behind) / behind


def target_luminance(
    azimuth_rad: ArrayLike,
    elevation_rad: ArrayLike,
    sun_azimuth_rad: ArrayLike,
    sun_elevation_rad: ArrayLike,
    *,
    paint_reflectance: ArrayLike = 0.5,
    ground_reflectance: ArrayLike = 0.2,
    sky: str = "clear",
) -> Any:
    """Give the mean luminance of a matt painted target, by its aspect to the sun.

    The target is taken as a Lambert sphere: its sunlit side is turned to us when the sun is behind
    us, its shaded side when we look towards the sun. With χ the angle between the line of sight
    and the sun, E the beam's illuminance and ρ the paint,

        L = ρ E/pi · (2/3) (sin χ - χ cos χ)/pi + ρ (L_sky + L_ground)/2,

    the second term being the light of an even sky from above and of the ground from below. No
    gloss, no glint, no own lights.

    Parameters
    ----------
    azimuth_rad, elevation_rad : array_like, rad
        Line of sight from us to the target.
    sun_azimuth_rad, sun_elevation_rad : array_like, rad
        Direction of the sun in the same frame.
    paint_reflectance : array_like
        In [0, 1].
    ground_reflectance : array_like
        In (0, 1].
    sky : {"clear", "partly_cloudy", "overcast"}

    Returns
    -------
    array of the broadcast shape, cd/m²

    Raises
    ------
    ValueError
        If an argument is out of range or not finite, or the sky is unknown.

    Notes
    -----
    Phase function of the Lambert sphere (classical, Lambert 1760), with the phase angle pi - χ.
    """
    paint = finite("paint_reflectance", paint_reflectance)
    refuse("paint_reflectance", paint, ~((paint >= 0.0) & (paint <= 1.0)), "be between 0 and 1")
    shape, (azimuth, elevation, sun_azimuth, sun_elevation, rho, ground) = broadcast_flat(
        azimuth_rad=angle("azimuth_rad", azimuth_rad),
        elevation_rad=angle("elevation_rad", elevation_rad),
        sun_azimuth_rad=angle("sun_azimuth_rad", sun_azimuth_rad),
        sun_elevation_rad=daylight_sun(sun_elevation_rad),
        paint_reflectance=paint,
        ground_reflectance=_ground(ground_reflectance),
    )
    from_sun = angle_between(azimuth, elevation, sun_azimuth, sun_elevation)
    lit = np.maximum(np.sin(from_sun) - from_sun * np.cos(from_sun), 0.0) / np.pi
    from_beam = beam_illuminance(sun_elevation, sky) / np.pi * (2.0 / 3.0) * lit
    even_sky = sky_illuminance(sun_elevation, sky) / np.pi
    around = 0.5 * (even_sky + _ground_luminance(sun_elevation, ground, sky))
    return unflatten(rho * (from_beam + around), shape)


def background_luminance(
    azimuth_rad: ArrayLike,
    elevation_rad: ArrayLike,
    sun_azimuth_rad: ArrayLike,
    sun_elevation_rad: ArrayLike,
    *,
    ground_reflectance: ArrayLike = 0.2,
    sky: str = "clear",
    background: str = "auto",
) -> Any:
    """Give the luminance of what lies behind the target, the sky or matt ground.

    Parameters
    ----------
    azimuth_rad, elevation_rad : array_like, rad
        Line of sight from us to the target.
    sun_azimuth_rad, sun_elevation_rad : array_like, rad
        Direction of the sun in the same frame.
    ground_reflectance : array_like
        In (0, 1].
    sky : {"clear", "partly_cloudy", "overcast"}
    background : {"sky", "ground", "auto"}
        ``auto``: sky from elevation 0 up, ground below it.

    Returns
    -------
    array of the broadcast shape, cd/m²
        Above 0.

    Raises
    ------
    ValueError
        If an argument is out of range or not finite, or a name is unknown.
    """
    if background not in BACKGROUNDS:
        raise ValueError(
            f"background is {background!r}: it must be one of {', '.join(BACKGROUNDS)}"
        )
    shape, (azimuth, elevation, sun_azimuth, sun_elevation, ground) = broadcast_flat(
        azimuth_rad=angle("azimuth_rad", azimuth_rad),
        elevation_rad=angle("elevation_rad", elevation_rad),
        sun_azimuth_rad=angle("sun_azimuth_rad", sun_azimuth_rad),
        sun_elevation_rad=daylight_sun(sun_elevation_rad),
        ground_reflectance=_ground(ground_reflectance),
    )
    above = sky_luminance(azimuth, elevation, sun_azimuth, sun_elevation, sky)
    below = _ground_luminance(sun_elevation, ground, sky)
    if background == "auto":
        return unflatten(np.where(elevation >= 0.0, above, below), shape)
    return unflatten(above if background == "sky" else below, shape)


def _ground(ground_reflectance: ArrayLike) -> FloatArray:
    ground = finite("ground_reflectance", ground_reflectance)
    allowed = (ground > 0.0) & (ground <= 1.0)
    refuse("ground_reflectance", ground, ~allowed, "be above 0 and at most 1")
    return ground


def _ground_luminance(sun_elevation_rad: FloatArray, reflectance: FloatArray, sky: str) -> Any:
    """Give the luminance of level Lambert ground under sun and sky."""
    beam = beam_illuminance(sun_elevation_rad, sky) * np.sin(sun_elevation_rad)
    return reflectance * (beam + sky_illuminance(sun_elevation_rad, sky)) / np.pi
