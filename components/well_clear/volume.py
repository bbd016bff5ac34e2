"""Volumes around an aircraft, those of the standards, and when straight flights violate them."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np

from components.arguments.units import FOOT_M, NAUTICAL_MILE_M
from components.well_clear.relative_motion import (
    Horizontal,
    Span,
    discriminant,
    entry_of_circle_s,
    exit_of_circle_s,
    horizontal_products,
    is_surely_less,
    meets_within_time,
    nearly_equal,
    nearly_zero,
    time_to_closest_s,
    vertical_span,
)
from dsa_des.arrays.types import BoolArray, FloatArray

#: How time enters the horizontal condition.
TIME_VARIABLES = ("modified_tau", "time_to_closest", "time_to_entry", "none")


@dataclass(frozen=True)
class Volume:
    """A volume that is violated horizontally and vertically at once.

    Horizontally: the range is at most `horizontal_m`, or the aircraft will pass within it and the
    time variable lies in [0, `horizontal_time_s`]. Vertically: the height difference is at most
    `vertical_m`, or the aircraft approach each other and are level within `vertical_time_s`.

    C. Muñoz, A. Narkawicz, J. Chamberlain et al., "A family of well-clear boundary models for the
    integration of UAS in the NAS", AIAA Aviation 2014.
    """

    horizontal_m: float  # Above 0, m
    vertical_m: float
    horizontal_time_s: float = 0.0  # Not negative, s; 0 leaves the sizes alone
    vertical_time_s: float = 0.0
    time_variable: str = "modified_tau"

    def __post_init__(self) -> None:
        """Refuse sizes that mean nothing."""
        for name in ("horizontal_m", "vertical_m"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0.0):
                raise ValueError(f"{name} is {value}: it must be finite and above 0")
        for name in ("horizontal_time_s", "vertical_time_s"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= 0.0):
                raise ValueError(f"{name} is {value}: it must be finite and not negative")
        if self.time_variable not in TIME_VARIABLES:
            raise ValueError(
                f"time_variable is {self.time_variable!r}: it must be one of "
                f"{', '.join(TIME_VARIABLES)}"
            )


#: The volumes of RTCA DO-365B, of ASTM F3442 and of a near mid-air collision.
PRESETS: Mapping[str, Volume] = MappingProxyType(
    {
        "do365_en_route": Volume(0.66 * NAUTICAL_MILE_M, 450 * FOOT_M, 35.0),
        "do365_preventive": Volume(0.66 * NAUTICAL_MILE_M, 700 * FOOT_M, 35.0),
        "do365_terminal": Volume(1500 * FOOT_M, 450 * FOOT_M, time_variable="none"),
        "do365_non_cooperative": Volume(2200 * FOOT_M, 450 * FOOT_M, time_variable="none"),
        "astm_f3442": Volume(2000 * FOOT_M, 250 * FOOT_M, time_variable="none"),
        "nmac": Volume(500 * FOOT_M, 100 * FOOT_M, time_variable="none"),
    }
)


def horizontal_span(motion: Horizontal, volume: Volume, duration_s: float | FloatArray) -> Span:
    """Return when, in 0 to `duration_s`, the horizontal condition of a volume holds.

    It is one interval: the set is convex for every time variable.
    """
    radius_m = volume.horizontal_m
    p, speed_sq = motion.closing_m2_s, motion.speed_sq_m2_s2
    delta = discriminant(motion, radius_m)
    root = np.sqrt(np.maximum(delta, 0.0))
    still = nearly_zero(speed_sq)
    inside = motion.range_sq_m2 <= radius_m * radius_m
    leave = exit_of_circle_s(motion, radius_m, root)
    leave = np.where(inside & still, duration_s, np.minimum(leave, duration_s))
    entry, ahead = _entry_time_and_possible_mask(motion, volume, delta, root, still)
    entry = np.where(inside, 0.0, np.maximum(entry, 0.0))
    met = inside | (ahead & (delta >= 0.0) & (p <= 0.0) & (entry <= duration_s))
    return Span(np.where(met, entry, np.inf), np.where(met, leave, -np.inf))


def _entry_time_and_possible_mask(
    motion: Horizontal, volume: Volume, delta: FloatArray, root: FloatArray, still: BoolArray
) -> tuple[FloatArray, BoolArray]:
    """Return when pairs outside the radius meet the horizontal condition, and which may enter."""
    tau_s = volume.horizontal_time_s
    if volume.time_variable == "modified_tau":
        return _modified_tau_entry(motion, volume, delta), motion.closing_m2_s < 0.0
    circle = entry_of_circle_s(motion, volume.horizontal_m, root)
    if volume.time_variable == "time_to_closest":
        return np.minimum(circle, time_to_closest_s(motion) - tau_s), ~still
    if volume.time_variable == "time_to_entry":
        return circle - tau_s, ~still
    return circle, ~still


def _modified_tau_entry(motion: Horizontal, volume: Volume, delta: FloatArray) -> FloatArray:
    """Return when, s, modified tau meets its threshold, r²(t) + τ s·v(t) = D²; 0 if it has passed.

    Its discriminant is 4Δ(D) + (τ v²)², a sum without cancellation where the flight meets the
    circle. Where the constant term is not positive, the condition holds now.
    """
    tau_s, radius_m = volume.horizontal_time_s, volume.horizontal_m
    a, p = motion.speed_sq_m2_s2, motion.closing_m2_s
    linear = 2.0 * p + tau_s * a
    constant = np.maximum(motion.range_sq_m2 + tau_s * p - radius_m * radius_m, 0.0)
    below = np.sqrt(4.0 * np.maximum(delta, 0.0) + (tau_s * a) ** 2) - linear
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        return np.asarray(np.where(constant > 0.0, 2.0 * constant / below, 0.0))


#: Position east, north, up (m) and velocity (m/s) of the ownship less the intruder's.
Relative = Sequence[Any]


def violates(volume: Volume, relative: Relative) -> BoolArray:
    """Return a mask over pairs of aircraft: True where the volume is violated now.

    Parameters
    ----------
    volume : Volume
    relative : six of (n,)
        East, north, up in m and their rates in m/s, ownship less intruder.

    Returns
    -------
    (n,) of bool
    """
    east, north, up, v_east, v_north, climb = _float_arrays(relative)
    motion = horizontal_products(east, north, v_east, v_north)
    radius_m = volume.horizontal_m
    near = (motion.range_sq_m2 <= radius_m * radius_m) | meets_within_time(
        motion, radius_m, volume.horizontal_time_s, volume.time_variable
    )
    closing = (climb != 0.0) & (up * climb <= 0.0)
    soon = closing & (np.abs(up) <= volume.vertical_time_s * np.abs(climb))
    return np.asarray(near & ((np.abs(up) <= volume.vertical_m) | soon))


def violation_span(
    volume: Volume, relative: Relative, begin_s: Any = 0.0, end_s: Any = np.inf
) -> Span:
    """Return the interval (s) in which pairs of aircraft in straight flight violate a volume.

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
    east, north, up, v_east, v_north, climb = _float_arrays(relative)
    vertical = vertical_span(up, climb, volume.vertical_m, volume.vertical_time_s, begin_s, end_s)
    some = is_surely_less(vertical.begin_s, vertical.end_s)
    start = np.where(some, vertical.begin_s, 0.0)
    motion = horizontal_products(east + start * v_east, north + start * v_north, v_east, v_north)
    duration = np.where(some, vertical.end_s - start, 0.0)
    within = horizontal_span(motion, volume, duration)
    entry, leave = start + within.begin_s, start + within.end_s
    some &= is_surely_less(entry, leave)
    return Span(np.where(some, entry, np.inf), np.where(some, leave, -np.inf))


def _float_arrays(relative: Relative) -> list[FloatArray]:
    return [np.asarray(part, dtype=np.float64) for part in relative]


def is_inside_cylinder(
    distance_m: FloatArray, height_m: FloatArray, horizontal_m: float, vertical_m: float
) -> BoolArray:
    """Return a mask: True where the aircraft is inside the cylinder now, its boundary excluded."""
    return np.asarray((distance_m < horizontal_m) & (np.abs(height_m) < vertical_m))


def cylinder_span(
    horizontal_m: float | FloatArray,
    vertical_m: float | FloatArray,
    relative: Relative,
    begin_s: Any = 0.0,
    end_s: Any = np.inf,
) -> Span:
    """Return the interval (s) in which pairs in straight flight are inside a cylinder.

    As `violation_span`; sizes are radius and half height. It is an open interval: touching the
    cylinder is not entering it.
    """
    east, north, up, v_east, v_north, climb = (np.asarray(x, dtype=np.float64) for x in relative)
    motion = horizontal_products(east, north, v_east, v_north)
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
    some = some & is_surely_less(entry, leave)
    return Span(np.where(some, entry, np.inf), np.where(some, leave, -np.inf))
