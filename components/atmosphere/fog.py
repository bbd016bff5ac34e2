"""Attenuation of a radio wave by the droplets of fog and cloud."""

from __future__ import annotations

from typing import Any

from numpy.typing import ArrayLike

from components.arguments.checks import (
    broadcast_flat,
    checked_frequency,
    not_negative,
    unflatten,
    within,
)

HIGHEST_FREQUENCY_HZ = 200e9


def fog_specific_attenuation_coefficient(frequency_hz: ArrayLike, temperature_k: ArrayLike) -> Any:
    """Return the specific attenuation per liquid water content, K_l in (dB/km)/(g/m³), one way.

    Parameters
    ----------
    frequency_hz : array_like, Hz
        1 to 200 GHz: there the droplets (below 0.01 cm) are small against the wavelength.
    temperature_k : array_like, K
        Of the liquid water, 233.15 to 323.15 K (it can be supercooled).

    Returns
    -------
    array of the broadcast shape, (dB/km)/(g/m³)

    Raises
    ------
    ValueError
        If an argument is out of range.

    Notes
    -----
    Recommendation ITU-R P.840-8 (08/2019), Annex 1, eq. 2-11: Rayleigh absorption by water with a
    double-Debye permittivity.
    """
    shape, (f, temperature) = broadcast_flat(
        frequency_hz=checked_frequency(frequency_hz, HIGHEST_FREQUENCY_HZ),
        temperature_k=within("temperature_k", temperature_k, 233.15, 323.15, "K"),
    )
    excess = 300.0 / temperature - 1.0
    static = 77.66 + 103.3 * excess
    middle = 0.0671 * static
    optical = 3.52
    principal_ghz = 20.20 - 146.0 * excess + 316.0 * excess * excess
    secondary_ghz = 39.8 * principal_ghz
    first, second = f / principal_ghz, f / secondary_ghz
    first_strength = (static - middle) / (1.0 + first * first)
    second_strength = (middle - optical) / (1.0 + second * second)
    real = first_strength + second_strength + optical
    imaginary = first * first_strength + second * second_strength
    eta = (2.0 + real) / imaginary
    return unflatten(0.819 * f / (imaginary * (1.0 + eta * eta)), shape)


def fog_specific_attenuation(
    frequency_hz: ArrayLike, liquid_water_g_m3: ArrayLike, temperature_k: ArrayLike = 283.15
) -> Any:
    """Return the specific attenuation of fog or cloud, one way, in dB/km.

    Parameters
    ----------
    frequency_hz, temperature_k : array_like
        As for `fog_specific_attenuation_coefficient`; 10 °C by default.
    liquid_water_g_m3 : array_like, g/m³
        Liquid water content, 0 or more. The Recommendation gives 0.05 for medium fog (visibility
        about 300 m) and 0.5 for thick fog (about 50 m).

    Returns
    -------
    array of the broadcast shape, dB/km

    Raises
    ------
    ValueError
        If an argument is out of range.

    Notes
    -----
    Recommendation ITU-R P.840-8, eq. 1.
    """
    water = not_negative("liquid_water_g_m3", liquid_water_g_m3)
    return fog_specific_attenuation_coefficient(frequency_hz, temperature_k) * water[()]
