"""Horizontal time variables: modified tau and the time to the entry of a circle."""

import numpy as np

from components.well_clear.relative_motion import (
    Horizontal,
    discriminant,
    entry_of_circle_s,
    time_to_closest_s,
)
from dsa_des.arrays.types import BoolArray, FloatArray

#: What a time variable is where its event never comes.
NEVER = -1.0


def modified_tau_s(motion: Horizontal, distance_m: float | FloatArray) -> FloatArray:
    """Return modified tau, (D² − r²)/(r ṙ), where the aircraft close in, else `NEVER`, s."""
    closing = motion.closing_m2_s < 0.0
    rate = np.where(closing, motion.closing_m2_s, 1.0)
    over = (distance_m * distance_m - motion.range_sq_m2) / rate
    return np.asarray(np.where(closing, over, NEVER))


def time_to_entry_s(motion: Horizontal, distance_m: float) -> FloatArray:
    """Return the time to the entry of a circle where the flight meets it, else `NEVER`, s."""
    delta = discriminant(motion, distance_m)
    time_s = entry_of_circle_s(motion, distance_m, np.sqrt(np.maximum(delta, 0.0)))
    return np.asarray(np.where((motion.closing_m2_s < 0.0) & (delta >= 0.0), time_s, NEVER))


def within_time(
    motion: Horizontal, distance_m: float, time_s: float, time_variable: str
) -> BoolArray:
    """Tell whether the flight passes within a distance and its time variable is short enough.

    Parameters
    ----------
    motion : Horizontal
    distance_m, time_s : float
    time_variable : str
        One of `components.well_clear.volume.TIME_VARIABLES`; "none" is never short.
    """
    if time_variable == "none":
        return np.zeros(np.shape(motion.range_sq_m2), dtype=bool)
    if time_variable == "modified_tau":
        variable = modified_tau_s(motion, distance_m)
    elif time_variable == "time_to_closest":
        variable = time_to_closest_s(motion)
    else:
        variable = time_to_entry_s(motion, distance_m)
    still = motion.speed_sq_m2_s2 == 0.0
    passes = np.where(
        still,
        motion.range_sq_m2 <= distance_m * distance_m,
        discriminant(motion, distance_m) >= 0.0,
    )
    return np.asarray(passes & (variable >= 0.0) & (variable <= time_s))
