"""When straight flights meet a volume, with and without uncertainty of their states."""

from typing import Any, NamedTuple

import numpy as np

from components.well_clear.relative_motion import (
    Horizontal,
    Span,
    horizontal_products,
    is_surely_less,
    meets_within_time,
    vertical_span,
)
from components.well_clear.tcas import TcasAdvisory, tcas_advisory_span
from components.well_clear.volume import Relative, Volume, horizontal_span, violation_span
from dsa_des.arrays.types import BoolArray, FloatArray

#: Where one bound is above zero, all are at least this, m and m/s.
LEAST_BOUND = 1e-3


class Bounds(NamedTuple):
    """Largest errors (n,) of relative horizontal position, height, velocity and climb rate."""

    # Radius of the horizontal position, of the height, of the velocity, of the climb rate
    position_m: FloatArray
    height_m: FloatArray
    velocity_mps: FloatArray
    climb_mps: FloatArray


def uncertain_violation_span(
    volume: Volume, relative: Relative, bounds: Bounds, begin_s: Any = 0.0, end_s: Any = np.inf
) -> Span:
    """Return the interval (s) in which pairs in straight flight may violate a volume of modified
    tau, if states are wrong by up to `bounds`.

    As `violation_span`; where all four bounds are 0, with its result.
    """
    east, north, up, v_east, v_north, climb = (np.asarray(x, dtype=np.float64) for x in relative)
    e = Bounds(*(np.maximum(bound, LEAST_BOUND) for bound in bounds))
    vertical = _uncertain_vertical_span(volume, up, climb, e, end_s)
    motion = horizontal_products(east, north, v_east, v_north)
    horizontal = _uncertain_horizontal_span(
        volume, (east, north, v_east, v_north), motion, e, end_s
    )
    entry = np.maximum(np.maximum(vertical.begin_s, horizontal.begin_s), begin_s)
    leave = np.minimum(vertical.end_s, horizontal.end_s)
    span = _restrict_span(Span(entry, leave), is_surely_less(entry, leave))
    known = np.asarray(sum(bounds) == 0.0)  # none is negative
    if not known.any():
        return span
    plain = violation_span(volume, relative, begin_s, end_s)
    return Span(*(np.where(known, *both) for both in zip(plain, span, strict=True)))


def _uncertain_vertical_span(
    volume: Volume, up: FloatArray, climb: FloatArray, e: Bounds, end_s: Any
) -> Span:
    above = _uncertain_span_above(volume, up, climb, e, end_s)
    below = _uncertain_span_above(volume, -up, -climb, e, end_s)
    return _common_hull(above, below)


def _uncertain_span_above(
    volume: Volume, up: FloatArray, climb: FloatArray, e: Bounds, end_s: Any
) -> Span:
    """Return when the vertical condition may hold for a relative height at or above 0 in bounds."""
    low, high = np.maximum(up - e.height_m, 0.0), up + e.height_m
    slow, fast = climb - e.climb_mps, climb + e.climb_mps

    def span(height: FloatArray, rate: FloatArray) -> Span:
        return vertical_span(height, rate, volume.vertical_m, volume.vertical_time_s, 0.0, end_s)

    leaving = _restrict_span(span(low, np.maximum(slow, 0.0)), (high >= 0.0) & (fast >= 0.0))
    first, last = span(low, slow), span(high, np.minimum(fast, 0.0))
    ends = np.where(np.isfinite(last.begin_s), last.end_s, end_s)
    there = (high >= 0.0) & (slow <= 0.0) & np.isfinite(first.begin_s)
    return _common_hull(leaving, _restrict_span(Span(first.begin_s, ends), there))


def _uncertain_horizontal_span(
    volume: Volume,
    state: tuple[FloatArray, FloatArray, FloatArray, FloatArray],
    motion: Horizontal,
    e: Bounds,
    end_s: Any,
) -> Span:
    radius_m, tau_s = volume.horizontal_m, volume.horizontal_time_s
    range_m, speed = np.sqrt(motion.range_sq_m2), np.sqrt(motion.speed_sq_m2_s2)
    reach = radius_m + e.position_m
    near = range_m <= reach
    now = near | meets_within_time(motion, radius_m, tau_s, volume.time_variable)
    slow = speed <= e.velocity_mps
    nearest, fastest = np.maximum(range_m - e.position_m, 0.0), speed + e.velocity_mps
    zero = np.zeros(np.shape(range_m))
    head_on = horizontal_products(nearest, zero, -fastest, zero)
    worst = _most_direct_approach(state, range_m, speed, nearest, fastest, e)
    plain = horizontal_span(motion, volume, end_s).begin_s
    towards = worst.closing_m2_s < 0.0
    entry = np.minimum(
        plain, np.where(towards, horizontal_span(worst, volume, end_s).begin_s, np.inf)
    )
    entry = np.where(slow, horizontal_span(head_on, volume, end_s).begin_s, entry)
    entry = np.where(now, 0.0, entry)
    growing = motion.speed_sq_m2_s2 - e.velocity_mps**2
    half = motion.closing_m2_s - e.velocity_mps * reach
    under = half * half - growing * (motion.range_sq_m2 - reach * reach)
    with np.errstate(divide="ignore", invalid="ignore"):
        leave = (np.sqrt(np.maximum(under, 0.0)) - half) / growing
    leave = np.where(under >= 0.0, leave, -np.inf)
    leave = np.where(slow, np.where(near | np.isfinite(entry), end_s, -np.inf), leave)
    some = (entry <= end_s) & (leave >= 0.0) & (entry <= leave)
    return Span(
        np.where(some, np.maximum(entry, 0.0), np.inf),
        np.where(some, np.minimum(leave, end_s), -np.inf),
    )


def _most_direct_approach(
    state: tuple[FloatArray, FloatArray, FloatArray, FloatArray],
    range_m: FloatArray,
    speed: FloatArray,
    nearest: FloatArray,
    fastest: FloatArray,
    e: Bounds,
) -> Horizontal:
    """Return relative position, velocity within bounds that lead aircraft most directly together.

    Angles count from the direction towards the intruder, in which the position's cone is centred.
    """
    east, north, v_east, v_north = state
    ahead = -(east * v_east + north * v_north)
    aside = north * v_east - east * v_north
    off = np.arctan2(aside, ahead)
    with np.errstate(divide="ignore", invalid="ignore"):
        position_cone = np.arcsin(np.minimum(e.position_m / range_m, 1.0))
        velocity_cone = np.arcsin(np.minimum(e.velocity_mps / speed, 1.0))
    low = np.maximum(-position_cone, off - velocity_cone)
    high = np.minimum(position_cone, off + velocity_cone)
    side = np.sign(off)
    overlap: BoolArray = np.asarray(low <= high)
    of_position = np.where(overlap, 0.5 * (low + high), side * position_cone)
    of_velocity = np.where(overlap, 0.5 * (low + high), off - side * velocity_cone)
    return horizontal_products(
        -nearest * np.cos(of_position),
        -nearest * np.sin(of_position),
        fastest * np.cos(of_velocity),
        fastest * np.sin(of_velocity),
    )


def _restrict_span(span: Span, where: BoolArray) -> Span:
    return Span(np.where(where, span.begin_s, np.inf), np.where(where, span.end_s, -np.inf))


def _common_hull(one: Span, other: Span) -> Span:
    return Span(np.minimum(one.begin_s, other.begin_s), np.maximum(one.end_s, other.end_s))


def violation_or_advisory_span(
    volume: Volume | TcasAdvisory,
    relative: Relative,
    own_up_mps: tuple[Any, Any] | None,
    bounds: Bounds | None,
    begin_s: Any,
    end_s: Any,
) -> Span:
    """Return when (s) pairs in straight flight violate a volume or are due a TCAS advisory.

    As `violation_span`. `own_up_mps` is the ownship's altitude (m) and climb (m/s) at time 0,
    without which an advisory raises `ValueError`; `bounds` say how far the states may be wrong, for
    volumes of modified tau.
    """
    if isinstance(volume, TcasAdvisory):
        if own_up_mps is None:
            raise ValueError("advisories of TCAS II need the ownship's altitude and climb")
        return tcas_advisory_span(
            relative, *own_up_mps, resolution=volume.resolution, begin_s=begin_s, end_s=end_s
        )
    if bounds is not None:
        return uncertain_violation_span(volume, relative, bounds, begin_s, end_s)
    return violation_span(volume, relative, begin_s, end_s)


def select_bounds(bounds: Bounds | None, which: Any) -> Bounds | None:
    """Return the bounds of the chosen pairs, or None if no bounds are given."""
    return None if bounds is None else Bounds(*(np.asarray(bound)[which] for bound in bounds))
