"""How far apart aircraft are and will be: the quantities of an alerting table."""

from typing import NamedTuple

import numpy as np

from components.well_clear.horizontal_time import modified_tau_s
from components.well_clear.nearly import nearly_zero
from components.well_clear.relative_motion import horizontal_of, time_to_closest_s
from components.well_clear.violation import Relative
from dsa_des.arrays.types import FloatArray


class PairSeparation(NamedTuple):
    """Present and projected distances of pairs of aircraft, each (n,).

    Parameters
    ----------
    horizontal_m, vertical_m : ndarray
        Distances now.
    horizontal_mps, vertical_mps : ndarray
        Relative speeds (not rates of the distances).
    miss_horizontal_m, miss_vertical_m : ndarray
        Projected closest distances within the lookahead.
    time_to_closest_s, closest_m : ndarray
        Of the horizontal closest approach; 0 and the distance now if it is past.
    time_to_level_s : ndarray
        Until the aircraft are at one height; NaN where they do not come closer.
    modified_tau_s : ndarray
        NaN where the aircraft are within the distance or do not come closer.
    """

    horizontal_m: FloatArray
    vertical_m: FloatArray
    horizontal_mps: FloatArray
    vertical_mps: FloatArray
    miss_horizontal_m: FloatArray
    miss_vertical_m: FloatArray
    time_to_closest_s: FloatArray
    closest_m: FloatArray
    time_to_level_s: FloatArray
    modified_tau_s: FloatArray


def separation(
    relative: Relative, lookahead_s: float, tau_distance_m: FloatArray
) -> PairSeparation:
    """Return present and projected distances in straight flight.

    Parameters
    ----------
    relative : six of (n,)
        East, north, up in m and their rates in m/s, ownship less intruder.
    lookahead_s : float
        How far ahead is looked.
    tau_distance_m : (n,)
        The distance of modified tau; NaN gives none.
    """
    east, north, up, v_east, v_north, climb = relative
    motion = horizontal_of(east, north, v_east, v_north)
    range_m = np.sqrt(motion.range_sq_m2)
    closest_s = time_to_closest_s(motion)
    ahead_s = np.maximum(closest_s, 0.0)
    seen_s = np.minimum(ahead_s, lookahead_s)
    closing = motion.closing_m2_s < 0.0
    moving = ~nearly_zero(climb)
    level_s = -up / np.where(moving, climb, 1.0)
    level_s = np.where(moving & (level_s >= 0.0), level_s, np.nan)
    approach = up * climb < 0.0
    passes = approach & (np.where(approach, -up / np.where(climb == 0, 1, climb), 0) <= lookahead_s)
    later_m = np.where(passes, 0.0, np.abs(up + climb * lookahead_s))
    distance = np.where(np.isnan(tau_distance_m), 0.0, tau_distance_m)
    tau_s = np.where(
        (motion.range_sq_m2 > tau_distance_m * tau_distance_m) & closing,
        modified_tau_s(motion, distance),
        np.nan,
    )
    return PairSeparation(
        range_m,
        np.abs(up),
        np.sqrt(motion.speed_sq_m2_s2),
        np.abs(climb),
        np.where(closing, np.hypot(east + seen_s * v_east, north + seen_s * v_north), range_m),
        np.where(approach, later_m, np.abs(up)),
        ahead_s,
        np.hypot(east + ahead_s * v_east, north + ahead_s * v_north),
        level_s,
        tau_s,
    )
