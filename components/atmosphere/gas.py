"""Attenuation of a radio wave by oxygen and water vapour."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from components.arguments.checks import (
    FloatArray,
    broadcast_flat,
    checked_frequency,
    not_negative,
    refuse,
    unflatten,
    within,
)
from components.atmosphere.recommendation_tables import columns

HIGHEST_FREQUENCY_HZ = 1e12


def gas_specific_attenuation(
    frequency_hz: ArrayLike,
    *,
    pressure_hpa: ArrayLike = 1013.25,
    temperature_k: ArrayLike = 288.15,
    vapour_density_g_m3: ArrayLike = 7.5,
) -> Any:
    """Return the specific attenuation of clear air, one way, in dB/km.

    Parameters
    ----------
    frequency_hz : array_like, Hz
        1 GHz to 1 THz.
    pressure_hpa : array_like, hPa
        Barometric pressure, dry air and water vapour together: what a barometer shows.
    temperature_k : array_like, K
        150 to 350 K.
    vapour_density_g_m3 : array_like, g/m³
        0 or more. Its partial pressure (density times temperature / 216.7) must be below the
        barometric pressure.

    Returns
    -------
    array of the broadcast shape, dB/km

    Raises
    ------
    ValueError
        If an argument is out of range.

    Notes
    -----
    Recommendation ITU-R P.676-12 (08/2019), Annex 1: 44 oxygen and 35 water vapour lines, the dry
    continuum, line shapes broadened by pressure, Zeeman effect and Doppler effect.

    The Recommendation's p is the pressure of the *dry* air. ITU's validation sheets put the full
    1013.25 hPa there, which gives 1 % more; to repeat them, add the vapour's pressure to theirs.
    """
    shape, (frequency, pressure, temperature, density) = broadcast_flat(
        frequency_hz=checked_frequency(frequency_hz, HIGHEST_FREQUENCY_HZ),
        pressure_hpa=within("pressure_hpa", pressure_hpa, 0.0, 1e4, "hPa"),
        temperature_k=within("temperature_k", temperature_k, 150.0, 350.0, "K"),
        vapour_density_g_m3=not_negative("vapour_density_g_m3", vapour_density_g_m3),
    )
    vapour_pressure = density * temperature / 216.7
    dry_pressure = pressure - vapour_pressure
    refuse(
        "vapour_density_g_m3",
        density,
        dry_pressure < 0.0,
        "exert a partial pressure below the barometric pressure",
    )
    air = (frequency, dry_pressure, vapour_pressure, 300.0 / temperature)
    refractivity = _oxygen_lines(*air) + _dry_continuum(*air) + _water_vapour_lines(*air)
    return unflatten(0.1820 * frequency * refractivity, shape)


# The lines are added one after the other, not by a reduction over an array, so that an element's
# last bits do not depend on how many elements there are.


def _oxygen_lines(f: FloatArray, p: FloatArray, e: FloatArray, theta: FloatArray) -> FloatArray:
    table = columns("oxygen_lines")
    theta_08 = np.power(theta, 0.8)
    total = np.zeros_like(f)
    names = ("f0_ghz", "a1", "a2", "a3", "a4", "a5", "a6")
    for f0, a1, a2, a3, a4, a5, a6 in zip(*(table[name].tolist() for name in names), strict=True):
        strength = a1 * 1e-7 * p * theta**3 * np.exp(a2 * (1.0 - theta))
        broadened = theta_08 if a4 == 0.0 else np.power(theta, 0.8 - a4)
        width = a3 * 1e-4 * (p * broadened + 1.1 * e * theta)
        width = np.sqrt(width * width + 2.25e-6)  # Zeeman splitting
        interference = (a5 + a6 * theta) * 1e-4 * (p + e) * theta_08
        below, above = f0 - f, f0 + f
        shape = (width - interference * below) / (below * below + width * width)
        shape += (width - interference * above) / (above * above + width * width)
        total += strength * (f / f0) * shape
    return total


def _dry_continuum(f: FloatArray, p: FloatArray, e: FloatArray, theta: FloatArray) -> FloatArray:
    # d·(1 + (f/d)²) written as d + f²/d would divide by 0 in a vacuum; d/(d² + f²) does not.
    d = 5.6e-4 * (p + e) * np.power(theta, 0.8)
    debye = 6.14e-5 * d / (d * d + f * f)
    nitrogen = 1.4e-12 * p * np.power(theta, 1.5) / (1.0 + 1.9e-5 * np.power(f, 1.5))
    return f * p * theta * theta * (debye + nitrogen)


def _water_vapour_lines(
    f: FloatArray, p: FloatArray, e: FloatArray, theta: FloatArray
) -> FloatArray:
    table = columns("water_vapour_lines")
    theta_35 = np.power(theta, 3.5)
    total = np.zeros_like(f)
    names = ("f0_ghz", "b1", "b2", "b3", "b4", "b5", "b6")
    for f0, b1, b2, b3, b4, b5, b6 in zip(*(table[name].tolist() for name in names), strict=True):
        strength = b1 * 1e-1 * e * theta_35 * np.exp(b2 * (1.0 - theta))
        width = b3 * 1e-4 * (p * np.power(theta, b4) + b5 * e * np.power(theta, b6))
        # Doppler broadening.
        width = 0.535 * width + np.sqrt(0.217 * width * width + 2.1316e-12 * f0 * f0 / theta)
        below, above = f0 - f, f0 + f
        shape = width / (below * below + width * width) + width / (above * above + width * width)
        total += strength * (f / f0) * shape
    return total
