"""Extinction of infrared light: clear air, haze, fog and rain in the bands 3-5 µm and 8-12 µm."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from components.arguments.checks import (
    broadcast_flat,
    check_finite,
    check_not_negative,
    check_positive,
    unflatten,
)
from components.atmosphere.standard_atmosphere import (
    SEA_LEVEL_VAPOUR_DENSITY_G_M3,
    VAPOUR_SCALE_HEIGHT_KM,
    standard_atmosphere,
)
from components.atmosphere.visibility import KOSCHMIEDER
from dsa_des.arrays.types import FloatArray

BANDS = {"mwir": (3.0, 5.0), "lwir": (8.0, 12.0)}
"""Wavelengths of the bands, µm."""

_VISIBLE_UM = 0.55
_VAPOUR_SCALE_HEIGHT_M = 1e3 * VAPOUR_SCALE_HEIGHT_KM

# Langer's windows: from, to (µm), A, k, beta and the precipitable water w0 (mm) where the weak
# law exp(-A sqrt(w)) becomes the strong one k (w0 / w)^beta.
_WINDOWS = (
    (2.7, 4.3, 0.373, 0.827, 0.095, 0.26),
    (4.3, 6.0, 0.598, 0.784, 0.122, 0.165),
)

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(8)
_ALONG, _ALONG_WEIGHTS = np.polynomial.legendre.leggauss(5)
_HPA_PER_ATM = 1013.25


def band_wavelengths_um(band: str) -> tuple[float, float]:
    """Return a band's shortest and longest wavelength, µm; ValueError for an unknown name."""
    if band not in BANDS:
        raise ValueError(f"band is {band!r}: it must be one of {', '.join(BANDS)}")
    return BANDS[band]


def precipitable_water_mm(
    range_m: ArrayLike,
    own_alt_m: ArrayLike,
    target_alt_m: ArrayLike,
    sea_level_vapour_density_g_m3: ArrayLike = SEA_LEVEL_VAPOUR_DENSITY_G_M3,
) -> Any:
    """Return the water vapour along a straight path, in mm of liquid water.

    Its density falls by e every 2 km (Recommendation ITU-R P.835); along the path altitude grows
    evenly.

    Parameters
    ----------
    range_m, own_alt_m, target_alt_m : array_like, m
    sea_level_vapour_density_g_m3 : array_like, g/m³

    Returns
    -------
    array of the broadcast shape, mm (1 mm is 1000 g/m²)
    """
    shape, (distance, own, target, density) = broadcast_flat(
        range_m=check_not_negative("range_m", range_m),
        own_alt_m=check_finite("own_alt_m", own_alt_m),
        target_alt_m=check_finite("target_alt_m", target_alt_m),
        density=check_not_negative("sea_level_vapour_density_g_m3", sea_level_vapour_density_g_m3),
    )
    low, climb = np.minimum(own, target), np.abs(target - own) / _VAPOUR_SCALE_HEIGHT_M
    level = climb < 1e-9
    mean = np.where(level, 1.0, -np.expm1(-climb) / np.where(level, 1.0, climb))
    at_low = density * np.exp(-low / _VAPOUR_SCALE_HEIGHT_M)
    return unflatten(1e-3 * at_low * mean * distance, shape)


def mid_wave_transmission(water_mm: ArrayLike) -> Any:
    """Return 3-5 µm transmission (0 to 1) through so much water vapour, a mean over the band.

    Parameters
    ----------
    water_mm : array_like, mm
        Precipitable water along the path, 0 or more.

    Notes
    -----
    T. Elder and J. Strong, "The infrared transmission of atmospheric windows", J. Franklin Inst.
    255, 1953, in the form of R. M. Langer (Signal Corps report DA-36-039-SC-72351, 1957):
    exp(-A sqrt(w)) for little water, k (w0/w)^beta for much, by window; here the windows
    2.7-4.3 µm and 4.3-6.0 µm, each with its share of the band. Absorption in bands of lines does
    not follow Beer's law: the first millimetre takes a third, ten more a fifth. Carbon dioxide's
    own band at 4.3 µm, opaque over any range of interest, is as the windows were measured.
    """
    shape, (water,) = broadcast_flat(water_mm=check_not_negative("water_mm", water_mm))
    low, high = BANDS["mwir"]
    total = np.zeros_like(water)
    for start, end, a, k, beta, w0 in _WINDOWS:
        weak = np.exp(-a * np.sqrt(np.minimum(water, w0)))
        strong = k * np.power(w0 / np.maximum(water, w0), beta)
        share = (min(end, high) - max(start, low)) / (high - low)
        total += share * np.where(water <= w0, weak, strong)
    return unflatten(total, shape)


def continuum_absorption_per_km(
    wavelength_um: ArrayLike,
    *,
    vapour_density_g_m3: ArrayLike,
    temperature_k: ArrayLike = 288.15,
    pressure_hpa: ArrayLike = 1013.25,
) -> Any:
    """Return the absorption by the water vapour continuum between 8 and 14 µm, per km.

    Parameters
    ----------
    wavelength_um : array_like, µm
    vapour_density_g_m3 : array_like, g/m³
    temperature_k : array_like, K
    pressure_hpa : array_like, hPa
        Barometric pressure.

    Notes
    -----
    R. E. Roberts, J. E. A. Selby and L. M. Biberman, "Infrared continuum absorption by atmospheric
    water vapor in the 8-12 µm window", Applied Optics 15, 1976:
    C(ν) = 4.18 + 5578 exp(-7.87e-3 ν) per g/cm² and atm at 296 K (ν in 1/cm), times
    exp(1800 (1/T - 1/296)); absorption C · w · (p_water + 0.002 (p - p_water)). It grows with the
    square of the humidity.
    """
    shape, (wavelength, density, temperature, pressure) = broadcast_flat(
        wavelength_um=check_positive("wavelength_um", wavelength_um),
        vapour_density_g_m3=check_not_negative("vapour_density_g_m3", vapour_density_g_m3),
        temperature_k=check_positive("temperature_k", temperature_k),
        pressure_hpa=check_positive("pressure_hpa", pressure_hpa),
    )
    return unflatten(
        _water_vapour_continuum_per_km(wavelength, density, temperature, pressure), shape
    )


def _water_vapour_continuum_per_km(
    wavelength_um: Any, density: FloatArray, temperature: FloatArray, pressure: FloatArray
) -> FloatArray:
    wavenumber = 1e4 / wavelength_um
    strength = 4.18 + 5578.0 * np.exp(-7.87e-3 * wavenumber)
    strength = strength * np.exp(1800.0 * (1.0 / temperature - 1.0 / 296.0))
    vapour_atm = density * temperature / (216.7 * _HPA_PER_ATM)
    broadening = vapour_atm + 0.002 * (pressure / _HPA_PER_ATM - vapour_atm)
    # g/m³ over a kilometre are 1000 g/m², a tenth of a g/cm².
    water: FloatArray = strength * (0.1 * density) * broadening
    return water


def long_wave_transmission(
    range_m: ArrayLike,
    own_alt_m: ArrayLike,
    target_alt_m: ArrayLike,
    sea_level_vapour_density_g_m3: float = SEA_LEVEL_VAPOUR_DENSITY_G_M3,
) -> Any:
    """Return the 8-12 µm transmission (0 to 1) of clear air, the mean over the band.

    The water vapour continuum (`continuum_absorption_per_km`) in the standard atmosphere, whose
    vapour density at sea level is given, along a straight path on which altitude grows evenly.
    Lines of water vapour and carbon dioxide are left out: they take a further 3 to 8 % per 10 km.
    Arguments are those of `precipitable_water_mm`.
    """
    shape, (distance, own, target) = broadcast_flat(
        range_m=check_not_negative("range_m", range_m),
        own_alt_m=check_finite("own_alt_m", own_alt_m),
        target_alt_m=check_finite("target_alt_m", target_alt_m),
    )
    first, last = BANDS["lwir"]
    wavelengths = (0.5 * (first + last) + 0.5 * (last - first) * _NODES).tolist()
    depth = np.zeros((len(wavelengths), len(distance)))
    for node, weight in zip(_ALONG.tolist(), _ALONG_WEIGHTS.tolist(), strict=True):
        altitude = np.clip(own + (0.5 + 0.5 * node) * (target - own), -5e3, 8e4)
        pressure, temperature, density = standard_atmosphere(
            altitude, sea_level_vapour_density_g_m3=sea_level_vapour_density_g_m3
        )
        for row, wavelength in enumerate(wavelengths):
            depth[row] += (
                0.5
                * weight
                * _water_vapour_continuum_per_km(wavelength, density, temperature, pressure)
            )
    with np.errstate(under="ignore"):
        left = np.exp(-depth * (1e-3 * distance))
    mean = np.zeros_like(distance)
    for row, weight in enumerate(_WEIGHTS.tolist()):
        mean += 0.5 * weight * left[row]
    return unflatten(mean, shape)


def haze_extinction_ratio(visibility_m: ArrayLike, band: str) -> Any:
    """Return the extinction by haze or fog in an infrared band over that of visible light.

    (λ / 0.55 µm)^-q at the band's middle, with q by the visibility V in km: 1.6 above 50, 1.3 from
    6, 0.16 V + 0.34 from 1, V - 0.5 from 0.5, and 0 below: thick fog takes the same from all light.

    Parameters
    ----------
    visibility_m : array_like, m
        Above 0; infinite for none.
    band : {"mwir", "lwir"}

    Returns
    -------
    array of the same shape, in (0, 1]

    Notes
    -----
    P. W. Kruse et al., Elements of Infrared Technology, 1962; q of I. I. Kim, B. McArthur and E.
    Korevaar, "Comparison of laser beam propagation at 785 nm and 1550 nm in fog and haze", Proc.
    SPIE 4214, 2001. It was fitted up to 1.55 µm: what it says of 4 and 10 µm is extrapolated.
    """
    low, high = band_wavelengths_um(band)
    return haze_extinction_ratio_at(visibility_m, 0.5 * (low + high))


def haze_extinction_ratio_at(visibility_m: ArrayLike, wavelength_um: float) -> Any:
    """Return the extinction by haze or fog at one wavelength, divided by that of visible light.

    The law of `haze_extinction_ratio`; for lasers, up to 1.55 µm as it was fitted.
    """
    visibility = np.asarray(visibility_m, dtype=np.float64)
    if not np.all(visibility > 0.0):
        raise ValueError("visibility_m must be above 0 (infinite for none)")
    km = 1e-3 * visibility
    q = np.select(
        [km > 50.0, km > 6.0, km > 1.0, km > 0.5], [1.6, 1.3, 0.16 * km + 0.34, km - 0.5], 0.0
    )
    return np.power(float(check_positive("wavelength_um", wavelength_um)) / _VISIBLE_UM, -q)


def band_extinction_per_m(
    band: str, haze_visibility_m: float | None = None, rain_extinction_per_m: float = 0.0
) -> float:
    """Return the extinction by haze, fog and rain in a band ("mwir" or "lwir"), 1/m.

    `haze_visibility_m` is that in the haze or fog alone; large drops of rain take the same from all
    light.
    """
    band_wavelengths_um(band)
    if haze_visibility_m is None:
        return rain_extinction_per_m
    share = float(haze_extinction_ratio(haze_visibility_m, band))
    return rain_extinction_per_m + KOSCHMIEDER / haze_visibility_m * share
