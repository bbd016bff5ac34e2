"""Specific attenuation of radio waves by gases, rain and fog (ITU-R P.676, P.838, P.840)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from components.arguments.checks import (
    broadcast_flat,
    check_not_negative,
    check_one_of,
    check_within,
    checked_frequency_ghz,
    refuse,
    unflatten,
)
from components.atmosphere.standard_atmosphere import read_csv_columns, read_csv_rows
from dsa_des.arrays.types import FloatArray

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

    Notes
    -----
    Recommendation ITU-R P.676-12 (08/2019), Annex 1: 44 oxygen and 35 water vapour lines, the dry
    continuum, line shapes broadened by pressure, Zeeman effect and Doppler effect.

    The Recommendation's p is the pressure of the *dry* air. ITU's validation sheets put the full
    1013.25 hPa there, which gives 1 % more; to repeat them, add the vapour's pressure to theirs.
    """
    shape, (frequency, pressure, temperature, density) = broadcast_flat(
        frequency_hz=checked_frequency_ghz(frequency_hz, HIGHEST_FREQUENCY_HZ),
        pressure_hpa=check_within("pressure_hpa", pressure_hpa, 0.0, 1e4, "hPa"),
        temperature_k=check_within("temperature_k", temperature_k, 150.0, 350.0, "K"),
        vapour_density_g_m3=check_not_negative("vapour_density_g_m3", vapour_density_g_m3),
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
    refractivity = (
        _oxygen_refractivity(*air)
        + _dry_continuum_refractivity(*air)
        + _water_vapour_refractivity(*air)
    )
    return unflatten(0.1820 * frequency * refractivity, shape)


# The lines are added one after the other, not by a reduction over an array, so that an element's
# last bits do not depend on how many elements there are.


def _oxygen_refractivity(
    f: FloatArray, p: FloatArray, e: FloatArray, theta: FloatArray
) -> FloatArray:
    table = read_csv_columns("oxygen_lines")
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


def _dry_continuum_refractivity(
    f: FloatArray, p: FloatArray, e: FloatArray, theta: FloatArray
) -> FloatArray:
    # d·(1 + (f/d)²) written as d + f²/d would divide by 0 in a vacuum; d/(d² + f²) does not.
    d = 5.6e-4 * (p + e) * np.power(theta, 0.8)
    debye = 6.14e-5 * d / (d * d + f * f)
    nitrogen = 1.4e-12 * p * np.power(theta, 1.5) / (1.0 + 1.9e-5 * np.power(f, 1.5))
    return f * p * theta * theta * (debye + nitrogen)


def _water_vapour_refractivity(
    f: FloatArray, p: FloatArray, e: FloatArray, theta: FloatArray
) -> FloatArray:
    table = read_csv_columns("water_vapour_lines")
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


# cos 2τ of a polarisation tilted by τ from the horizontal.
POLARISATIONS = {"horizontal": 1.0, "vertical": -1.0, "circular": 0.0}


@dataclass(frozen=True)
class RainCoefficients:
    """Hold k and α of γ = k R^α for one frequency and both linear polarisations."""

    k_horizontal: float  # dB/km at 1 mm/h
    alpha_horizontal: float
    k_vertical: float
    alpha_vertical: float

    def specific_attenuation_db_km(
        self, rain_rate_mm_h: FloatArray, balance: FloatArray
    ) -> FloatArray:
        """Return the attenuation γ in dB/km, one way, for flat arrays of rain rates and of
        polarisation balances (cos 2τ), unchecked.
        """
        horizontal = 0.5 * (1.0 + balance) * self.k_horizontal
        vertical = 0.5 * (1.0 - balance) * self.k_vertical
        k = horizontal + vertical
        alpha = (horizontal * self.alpha_horizontal + vertical * self.alpha_vertical) / k
        return k * np.power(rain_rate_mm_h, alpha)


def rain_coefficients(frequency_hz: float) -> RainCoefficients:
    """Return the rain coefficients of one frequency.

    Parameters
    ----------
    frequency_hz : float, Hz
        1 GHz to 1 THz.

    Notes
    -----
    Recommendation ITU-R P.838-3 (03/2005), eq. 2 and 3 with Tables 1-4.
    """
    decades = math.log10(float(checked_frequency_ghz(float(frequency_hz), HIGHEST_FREQUENCY_HZ)))
    value = {"k_horizontal": 0.0, "k_vertical": 0.0, "alpha_horizontal": 0.0, "alpha_vertical": 0.0}
    for row in read_csv_rows("rain_coefficients"):
        a, b = float(row["a"]), float(row["b"])
        if row["term"] == "gauss":
            value[row["quantity"]] += a * math.exp(-(((decades - b) / float(row["c"])) ** 2))
        else:
            value[row["quantity"]] += a * decades + b
    return RainCoefficients(
        k_horizontal=10.0 ** value["k_horizontal"],
        alpha_horizontal=value["alpha_horizontal"],
        k_vertical=10.0 ** value["k_vertical"],
        alpha_vertical=value["alpha_vertical"],
    )


def horizontal_vertical_balance(polarisation: str | float) -> float:
    """Return cos 2τ of a polarisation: 1 horizontal, -1 vertical, 0 circular.

    Parameters
    ----------
    polarisation : {"horizontal", "vertical", "circular"} or float
        A name, or the tilt τ of a linear polarisation from the horizontal in radians.

    Raises
    ------
    ValueError
        If the name is unknown (the nearest one is named) or the tilt outside ±π.
    """
    if isinstance(polarisation, str):
        return POLARISATIONS[check_one_of("polarisation", polarisation, POLARISATIONS)]
    return math.cos(
        2.0 * float(check_within("polarisation", polarisation, -math.pi, math.pi, "rad"))
    )


def rain_specific_attenuation(
    frequency_hz: float,
    rain_rate_mm_h: ArrayLike,
    *,
    polarisation: str | float = "circular",
    elevation_rad: ArrayLike = 0.0,
) -> Any:
    """Return the specific attenuation of rain, one way, in dB/km.

    Parameters
    ----------
    frequency_hz : float, Hz
        1 GHz to 1 THz.
    rain_rate_mm_h : array_like, mm/h
        0 or more.
    polarisation : {"horizontal", "vertical", "circular"} or float
        A name, or the tilt of a linear polarisation from the horizontal in radians.
    elevation_rad : array_like, rad
        Elevation of the path; with circular polarisation it makes no difference.

    Notes
    -----
    Recommendation ITU-R P.838-3 (03/2005), eq. 1, 4 and 5.
    """
    coefficients = rain_coefficients(frequency_hz)
    shape, (rate, elevation) = broadcast_flat(
        rain_rate_mm_h=check_not_negative("rain_rate_mm_h", rain_rate_mm_h),
        elevation_rad=check_within(
            "elevation_rad", elevation_rad, -math.pi / 2, math.pi / 2, "rad"
        ),
    )
    balance = np.cos(elevation) ** 2 * horizontal_vertical_balance(polarisation)
    return unflatten(coefficients.specific_attenuation_db_km(rate, balance), shape)


HIGHEST_FREQUENCY_IN_FOG_HZ = 200e9


def fog_specific_attenuation_coefficient(frequency_hz: ArrayLike, temperature_k: ArrayLike) -> Any:
    """Return the specific attenuation per liquid water content, K_l in (dB/km)/(g/m³), one way.

    Parameters
    ----------
    frequency_hz : array_like, Hz
        1 to 200 GHz: there the droplets (below 0.01 cm) are small against the wavelength.
    temperature_k : array_like, K
        Of the liquid water, 233.15 to 323.15 K (it can be supercooled).

    Notes
    -----
    Recommendation ITU-R P.840-8 (08/2019), Annex 1, eq. 2-11: Rayleigh absorption by water with a
    double-Debye permittivity.
    """
    shape, (f, temperature) = broadcast_flat(
        frequency_hz=checked_frequency_ghz(frequency_hz, HIGHEST_FREQUENCY_IN_FOG_HZ),
        temperature_k=check_within("temperature_k", temperature_k, 233.15, 323.15, "K"),
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

    Notes
    -----
    Recommendation ITU-R P.840-8, eq. 1.
    """
    water = check_not_negative("liquid_water_g_m3", liquid_water_g_m3)
    return fog_specific_attenuation_coefficient(frequency_hz, temperature_k) * water[()]
