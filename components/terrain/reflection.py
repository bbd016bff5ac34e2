"""Lobes of a radar over flat ground or sea: a target's echo by two rays.

The ray that the ground mirrors comes by a way that is longer, weakened and turned in phase by the
reflection. Both rays go both ways, so the echo is |1 + Γ ρ g exp(-j 2 pi δ/λ)|⁴ times what it is in
free space: up to 16 times amid a lobe, near 0 between two.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from components.arguments.checks import (
    broadcast_flat,
    check_finite,
    check_one_of,
    check_positive,
    unflatten,
)

_LN_2 = math.log(2.0)
#: Impedance of free space over 2 pi, ohm: conductivity as the imaginary part of a permittivity.
_OHM = 59.9584916


def surface_permittivity(
    relative_permittivity: float, conductivity_s_m: float, wavelength_m: float
) -> complex:
    """Return the complex relative permittivity of a ground, ε - j 60 λ σ (σ in S/m, λ in m)."""
    return complex(relative_permittivity, -_OHM * wavelength_m * conductivity_s_m)


def reflection_coefficient(grazing_rad: ArrayLike, permittivity: complex, polarisation: str) -> Any:
    """Return Fresnel's coefficient of a flat surface, complex.

    Parameters
    ----------
    grazing_rad : array_like
        Angle between ray and surface.
    permittivity : complex
        Relative, from `surface_permittivity`.
    polarisation : {"horizontal", "vertical", "circular", "slant"}
        Of the last two it is that of the part that stays as it was sent, the mean of both others.

    Notes
    -----
    (sin ψ - q) / (sin ψ + q) and (ε sin ψ - q) / (ε sin ψ + q), q = sqrt(ε - cos² ψ): -1 at ψ = 0,
    and of vertical polarisation 0 at Brewster's angle tan ψ = 1 / sqrt(ε) where ε is real.
    """
    check_one_of("polarisation", polarisation, ("horizontal", "vertical", "circular", "slant"))
    shape, (grazing,) = broadcast_flat(grazing_rad=check_finite("grazing_rad", grazing_rad))
    sine = np.sin(grazing)
    root = np.sqrt(permittivity - np.cos(grazing) ** 2)
    horizontal = (sine - root) / (sine + root)
    vertical = (permittivity * sine - root) / (permittivity * sine + root)
    of = {"horizontal": horizontal, "vertical": vertical}
    return unflatten(of.get(polarisation, 0.5 * (horizontal + vertical)), shape)


def roughness_field_factor(grazing_rad: ArrayLike, roughness_m: float, wavelength_m: float) -> Any:
    """Return exp(-g² / 2), g = 4 pi s sin ψ / λ: roughness's factor on the reflected field.

    s is the standard deviation of heights: W. S. Ament, "Toward a theory of reflection by a rough
    surface", Proc. IRE 41, 1953. By Rayleigh's criterion, g = pi / 2, it is 0.29.
    """
    shape, (grazing,) = broadcast_flat(grazing_rad=check_finite("grazing_rad", grazing_rad))
    g = (
        4.0
        * math.pi
        * roughness_m
        * np.sin(grazing)
        / float(check_positive("wavelength_m", wavelength_m))
    )
    with np.errstate(under="ignore"):
        return unflatten(np.exp(-0.5 * g * g), shape)


def two_ray_power_factor(
    range_m: ArrayLike,
    own_height_m: ArrayLike,
    target_height_m: ArrayLike,
    *,
    wavelength_m: float,
    permittivity: complex,
    polarisation: str,
    roughness_m: float = 0.0,
    elevation_beamwidth_rad: float | None = None,
    range_resolution_m: float = 0.0,
) -> Any:
    """Return the factor on echo power by interference with the ray reflected by flat ground.

    Parameters
    ----------
    range_m : array_like
        Slant range.
    own_height_m, target_height_m : array_like
        Above the ground; where either is 0 or less the factor is 1.
    elevation_beamwidth_rad : float, optional
        One-way half-power width of a Gaussian beam that points at the target: the mirrored ray
        comes from below. Without it both rays are received alike.
    range_resolution_m : float
        Rays whose lengths differ by more do not meet in a range cell: the factor is 1. 0 for none.

    Notes
    -----
    The ways differ by δ = 4 h1 h2 / (R + R'), R'² = R² + 4 h1 h2. With Γ = -1 the factor is
    16 sin⁴(pi δ / λ): lobes at odd multiples of λ/2 of δ. The Earth's bulge is left out, some
    d² / 17,000 km of the heights.
    """
    shape, (distance, own, target) = broadcast_flat(
        range_m=check_positive("range_m", range_m),
        own_height_m=check_finite("own_height_m", own_height_m),
        target_height_m=check_finite("target_height_m", target_height_m),
    )
    product = np.maximum(own, 0.0) * np.maximum(target, 0.0)
    mirrored = np.sqrt(distance * distance + 4.0 * product)
    longer = 4.0 * product / (distance + mirrored)
    sine = np.clip((own + target) / mirrored, 0.0, 1.0)
    grazing = np.arcsin(sine)
    field = reflection_coefficient(grazing, permittivity, polarisation)
    field = field * roughness_field_factor(grazing, roughness_m, wavelength_m)
    if elevation_beamwidth_rad:
        up = np.arcsin(np.clip((target - own) / distance, -1.0, 1.0))
        field = field * np.exp(-2.0 * _LN_2 * ((up + grazing) / elevation_beamwidth_rad) ** 2)
    total = 1.0 + field * np.exp(-2j * math.pi / wavelength_m * longer)
    met = (product > 0.0) & (not range_resolution_m or longer < range_resolution_m)
    return unflatten(np.where(met, np.abs(total) ** 4, 1.0), shape)
