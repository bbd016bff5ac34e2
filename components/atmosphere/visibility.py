"""Visibility through fog and rain.

Visibility is the meteorologists': the range at which a black object's contrast is down to 2 %, so
extinction per metre is 3.912 / visibility (Koschmieder). What it does to a contrast is computed by
`components.optical.contrast.visibility_transmission`.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from components.arguments.checks import (
    broadcast_flat,
    check_not_negative,
    check_numbers,
    check_positive,
    refuse,
    unflatten,
)

# ln 50, as meteorologists round it: visibility is where a black object's contrast falls to 2 %.
KOSCHMIEDER = 3.912

# Assumption: droplets per cm³ of a continental fog; the relation was fitted for 1 to 400.
FOG_DROPLETS_PER_CM3 = 200.0

# Marshall and Palmer's drop sizes, N0 exp(-ΛD) with N0 = 8000 per m³ and mm and
# Λ = 4.1 R^-0.21 per mm, give π N0 / Λ³ mm²/m³ of twice their cross-section.
_RAIN_EXTINCTION_PER_M = math.pi * 8000.0 / 4.1**3 * 1e-6
_RAIN_EXPONENT = 0.63


def fog_visibility_m(
    liquid_water_g_m3: ArrayLike, droplets_per_cm3: ArrayLike = FOG_DROPLETS_PER_CM3
) -> Any:
    """Return the visibility in fog; infinite where there is no liquid water.

    Parameters
    ----------
    liquid_water_g_m3 : array_like, g/m³
        Liquid water content, 0 or more; fitted from 0.005 to 0.5.
    droplets_per_cm3 : array_like
        Droplet number concentration N_d, above 0; fitted from 1 to 400. The default 200 is an
        assumption; with it the relation agrees with Kunkel's 27 m · LWC^-0.88 to 3 % in thick fog.

    Notes
    -----
    V = 1.002 km · (LWC · N_d)^-0.6473: I. Gultepe, M. D. Müller and Z. Boybeyi, "A new visibility
    parameterization for warm-fog applications in numerical weather prediction models", J. Appl.
    Meteor. Climatol. 45, 2006.
    """
    shape, (water, number) = broadcast_flat(
        liquid_water_g_m3=check_not_negative("liquid_water_g_m3", liquid_water_g_m3),
        droplets_per_cm3=check_positive("droplets_per_cm3", droplets_per_cm3),
    )
    with np.errstate(under="ignore", over="ignore"):  # ends of the number range
        product = water * number
    foggy = product > 0.0
    visibility = 1002.0 * np.power(np.where(foggy, product, 1.0), -0.6473)
    return unflatten(np.where(foggy, visibility, np.inf), shape)


def rain_extinction_per_m(rain_rate_mm_h: ArrayLike) -> Any:
    """Return the extinction of visible and infrared light by rain, per metre.

    Parameters
    ----------
    rain_rate_mm_h : array_like, mm/h
        0 or more.

    Notes
    -----
    Drops are large against the wavelength: each takes twice its cross-section out of the beam. With
    Marshall and Palmer's drop sizes ("The distribution of raindrops with size", J. Meteor. 5, 1948)
    this is 3.65e-4 R^0.63 per metre, 1.58 R^0.63 dB/km; the same numbers are one of the two sets in
    Recommendation ITU-R P.1814 (2007). Half of it is light bent by less than about a milliradian,
    which a camera with wide pixels still collects: an upper bound for a coarse camera.
    """
    shape, (rate,) = broadcast_flat(
        rain_rate_mm_h=check_not_negative("rain_rate_mm_h", rain_rate_mm_h)
    )
    return unflatten(_RAIN_EXTINCTION_PER_M * np.power(rate, _RAIN_EXPONENT), shape)


def rain_visibility_m(rain_rate_mm_h: ArrayLike) -> Any:
    """Return the visibility in rain (m): 3.912 / `rain_extinction_per_m`; infinite without rain."""
    shape, (extinction,) = broadcast_flat(
        extinction=np.asarray(rain_extinction_per_m(rain_rate_mm_h))
    )
    raining = extinction > 0.0
    visibility = KOSCHMIEDER / np.where(raining, extinction, 1.0)
    return unflatten(np.where(raining, visibility, np.inf), shape)


def combined_visibility_m(*visibility_m: ArrayLike) -> Any:
    """Return the visibility through several obscurations at once: their extinctions add.

    Extinctions add, so the reciprocals of the visibilities do.

    Parameters
    ----------
    *visibility_m : array_like, m
        Above 0 each; infinite for clear air.

    Returns
    -------
    array of the broadcast shape, m
        Infinite if nothing obscures.
    """
    arrays = {}
    for number, value in enumerate(visibility_m):
        array = check_numbers("visibility_m", value)
        refuse("visibility_m", array, ~(array > 0.0), "be above 0 (infinite for clear air)")
        arrays[f"visibility_m {number}"] = array
    shape, flat = broadcast_flat(**arrays)
    if len(flat) == 1:
        return unflatten(flat[0].copy(), shape)
    # Relative to the shortest one, so that no reciprocal can overflow.
    shortest = np.full(int(np.prod(shape)), np.inf)
    for array in flat:
        shortest = np.minimum(shortest, array)
    clear = np.isinf(shortest)
    base = np.where(clear, 1.0, shortest)
    total = np.zeros_like(base)
    with np.errstate(under="ignore"):  # a share too small for a double
        for array in flat:
            total += base / np.where(clear, 1.0, array)
    return unflatten(np.where(clear, np.inf, base / total), shape)
