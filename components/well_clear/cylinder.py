"""When straight flights are inside a cylinder, its boundary left out: NMAC and recovery."""

from typing import Any

import numpy as np

from components.well_clear.nearly import nearly_equal, nearly_zero, surely_less
from components.well_clear.relative_motion import (
    discriminant,
    entry_of_circle_s,
    exit_of_circle_s,
    horizontal_of,
)
from components.well_clear.vertical_interval import Span
from components.well_clear.violation import Relative
from dsa_des.arrays.types import BoolArray, FloatArray


def inside_cylinder(
    distance_m: FloatArray, height_m: FloatArray, horizontal_m: float, vertical_m: float
) -> BoolArray:
    """Tell whether aircraft are within a cylinder now, its boundary left out.

    Parameters
    ----------
    distance_m, height_m : (n,)
        Horizontal distance and difference in height, of any sign.
    horizontal_m, vertical_m : float
        Radius and half of the height.
    """
    return np.asarray((distance_m < horizontal_m) & (np.abs(height_m) < vertical_m))


def cylinder_span(
    horizontal_m: float | FloatArray,
    vertical_m: float | FloatArray,
    relative: Relative,
    begin_s: Any = 0.0,
    end_s: Any = np.inf,
) -> Span:
    """Return from when to when pairs in straight flight are inside a cylinder.

    Parameters
    ----------
    horizontal_m, vertical_m : float or ndarray
        Radius and half of the height.
    relative : six of (n,)
        East, north, up in m and their rates in m/s, ownship less intruder, at time 0.
    begin_s, end_s : float or (n,)
        The times looked at, begin before end.

    Returns
    -------
    Span
        An open interval: touching the cylinder is not entering it. Infinity and minus infinity
        where it is not entered.
    """
    east, north, up, v_east, v_north, climb = (np.asarray(x, dtype=np.float64) for x in relative)
    motion = horizontal_of(east, north, v_east, v_north)
    delta = discriminant(motion, horizontal_m)
    root = np.sqrt(np.maximum(delta, 0.0))
    radius_sq = np.asarray(horizontal_m * horizontal_m)
    still = nearly_zero(v_east) & nearly_zero(v_north)
    near = (motion.range_sq_m2 < radius_sq) & ~nearly_equal(motion.range_sq_m2, radius_sq)
    entry = np.where(still, -np.inf, entry_of_circle_s(motion, horizontal_m, root))
    leave = np.where(still, np.inf, exit_of_circle_s(motion, horizontal_m, root))
    level = nearly_zero(climb)
    speed = np.abs(np.where(level, 1.0, climb))
    along = np.where(climb < 0.0, -up, up)
    entry = np.maximum(entry, np.where(level, -np.inf, (-vertical_m - along) / speed))
    leave = np.minimum(leave, np.where(level, np.inf, (vertical_m - along) / speed))
    some = np.where(still, near, delta > 0.0) & (~level | (np.abs(up) < vertical_m))
    entry = np.minimum(np.maximum(entry, begin_s), end_s)
    leave = np.maximum(np.minimum(leave, end_s), begin_s)
    some = some & surely_less(entry, leave)
    return Span(np.where(some, entry, np.inf), np.where(some, leave, -np.inf))
