"""The range of a radar in attenuating air."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from components.arguments.checks import broadcast_flat, not_negative, unflatten


def attenuated_range_m(clear_range_m: ArrayLike, specific_attenuation_db_km: ArrayLike) -> Any:
    """Return the range at which a radar has the SNR that it has at `clear_range_m` in a vacuum.

    Parameters
    ----------
    clear_range_m : array_like, m
        Range R0 without attenuation, 0 or more.
    specific_attenuation_db_km : array_like, dB/km
        One way, the same all along the path, 0 or more.

    Returns
    -------
    array of the broadcast shape, m

    Raises
    ------
    ValueError
        If an argument is negative or not finite.

    Notes
    -----
    R exp(κR) = R0 with κ = γ ln(10)/20 solves to R = W(κ R0)/κ, W being Lambert's function: the
    fourth power of the range and both ways through the air, each to the quarter.
    """
    from scipy.special import lambertw

    shape, (clear, attenuation) = broadcast_flat(
        clear_range_m=not_negative("clear_range_m", clear_range_m),
        attenuation=not_negative("specific_attenuation_db_km", specific_attenuation_db_km),
    )
    with np.errstate(under="ignore"):  # a product too small for a double changes no range
        product = clear * (attenuation * (math.log(10.0) / 20.0 * 1e-3))
    # W(x)/x is 1 - x + …: below 1e-17 the air makes no difference.
    matters = product > 1e-17
    argument = np.where(matters, product, 1.0)
    shrink = np.where(matters, lambertw(argument).real / argument, 1.0)
    return unflatten(clear * shrink, shape)
