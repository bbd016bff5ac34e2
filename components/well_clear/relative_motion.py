"""Relative motion of two straight flights: products, times on a circle and at a height, tau.

Two numbers are nearly equal if few doubles lie between them; a zero and a number, if the latter
is tiny, as the alerting logic of DO-365 takes it. Alerts hang on it only where an aircraft is on
an edge to the last digits."""

from typing import Any, NamedTuple

import numpy as np

from dsa_des.arrays.types import BoolArray, FloatArray

#: Doubles that nearly equal times may lie apart.
DOUBLES_APART = 16_348
#: A number nearly equals zero below this.
TINY = 1e-13
# More than `DOUBLES_APART` doubles are apart by this part of their size.
_CLOSE = DOUBLES_APART * 2.0**-52


def nearly_equal(
    first: Any, second: Any, doubles_apart: int = DOUBLES_APART, tiny: float = TINY
) -> BoolArray:
    """Return a mask: True where two numbers, or equal infinities, are equal up to rounding.

    At most `doubles_apart` steps from one double to the next lie between them, or both are below
    `tiny` where one of them is 0.
    """
    a = np.asarray(first, dtype=np.float64)
    b = np.asarray(second, dtype=np.float64)
    # Doubles of one sign are in the order of their bits read as whole numbers.
    apart = np.abs(np.abs(a).view(np.int64) - np.abs(b).view(np.int64))
    alike = (apart <= doubles_apart) & ((a >= 0.0) == (b >= 0.0))
    zero = (a == 0.0) | (b == 0.0)
    both_tiny = (np.abs(a) < tiny) & (np.abs(b) < tiny)
    return np.asarray((alike & ~zero) | (zero & both_tiny))


def is_surely_less(first: Any, second: Any) -> BoolArray:
    """Return a mask: True where the first is less than the second beyond rounding error."""
    first, second = np.asarray(first), np.asarray(second)
    less = np.asarray(first < second)
    with np.errstate(invalid="ignore"):  # of infinities of one sign, neither is less
        gap = second - first
    # Few pairs are so close that their doubles have to be counted; no infinite gap is.
    close = less & (gap < _CLOSE * (np.abs(first) + np.abs(second)) + 2.0 * TINY)
    if close.any():
        less = less & ~(close & nearly_equal(first, second))
    return less


def nearly_zero(values: FloatArray) -> BoolArray:
    """Return whether numbers are zero up to rounding."""
    return np.asarray(np.abs(values) < TINY)


class Horizontal(NamedTuple):
    """Scalar and cross products of relative position s and velocity v, arrays of one shape."""

    range_sq_m2: FloatArray  # s·s
    closing_m2_s: FloatArray  # s·v, negative while the aircraft come closer
    speed_sq_m2_s2: FloatArray  # v·v
    # East times north rate less north times east rate: miss distance times speed
    cross_m2_s: FloatArray


def horizontal_products(
    east_m: FloatArray, north_m: FloatArray, east_mps: FloatArray, north_mps: FloatArray
) -> Horizontal:
    """Return s·s, s·v, v·v and s×v of relative position s and velocity v, east and north."""
    return Horizontal(
        east_m * east_m + north_m * north_m,
        east_m * east_mps + north_m * north_mps,
        east_mps * east_mps + north_mps * north_mps,
        east_m * north_mps - north_m * east_mps,
    )


def time_to_closest_s(motion: Horizontal) -> FloatArray:
    """Return the time of the horizontal closest approach, negative if past; 0 without motion."""
    still = motion.speed_sq_m2_s2 == 0.0
    speed_sq = np.where(still, 1.0, motion.speed_sq_m2_s2)
    return np.asarray(np.where(still, 0.0, -motion.closing_m2_s / speed_sq))


def discriminant(motion: Horizontal, radius_m: float | FloatArray) -> FloatArray:
    """Return (radius · speed)² − cross²; not negative where a straight flight meets the circle.

    As a product of sum and difference, so that a grazing flight is as exact as its radius.
    """
    reach = radius_m * np.sqrt(motion.speed_sq_m2_s2)
    cross = np.abs(motion.cross_m2_s)
    return np.asarray((reach - cross) * (reach + cross))


def entry_of_circle_s(
    motion: Horizontal, radius_m: float | FloatArray, root: FloatArray
) -> FloatArray:
    """Return when, s, straight flight enters a circle about the origin; `root`: √`discriminant`.

    It is of either sign, and meaningless where there is no relative motion.
    """
    p, outside = motion.closing_m2_s, motion.range_sq_m2 - radius_m * radius_m
    # Whichever form of the smaller root does not subtract nearly equal numbers.
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        return np.asarray(
            np.where(p < 0.0, outside / (root - p), (-p - root) / motion.speed_sq_m2_s2)
        )


def exit_of_circle_s(
    motion: Horizontal, radius_m: float | FloatArray, root: FloatArray
) -> FloatArray:
    """Return when, s, straight flight leaves a circle about the origin; `root`: √`discriminant`."""
    p, outside = motion.closing_m2_s, motion.range_sq_m2 - radius_m * radius_m
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        return np.asarray(
            np.where(p > 0.0, -outside / (root + p), (root - p) / motion.speed_sq_m2_s2)
        )


class Span(NamedTuple):
    """Begin and end, s, of when a condition holds; infinity and minus infinity if never."""

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
    """Return when in [begin_s, end_s] height difference or time until it is 0 is in its threshold.

    Sizes are those of `components.well_clear.volume.Volume`. A level flight is inside all the time
    or never.
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


def meets_within_time(
    motion: Horizontal, distance_m: float, time_s: float, time_variable: str
) -> BoolArray:
    """Return a mask: True where the flight passes within the distance and its time variable (such
    as modified tau) lies between 0 and `time_s`.

    It is one of `components.well_clear.volume.TIME_VARIABLES`; "none" is never short.
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
