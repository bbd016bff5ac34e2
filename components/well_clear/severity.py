"""How bad a loss of well clear is: its severity (SLoWC), and the probability of a collision."""

from typing import Any

import numpy as np

from components.arguments.units import FOOT_M
from components.well_clear.relative_motion import horizontal_products, time_to_closest_s
from components.well_clear.volume import Relative
from dsa_des.arrays.types import FloatArray


def horizontal_miss_distance_m(relative: Relative) -> FloatArray:
    """Return horizontal distance, m, at closest approach in straight flight, or now if past."""
    east, north, _, v_east, v_north, _ = relative
    motion = horizontal_products(east, north, v_east, v_north)
    ahead_s = np.maximum(time_to_closest_s(motion), 0.0)
    return np.hypot(east + ahead_s * v_east, north + ahead_s * v_north)


def loss_severity_percent(
    relative: Relative,
    horizontal_m: float = 4000 * FOOT_M,
    vertical_m: float = 450 * FOOT_M,
    horizontal_time_s: float = 35.0,
) -> FloatArray:
    """Return the severity of a loss of well clear, percent.

    Parameters
    ----------
    relative : six of (n,)
        East, north, up in m and their rates in m/s, ownship less intruder.
    horizontal_m, vertical_m, horizontal_time_s : float
        The boundary; those of DO-365 by default.

    Returns
    -------
    (n,)
        0 where one of range, miss distance and height is clear, 100 where all three are nil. Of an
        encounter, the largest counts.

    Notes
    -----
    Range over the range at which modified tau is reached, horizontal miss distance and height, each
    capped at 1, are combined by the Fernandez-Guasti norm: 1 - norm² = (1 - x²)(1 - y²). As in the
    MIT Lincoln Laboratory encounter tools (DEGAS).
    """
    east, north, up, v_east, v_north, _ = relative
    range_m = np.hypot(east, north)
    at = np.maximum(range_m, np.finfo(float).tiny)
    rate_mps = np.where(range_m > 0.0, (east * v_east + north * v_north) / at, 0.0)
    reach = rate_mps * horizontal_time_s
    scale = np.maximum(horizontal_m, 0.5 * (np.sqrt(reach * reach + 4.0 * horizontal_m**2) - reach))
    clear = [
        np.minimum(range_m / scale, 1.0),
        np.minimum(horizontal_miss_distance_m(relative) / horizontal_m, 1.0),
        np.minimum(np.abs(up) / vertical_m, 1.0),
    ]
    depth = (1.0 - clear[0] ** 2) * (1.0 - clear[1] ** 2) * (1.0 - clear[2] ** 2)
    # 1 - sqrt(1 - depth), without the difference of nearly equal numbers for a small depth.
    return np.asarray(100.0 * depth / (1.0 + np.sqrt(1.0 - depth)))


#: Highest altitude of each layer below the last, m.
LAYER_TOPS_M = np.array([2300.0, 5000.0, 10_000.0, 20_000.0, 41_000.0]) * FOOT_M
#: Scale of the Laplace distribution of an altimeter's error by layer, m (ICAO).
SCALE_M = np.array([35.0, 38.0, 43.0, 58.0, 72.0, 94.0]) * FOOT_M
#: Of transponders without such an altimeter: the chance to have its scale, and the other scale, m.
GOOD_CHANCE = np.array([0.391, 0.320, 0.345, 0.610, 0.610, 0.610])
POOR_SCALE_M = np.array([60.0, 60.0, 69.0, 87.0, 101.0, 101.0]) * FOOT_M


def altimeter_error_mixture(
    altitude_m: Any, mode_c: bool
) -> tuple[tuple[FloatArray, FloatArray], ...]:
    """Return (probability, Laplace scale in m) per altimeter kind: two with Mode C, else one."""
    layer = np.searchsorted(LAYER_TOPS_M, np.asarray(altitude_m), side="left")
    if not mode_c:
        return ((np.ones(np.shape(layer)), SCALE_M[layer]),)
    good = GOOD_CHANCE[layer]
    return ((good, SCALE_M[layer]), (1.0 - good, POOR_SCALE_M[layer]))


def laplace_difference_exceedance(height_m: Any, scale_m: Any, other_scale_m: Any) -> FloatArray:
    """Return the probability that the difference of two independent Laplace errors is greater than
    `height_m`, which may be negative.

    With c = 1/λ of either error, the tail is a mixture of exponentials; nearly equal scales are
    taken through the limit, whose error is of second order in their difference.
    """
    one, other = np.asarray(scale_m, dtype=float), np.asarray(other_scale_m, dtype=float)
    x = np.abs(np.asarray(height_m, dtype=float))
    mean = 0.5 * (one + other)
    alike = np.abs(one - other) < 1e-6 * mean
    apart = np.where(alike, 1.0, one * one - other * other)
    tail = np.where(
        alike,
        0.5 * np.exp(-x / mean) * (1.0 + x / (2.0 * mean)),
        (one * one * np.exp(-x / one) - other * other * np.exp(-x / other)) / (2.0 * apart),
    )
    return np.asarray(np.where(np.asarray(height_m) >= 0.0, tail, 1.0 - tail))


def collision_probability(
    miss_distance_m: Any,
    height_m: Any,
    altitude_m: tuple[Any, Any],
    mode_c: tuple[bool, bool] = (False, False),
    horizontal_m: float = 500 * FOOT_M,
    vertical_m: float = 100 * FOOT_M,
) -> FloatArray:
    """Return the near mid-air collision probability at closest approach given altimeter errors.

    Parameters
    ----------
    miss_distance_m, height_m : (n,)
        Horizontal miss distance, and difference of the measured altitudes there.
    altitude_m : two of (n,)
        Altitude of ownship and intruder.
    mode_c : two of bool
        Whether each one's altimeter is that of Mode C, or of no transponder.
    horizontal_m, vertical_m : float

    Returns
    -------
    (n,)
        0 where the miss distance is not below `horizontal_m`.
    """
    height = np.asarray(height_m, dtype=float)
    within = np.zeros(np.shape(height))
    for chance, scale in altimeter_error_mixture(altitude_m[0], mode_c[0]):
        for other_chance, other in altimeter_error_mixture(altitude_m[1], mode_c[1]):
            inside = laplace_difference_exceedance(
                -vertical_m - height, scale, other
            ) - laplace_difference_exceedance(vertical_m - height, scale, other)
            within = within + chance * other_chance * inside
    return np.asarray(np.where(np.asarray(miss_distance_m) < horizontal_m, within, 0.0))
