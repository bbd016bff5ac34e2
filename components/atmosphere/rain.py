"""Attenuation of a radio wave by rain."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from components.arguments.checks import (
    FloatArray,
    broadcast_flat,
    checked_frequency,
    not_negative,
    one_of,
    unflatten,
    within,
)
from components.atmosphere.recommendation_tables import rows

HIGHEST_FREQUENCY_HZ = 1e12

# cos 2τ of a polarisation tilted by τ from the horizontal.
POLARISATIONS = {"horizontal": 1.0, "vertical": -1.0, "circular": 0.0}


@dataclass(frozen=True)
class RainCoefficients:
    """Hold k and α of γ = k R^α for one frequency and both linear polarisations.

    Parameters
    ----------
    k_horizontal, k_vertical : float
        dB/km at 1 mm/h.
    alpha_horizontal, alpha_vertical : float
    """

    k_horizontal: float
    alpha_horizontal: float
    k_vertical: float
    alpha_vertical: float

    def specific_attenuation(self, rain_rate_mm_h: FloatArray, balance: FloatArray) -> FloatArray:
        """Return γ in dB/km for flat arrays of checked rain rates and polarisation balances.

        Parameters
        ----------
        rain_rate_mm_h : (m,) array, mm/h
        balance : (m,) array
            cos² of the path's elevation times cos 2τ, in [-1, 1].
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

    Returns
    -------
    RainCoefficients

    Raises
    ------
    ValueError
        If the frequency is out of range.

    Notes
    -----
    Recommendation ITU-R P.838-3 (03/2005), eq. 2 and 3 with Tables 1-4.
    """
    decades = math.log10(float(checked_frequency(float(frequency_hz), HIGHEST_FREQUENCY_HZ)))
    value = {"k_horizontal": 0.0, "k_vertical": 0.0, "alpha_horizontal": 0.0, "alpha_vertical": 0.0}
    for row in rows("rain_coefficients"):
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


def polarisation_balance(polarisation: str | float) -> float:
    """Return cos 2τ of a polarisation: 1 horizontal, -1 vertical, 0 circular.

    Parameters
    ----------
    polarisation : {"horizontal", "vertical", "circular"} or float
        A name, or the tilt τ of a linear polarisation from the horizontal in radians.

    Returns
    -------
    float

    Raises
    ------
    ValueError
        If the name is unknown (the nearest one is named) or the tilt outside ±π.
    """
    if isinstance(polarisation, str):
        return POLARISATIONS[one_of("polarisation", polarisation, POLARISATIONS)]
    return math.cos(2.0 * float(within("polarisation", polarisation, -math.pi, math.pi, "rad")))


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

    Returns
    -------
    array of the broadcast shape, dB/km

    Raises
    ------
    ValueError
        If an argument is out of range or the polarisation unknown.

    Notes
    -----
    Recommendation ITU-R P.838-3 (03/2005), eq. 1, 4 and 5.
    """
    coefficients = rain_coefficients(frequency_hz)
    shape, (rate, elevation) = broadcast_flat(
        rain_rate_mm_h=not_negative("rain_rate_mm_h", rain_rate_mm_h),
        elevation_rad=within("elevation_rad", elevation_rad, -math.pi / 2, math.pi / 2, "rad"),
    )
    balance = np.cos(elevation) ** 2 * polarisation_balance(polarisation)
    return unflatten(coefficients.specific_attenuation(rate, balance), shape)
