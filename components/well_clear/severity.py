"""Severity of a loss of well clear (SLoWC): how deep the three dimensions are penetrated."""

import numpy as np

from components.well_clear.relative_motion import horizontal_of, time_to_closest_s
from components.well_clear.violation import Relative
from components.well_clear.volume import FOOT_M
from dsa_des.arrays.types import FloatArray


def miss_distance_m(relative: Relative) -> FloatArray:
    """Return the horizontal miss distance of straight flights, the distance now if it is past.

    Parameters
    ----------
    relative : six of (n,)
        East, north, up in m and their rates in m/s, ownship less intruder.
    """
    east, north, _, v_east, v_north, _ = relative
    motion = horizontal_of(east, north, v_east, v_north)
    ahead_s = np.maximum(time_to_closest_s(motion), 0.0)
    return np.hypot(east + ahead_s * v_east, north + ahead_s * v_north)


def loss_severity(
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
        np.minimum(miss_distance_m(relative) / horizontal_m, 1.0),
        np.minimum(np.abs(up) / vertical_m, 1.0),
    ]
    depth = (1.0 - clear[0] ** 2) * (1.0 - clear[1] ** 2) * (1.0 - clear[2] ** 2)
    # 1 - sqrt(1 - depth), without the difference of nearly equal numbers for a small depth.
    return np.asarray(100.0 * depth / (1.0 + np.sqrt(1.0 - depth)))
