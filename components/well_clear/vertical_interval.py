"""When the vertical condition of a volume holds in straight flight."""

from typing import NamedTuple

import numpy as np

from components.well_clear.nearly import nearly_zero
from dsa_des.arrays.types import FloatArray


class Span(NamedTuple):
    """From when to when something holds, s; infinity to minus infinity where it never does."""

    begin_s: FloatArray
    end_s: FloatArray


def vertical_span(
    height_m: FloatArray,
    climb_mps: FloatArray,
    vertical_m: float,
    vertical_time_s: float,
    begin_s: float | FloatArray,
    end_s: float | FloatArray,
) -> Span:
    """Return when the height difference, or its time, is small enough.

    Parameters
    ----------
    height_m, climb_mps : ndarray
        Relative height and its rate.
    vertical_m, vertical_time_s : float
        As in `components.well_clear.volume.Volume`.
    begin_s, end_s : float or ndarray
        The times looked at.

    Returns
    -------
    Span
        Within [begin, end]. A level flight is inside all the time or never.
    """
    level = nearly_zero(climb_mps)
    rate = np.where(level, 1.0, climb_mps)
    ahead = vertical_m if vertical_time_s == 0.0 else None
    if ahead is None:
        reach: FloatArray | float = np.maximum(vertical_m, vertical_time_s * np.abs(climb_mps))
    else:
        reach = ahead
    # In the direction of the motion: from `reach` before level to `vertical_m` beyond.
    speed = np.abs(rate)
    along = np.where(rate < 0.0, -height_m, height_m)
    entry = (-reach - along) / speed
    leave = (vertical_m - along) / speed
    inside = level & (np.abs(height_m) <= vertical_m)
    never = np.where(level, ~inside, (entry > end_s) | (leave < begin_s))
    entry = np.where(inside, begin_s, np.minimum(np.maximum(entry, begin_s), end_s))
    leave = np.where(inside, end_s, np.minimum(np.maximum(leave, begin_s), end_s))
    return Span(np.where(never, np.inf, entry), np.where(never, -np.inf, leave))
