"""Luminance of the sun, the sky, the ground and a target by day."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from components.arguments.checks import (
    broadcast_flat,
    check_angle_rad,
    check_finite,
    check_not_negative,
    check_positive,
    refuse,
    unflatten,
)
from components.geometry import angle_between
from dsa_des.arrays.types import FloatArray

# Illuminance of the sun's beam outside the atmosphere, lux (IES RP-21, 1984).
EXTRATERRESTRIAL_LUX = 127_500.0

# Below this sine the optical air mass 1/sin(elevation) has lost its meaning.
_SMALLEST_SINE = 1e-3


@dataclass(frozen=True)
class Sky:
    """Light transmission and luminance distribution of one sky condition."""

    # c of exp(-c · air mass) for the sun's beam; None when clouds hide the sun
    beam_extinction: float | None
    # (float, float, float): A, B, C of the horizontal illuminance A + B sin(sun elevation)^C
    diffuse_lux: tuple[float, float, float]
    # (float, float): a, b of the CIE gradation 1 + a exp(b / cos Z), Z the zenith angle
    gradation: tuple[float, float]
    # (float, float, float): c, d, e of the CIE indicatrix 1 + c (exp(d χ) - exp(d pi/2)) + e
    # cos² χ, χ the angle from the sun
    indicatrix: tuple[float, float, float]


# Illuminances: IES Recommended Practice for the Calculation of Daylight Availability (RP-21),
# J. IES 13(4), 1984. Luminance patterns: CIE S 011 / ISO 15469 standard general sky, types 12
# (clear, low turbidity), 7 (partly cloudy, bright round the sun) and 1 (overcast).
SKIES = {
    "clear": Sky(0.21, (800.0, 15_500.0, 0.5), (-1.0, -0.32), (10.0, -3.0, 0.45)),
    "partly_cloudy": Sky(0.80, (300.0, 45_000.0, 1.0), (0.0, -1.0), (5.0, -2.5, 0.30)),
    "overcast": Sky(None, (300.0, 21_000.0, 1.0), (4.0, -0.70), (0.0, -1.0, 0.0)),
}


def find_sky(name: str) -> Sky:
    """Return the sky condition of the given name; raise ValueError for an unknown one."""
    if name not in SKIES:
        raise ValueError(f"sky is {name!r}: it must be one of {', '.join(SKIES)}")
    return SKIES[name]


def check_daylight_sun(sun_elevation_rad: ArrayLike) -> FloatArray:
    """Return the sun's elevation; raise ValueError if the sun is not above the horizon."""
    sun = check_angle_rad("sun_elevation_rad", sun_elevation_rad)
    up = (sun > 0.0) & (sun <= 0.5 * np.pi + 1e-12)
    refuse("sun_elevation_rad", sun, ~up, "be above 0 and at most pi/2 (daylight models)")
    return sun


def beam_illuminance(sun_elevation_rad: ArrayLike, sky: str = "clear") -> Any:
    """Return the illuminance of the direct sun on a surface perpendicular to it, lux.

    127,500 lux · exp(-c / sin(elevation)); 0 under an overcast sky.

    IES RP-21 (1984), sea level.
    """
    extinction = find_sky(sky).beam_extinction
    shape, (sun,) = broadcast_flat(sun_elevation_rad=check_daylight_sun(sun_elevation_rad))
    if extinction is None:
        return unflatten(np.zeros_like(sun), shape)
    air_mass = 1.0 / np.maximum(np.sin(sun), _SMALLEST_SINE)
    return unflatten(EXTRATERRESTRIAL_LUX * np.exp(-extinction * air_mass), shape)


def sky_illuminance(sun_elevation_rad: ArrayLike, sky: str = "clear") -> Any:
    """Return the illuminance of level ground by the sky without the direct sun, lux.

    IES RP-21 (1984): A + B sin(elevation)^C.
    """
    base, rise, exponent = find_sky(sky).diffuse_lux
    shape, (sun,) = broadcast_flat(sun_elevation_rad=check_daylight_sun(sun_elevation_rad))
    sine = np.sin(sun)
    shaped = np.sqrt(sine) if exponent == 0.5 else sine
    return unflatten(base + rise * shaped, shape)


def sky_luminance(
    azimuth_rad: ArrayLike,
    elevation_rad: ArrayLike,
    sun_azimuth_rad: ArrayLike,
    sun_elevation_rad: ArrayLike,
    sky: str = "clear",
) -> Any:
    """Return the luminance of the sky in a direction, cd/m².

    The CIE standard general sky, scaled so that the whole sky gives `sky_illuminance`. The sun's
    disc itself is not part of it. Directions below the horizon get the horizon's luminance.

    CIE S 011/E:2003 = ISO 15469:2004. The scale is a table over the sun's elevation (1 degree,
    linear): worst error measured 4e-5.
    """
    find_sky(sky)
    shape, (azimuth, elevation, sun_azimuth, sun_elevation) = broadcast_flat(
        azimuth_rad=check_angle_rad("azimuth_rad", azimuth_rad),
        elevation_rad=check_angle_rad("elevation_rad", elevation_rad),
        sun_azimuth_rad=check_angle_rad("sun_azimuth_rad", sun_azimuth_rad),
        sun_elevation_rad=check_daylight_sun(sun_elevation_rad),
    )
    from_sun = angle_between(azimuth, elevation, sun_azimuth, sun_elevation)
    pattern = _relative_luminance(np.sin(elevation), from_sun, sky)
    degrees = np.minimum(np.degrees(sun_elevation), 90.0)
    left = np.minimum(degrees.astype(np.int64), 89)
    share = degrees - left
    scale = _relative_illuminance_by_sun(sky)
    per_lux = scale[left] * (1.0 - share) + scale[left + 1] * share
    return unflatten(pattern * sky_illuminance(sun_elevation, sky) / per_lux, shape)


def _relative_luminance(
    sin_elevation: FloatArray, from_sun_rad: FloatArray, sky: str
) -> FloatArray:
    """Return the relative luminance of the sky by the CIE formula, gradation times indicatrix."""
    a, b = SKIES[sky].gradation
    c, d, e = SKIES[sky].indicatrix
    gradation = 1.0 + a * np.exp(b / np.maximum(sin_elevation, _SMALLEST_SINE))
    indicatrix = (
        1.0
        + c * (np.exp(d * from_sun_rad) - np.exp(0.5 * np.pi * d))
        + e * np.square(np.cos(from_sun_rad))
    )
    return gradation * indicatrix


@lru_cache(maxsize=len(SKIES))
def _relative_illuminance_by_sun(sky: str) -> FloatArray:
    """Return the unscaled sky's illuminance of level ground for the sun at 0 to 90 deg, (91,)."""
    nodes, weights = np.polynomial.legendre.leggauss(48)
    elevation = 0.25 * np.pi * (nodes + 1.0)
    turn = 0.5 * np.pi * (nodes + 1.0)
    el, az = np.meshgrid(elevation, turn, indexing="ij")
    solid = np.outer(0.25 * np.pi * weights, 0.5 * np.pi * weights) * np.cos(el) * np.sin(el)
    sums = []
    for sun in np.radians(np.linspace(0.0, 90.0, 91)):
        pattern = _relative_luminance(np.sin(el), angle_between(az, el, 0.0, sun), sky)
        # Half the sky is integrated; the other half mirrors it.
        sums.append(2.0 * float((pattern * solid).sum()))
    table = np.array(sums)
    table.setflags(write=False)
    return table


BACKGROUNDS = ("sky", "ground", "auto")


def inherent_contrast(target_cd_m2: ArrayLike, background_cd_m2: ArrayLike) -> Any:
    """Return the contrast at the target, |Lt - Lb| / Lb."""
    target = check_not_negative("target_cd_m2", target_cd_m2)
    behind = check_positive("background_cd_m2", background_cd_m2)
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
    """Return the mean luminance of a matt painted target seen in a direction under a sun, cd/m².

    The target is taken as a Lambert sphere: its sunlit side is turned to us when the sun is behind
    us, its shaded side when we look towards the sun. With χ the angle between the line of sight
    and the sun, E the beam's illuminance and ρ the paint,

        L = ρ E/pi · (2/3) (sin χ - χ cos χ)/pi + ρ (L_sky + L_ground)/2,

    the second term being the light of an even sky from above and of the ground from below. No
    gloss, no glint, no own lights.

    Phase function of the Lambert sphere (classical, Lambert 1760), with the phase angle pi - χ.
    """
    paint = check_finite("paint_reflectance", paint_reflectance)
    refuse("paint_reflectance", paint, ~((paint >= 0.0) & (paint <= 1.0)), "be between 0 and 1")
    shape, (azimuth, elevation, sun_azimuth, sun_elevation, rho, ground) = broadcast_flat(
        azimuth_rad=check_angle_rad("azimuth_rad", azimuth_rad),
        elevation_rad=check_angle_rad("elevation_rad", elevation_rad),
        sun_azimuth_rad=check_angle_rad("sun_azimuth_rad", sun_azimuth_rad),
        sun_elevation_rad=check_daylight_sun(sun_elevation_rad),
        paint_reflectance=paint,
        ground_reflectance=_check_ground_reflectance(ground_reflectance),
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
    """Return the luminance of the background behind the target, sky or matt ground, cd/m²."""
    if background not in BACKGROUNDS:
        raise ValueError(
            f"background is {background!r}: it must be one of {', '.join(BACKGROUNDS)}"
        )
    shape, (azimuth, elevation, sun_azimuth, sun_elevation, ground) = broadcast_flat(
        azimuth_rad=check_angle_rad("azimuth_rad", azimuth_rad),
        elevation_rad=check_angle_rad("elevation_rad", elevation_rad),
        sun_azimuth_rad=check_angle_rad("sun_azimuth_rad", sun_azimuth_rad),
        sun_elevation_rad=check_daylight_sun(sun_elevation_rad),
        ground_reflectance=_check_ground_reflectance(ground_reflectance),
    )
    above = sky_luminance(azimuth, elevation, sun_azimuth, sun_elevation, sky)
    below = _ground_luminance(sun_elevation, ground, sky)
    if background == "auto":
        return unflatten(np.where(elevation >= 0.0, above, below), shape)
    return unflatten(above if background == "sky" else below, shape)


def _check_ground_reflectance(ground_reflectance: ArrayLike) -> FloatArray:
    ground = check_finite("ground_reflectance", ground_reflectance)
    allowed = (ground > 0.0) & (ground <= 1.0)
    refuse("ground_reflectance", ground, ~allowed, "be above 0 and at most 1")
    return ground


def _ground_luminance(sun_elevation_rad: FloatArray, reflectance: FloatArray, sky: str) -> Any:
    """Return the luminance of level matt ground under sun and sky, cd/m²."""
    beam = beam_illuminance(sun_elevation_rad, sky) * np.sin(sun_elevation_rad)
    return reflectance * (beam + sky_illuminance(sun_elevation_rad, sky)) / np.pi
