"""When the horizontal condition of a volume holds in straight flight."""

import numpy as np

from components.well_clear.nearly import nearly_zero
from components.well_clear.relative_motion import (
    Horizontal,
    discriminant,
    entry_of_circle_s,
    exit_of_circle_s,
    time_to_closest_s,
)
from components.well_clear.vertical_interval import Span
from components.well_clear.volume import Volume
from dsa_des.arrays.types import BoolArray, FloatArray


def horizontal_span(motion: Horizontal, volume: Volume, duration_s: float | FloatArray) -> Span:
    """Return when, in [0, duration], the horizontal condition of a volume holds.

    Parameters
    ----------
    motion : Horizontal
        At time 0.
    volume : Volume
    duration_s : float or ndarray

    Returns
    -------
    Span
        One interval: the set is convex for every time variable.
    """
    radius_m = volume.horizontal_m
    p, speed_sq = motion.closing_m2_s, motion.speed_sq_m2_s2
    delta = discriminant(motion, radius_m)
    root = np.sqrt(np.maximum(delta, 0.0))
    still = nearly_zero(speed_sq)
    inside = motion.range_sq_m2 <= radius_m * radius_m
    leave = exit_of_circle_s(motion, radius_m, root)
    leave = np.where(inside & still, duration_s, np.minimum(leave, duration_s))
    entry, ahead = _entry_from_outside(motion, volume, delta, root, still)
    entry = np.where(inside, 0.0, np.maximum(entry, 0.0))
    met = inside | (ahead & (delta >= 0.0) & (p <= 0.0) & (entry <= duration_s))
    return Span(np.where(met, entry, np.inf), np.where(met, leave, -np.inf))


def _entry_from_outside(
    motion: Horizontal, volume: Volume, delta: FloatArray, root: FloatArray, still: BoolArray
) -> tuple[FloatArray, BoolArray]:
    """Return the entry of those who are not yet within the radius, and whether there is one."""
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
    """Return the smaller root of r²(t) + τ s·v(t) = D², 0 where it has passed.

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
