"""When straight flights violate a volume: now, and over an interval in closed form."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from components.well_clear.horizontal_interval import horizontal_span
from components.well_clear.horizontal_time import within_time
from components.well_clear.nearly import surely_less
from components.well_clear.relative_motion import horizontal_of
from components.well_clear.vertical_interval import Span, vertical_span
from components.well_clear.volume import Volume
from dsa_des.arrays.types import BoolArray, FloatArray

#: Position east, north, up (m) and velocity (m/s) of the ownship less the intruder's.
Relative = Sequence[Any]


def violates(volume: Volume, relative: Relative) -> BoolArray:
    """Tell whether pairs of aircraft violate a volume now.

    Parameters
    ----------
    volume : Volume
    relative : six of (n,)
        East, north, up in m and their rates in m/s, ownship less intruder.

    Returns
    -------
    (n,) of bool
    """
    east, north, up, v_east, v_north, climb = _arrays(relative)
    motion = horizontal_of(east, north, v_east, v_north)
    radius_m = volume.horizontal_m
    near = (motion.range_sq_m2 <= radius_m * radius_m) | within_time(
        motion, radius_m, volume.horizontal_time_s, volume.time_variable
    )
    closing = (climb != 0.0) & (up * climb <= 0.0)
    soon = closing & (np.abs(up) <= volume.vertical_time_s * np.abs(climb))
    return np.asarray(near & ((np.abs(up) <= volume.vertical_m) | soon))


def violation_span(
    volume: Volume, relative: Relative, begin_s: Any = 0.0, end_s: Any = np.inf
) -> Span:
    """Return from when to when pairs of aircraft in straight flight violate a volume.

    Parameters
    ----------
    volume : Volume
    relative : six of (n,)
        As for `violates`, at time 0; they may be broadcast against each other.
    begin_s, end_s : float or (n,)
        The times looked at, begin not after end.

    Returns
    -------
    Span
        Entry and exit (n,), s; infinity and minus infinity where there is no violation. A flight
        that only touches the volume, for no longer than rounding, does not violate it.

    Notes
    -----
    The vertical condition holds in one interval; within it the horizontal one is a quadratic,
    solved in the form whose terms do not cancel.
    """
    east, north, up, v_east, v_north, climb = _arrays(relative)
    vertical = vertical_span(up, climb, volume.vertical_m, volume.vertical_time_s, begin_s, end_s)
    some = surely_less(vertical.begin_s, vertical.end_s)
    start = np.where(some, vertical.begin_s, 0.0)
    motion = horizontal_of(east + start * v_east, north + start * v_north, v_east, v_north)
    duration = np.where(some, vertical.end_s - start, 0.0)
    within = horizontal_span(motion, volume, duration)
    entry, leave = start + within.begin_s, start + within.end_s
    some &= surely_less(entry, leave)
    return Span(np.where(some, entry, np.inf), np.where(some, leave, -np.inf))


def _arrays(relative: Relative) -> list[FloatArray]:
    return [np.asarray(part, dtype=np.float64) for part in relative]
