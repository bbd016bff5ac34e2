"""How strongly rain echoes a radar's pulse, and how it moves."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from components.arguments.checks import (
    broadcast_flat,
    check_finite,
    check_not_negative,
    check_numbers,
    check_positive,
    refuse,
    unflatten,
)
from dsa_des.arrays.types import FloatArray

#: Drops are small against the wavelength, and scatter after Rayleigh, up to here.
HIGHEST_RAYLEIGH_HZ = 35.5e9
#: |K|² of water at centimetre waves.
DIELECTRIC_FACTOR = 0.93

_LN_2 = math.log(2.0)
# Wind shear (4 m/s per km, at most 6 m/s), turbulence and the spread of drops' fall speeds.
_SHEAR_PER_S, _MOST_SHEAR_M_S, _TURBULENCE_M_S, _FALL_SPREAD_M_S = 4e-3, 6.0, 1.0, 1.0


def rain_reflectivity_per_m(rain_rate_mm_h: ArrayLike, wavelength_m: float) -> Any:
    """Return the radar cross-section of a volume of rain, η in m² per m³.

    η = pi⁵ |K|² Z / λ⁴ with Z = 200 R^1.6 mm⁶/m³ (J. S. Marshall and W. M. Palmer, J. Meteorology
    5, 1948; M. I. Skolnik, Introduction to Radar Systems, 3rd ed., section 7.6; F. E. Nathanson,
    Radar Design Principles, 2nd ed., chapter 6). Drops scatter after Rayleigh: up to
    `HIGHEST_RAYLEIGH_HZ`, and there within 4 dB of spheres after Mie up to 25 mm/h; above, η is too
    large (12 dB at 94 GHz and 4 mm/h).
    """
    rate = check_not_negative("rain_rate_mm_h", rain_rate_mm_h)
    wave = float(check_positive("wavelength_m", wavelength_m))
    z_m3 = 200e-18 * rate**1.6
    return (math.pi**5 * DIELECTRIC_FACTOR / wave**4 * z_m3)[()]


def rain_volume_m3(
    range_m: ArrayLike,
    elevation_rad: ArrayLike,
    alt_m: ArrayLike,
    *,
    azimuth_beamwidth_rad: float,
    elevation_beamwidth_rad: float,
    range_resolution_m: float,
    lowest_m: float,
    highest_m: float,
) -> Any:
    """Return the volume of rain, m³, in the radar cell around a target at which the beam points.

    Weighted by the two-way gain of a beam of one-way half-power widths, as rain counts beside a
    target amid the beam. It rains from `lowest_m` (-inf for rain that nothing ends below) to
    `highest_m`.

    pi R² θ_az θ_el ΔR / (8 ln 2) of a Gaussian beam (J. R. Probert-Jones, Quart. J. Royal Met. Soc.
    88, 1962), times the share of its two-way gain that lies where it rains: over the height it is
    Gaussian with R cos(elevation) θ_el / sqrt(16 ln 2).
    """
    for name, value in (
        ("azimuth_beamwidth_rad", azimuth_beamwidth_rad),
        ("elevation_beamwidth_rad", elevation_beamwidth_rad),
        ("range_resolution_m", range_resolution_m),
    ):
        check_positive(name, value)
    shape, (distance, elevation, height) = broadcast_flat(
        range_m=check_not_negative("range_m", range_m),
        elevation_rad=check_finite("elevation_rad", elevation_rad),
        alt_m=check_finite("alt_m", alt_m),
    )
    solid = math.pi * azimuth_beamwidth_rad * elevation_beamwidth_rad / (8.0 * _LN_2)
    spread = distance * np.cos(elevation) * elevation_beamwidth_rad / math.sqrt(16.0 * _LN_2)
    spread = np.maximum(spread, 1e-9)
    share = _normal_share_below((highest_m - height) / spread) - _normal_share_below(
        (lowest_m - height) / spread
    )
    volume = distance * distance * solid * range_resolution_m * np.maximum(share, 0.0)
    return unflatten(volume, shape)


def rain_shell_m3(
    range_m: ArrayLike,
    own_alt_m: ArrayLike,
    *,
    range_resolution_m: float,
    lowest_m: float,
    highest_m: float,
) -> Any:
    """Return the rain volume, m³, of the whole shell at a slant range, which sidelobes light up.

    2 pi R ΔR times the height of the shell in which it rains (Archimedes).
    """
    check_positive("range_resolution_m", range_resolution_m)
    shape, (distance, own) = broadcast_flat(
        range_m=check_not_negative("range_m", range_m),
        own_alt_m=check_finite("own_alt_m", own_alt_m),
    )
    top = np.clip(highest_m - own, -distance, distance)
    bottom = np.clip(lowest_m - own, -distance, distance)
    height = np.maximum(top - bottom, 0.0)
    return unflatten(2.0 * math.pi * distance * range_resolution_m * height, shape)


def fall_speed_m_s(rain_rate_mm_h: ArrayLike) -> Any:
    """Return how fast rain falls as a radar sees it, m/s: 2.6 Z^0.107 (J. Joss, 1970)."""
    rate = check_numbers("rain_rate_mm_h", rain_rate_mm_h)
    refuse("rain_rate_mm_h", rate, ~(rate >= 0.0), "be 0 or more")
    return (2.6 * (200.0 * rate**1.6) ** 0.107)[()]


def rain_velocity_deviation_m_s(
    range_m: ArrayLike, elevation_rad: ArrayLike, elevation_beamwidth_rad: float
) -> Any:
    """Return the standard deviation of the range rates of rain within a radar cell, m/s.

    Shear of the wind over the beam's height, 0.42 · 4 m/s/km · R · θ_el and at most 6 m/s,
    turbulence of 1 m/s and 1 m/s · sin(elevation) of the drops' fall (Nathanson, chapter 6).
    """
    shape, (distance, elevation) = broadcast_flat(
        range_m=check_not_negative("range_m", range_m),
        elevation_rad=check_finite("elevation_rad", elevation_rad),
    )
    shear = 0.42 * _SHEAR_PER_S * elevation_beamwidth_rad * distance * np.cos(elevation)
    shear = np.minimum(shear, _MOST_SHEAR_M_S)
    fall = _FALL_SPREAD_M_S * np.sin(elevation)
    return unflatten(np.sqrt(shear**2 + _TURBULENCE_M_S**2 + fall**2), shape)


def _normal_share_below(deviations: FloatArray) -> FloatArray:
    """Return the share (0 to 1) of a normal distribution below so many standard deviations."""
    from scipy.special import ndtr

    share: FloatArray = ndtr(deviations)
    return share
