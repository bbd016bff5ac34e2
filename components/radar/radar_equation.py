"""The SNR that the radar equation gives, and the range below which it does not hold."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from components.arguments.checks import (
    FloatArray,
    broadcast_flat,
    finite,
    not_negative,
    positive,
    unflatten,
)

SPEED_OF_LIGHT_M_S = 299_792_458.0
BOLTZMANN_J_K = 1.380649e-23
REFERENCE_TEMPERATURE_K = 290.0

LARGEST_DB = 300.0
_LARGEST = float(np.finfo(np.float64).max)
SMALLEST_MINIMUM_RANGE_M = 1e-3


def wavelength(frequency_hz: ArrayLike) -> Any:
    """Return the wavelength in metres of a frequency in hertz.

    Raises
    ------
    ValueError
        If the frequency is not finite and above 0.
    """
    return SPEED_OF_LIGHT_M_S / positive("frequency_hz", frequency_hz)[()]


def radar_constant(
    *,
    power_w: float,
    antenna_gain_db: float,
    wavelength_m: float,
    bandwidth_hz: float,
    integration_gain_db: float = 0.0,
    noise_figure_db: float = 0.0,
    losses_db: float = 0.0,
) -> float:
    """Return what RCS/range⁴ is multiplied with to give the SNR, in m².

    The result is Pt G² λ² G_I / ((4 pi)³ k T0 F B L) with T0 = 290 K.

    Parameters
    ----------
    power_w : float
        Transmitted power Pt.
    antenna_gain_db : float
        G, the same antenna for transmitting and receiving.
    wavelength_m, bandwidth_hz : float
    integration_gain_db : float
        Coherent integration gain G_I. Do not count the same pulses again as `pulses`.
    noise_figure_db, losses_db : float
        F and L.

    Returns
    -------
    float
        m²

    Raises
    ------
    ValueError
        If a quantity is not above 0 or a decibel value is not finite.

    Notes
    -----
    Thesis eq. 7 and 8, completed by the gain G_I, the noise figure F and the losses L, which
    Table 2.2 lists (G_I, F) or forgets (L).
    """
    quantities = {
        "power_w": power_w,
        "wavelength_m": wavelength_m,
        "bandwidth_hz": bandwidth_hz,
    }
    for name, value in quantities.items():
        positive(name, value)
    decibels = {
        "antenna_gain_db": antenna_gain_db,
        "integration_gain_db": integration_gain_db,
        "noise_figure_db": noise_figure_db,
        "losses_db": losses_db,
    }
    for name, value in decibels.items():
        if not abs(float(finite(name, value))) <= LARGEST_DB:
            raise ValueError(f"{name} is {value:g}: it must lie in ±{LARGEST_DB:g} dB")
    total_db = 2.0 * antenna_gain_db + integration_gain_db - noise_figure_db - losses_db
    noise_w = BOLTZMANN_J_K * REFERENCE_TEMPERATURE_K * bandwidth_hz
    return (
        power_w
        * wavelength_m
        * wavelength_m
        * 10.0 ** (total_db / 10.0)
        / ((4.0 * math.pi) ** 3 * noise_w)
    )


def checked_minimum_range(minimum_range_m: float) -> float:
    """Return the minimum range as a float, or refuse one below 1 mm."""
    nearest = float(positive("minimum_range_m", minimum_range_m))
    if nearest < SMALLEST_MINIMUM_RANGE_M:
        raise ValueError(f"minimum_range_m is {nearest:g}: it must be at least 0.001")
    return nearest


def snr(
    range_m: ArrayLike, rcs_m2: ArrayLike, *, constant_m2: float, minimum_range_m: float
) -> Any:
    """Return the SNR per look, or 0 closer than the minimum range.

    Closer than `minimum_range_m` the far-field equation does not hold and the receiver is still
    blind from its own pulse: no echo is processed, and the SNR is 0. So range 0 is finite.

    Parameters
    ----------
    range_m : array_like, m
        Slant range, 0 or more.
    rcs_m2 : array_like, m²
        Radar cross-section, 0 or more; broadcasts with the range.
    constant_m2 : float
        From `radar_constant`.
    minimum_range_m : float
        At least 1 mm.

    Returns
    -------
    array of the broadcast shape, linear power ratio

    Raises
    ------
    ValueError
        If an argument is negative or not finite.
    """
    constant_m2 = float(positive("constant_m2", constant_m2))
    nearest = checked_minimum_range(minimum_range_m)
    shape, (distance, rcs) = broadcast_flat(
        range_m=not_negative("range_m", range_m), rcs_m2=not_negative("rcs_m2", rcs_m2)
    )
    return unflatten(echo_snr(distance, rcs, constant_m2, nearest), shape)


def echo_snr(
    distance: FloatArray, rcs: FloatArray, constant_m2: float, nearest: float
) -> FloatArray:
    """`snr` for flat contiguous arrays of one shape, all arguments checked."""
    near = distance < nearest
    safe = np.where(near, nearest, distance)
    # Both factors are divided by the square: neither the fourth power of a large range nor their
    # product overflows on the way. An echo from the end of the number range is 0.
    with np.errstate(under="ignore", over="ignore"):
        square = safe * safe
        echo = (constant_m2 / square) * (rcs / square)
    return np.where(near, 0.0, np.minimum(echo, _LARGEST))
