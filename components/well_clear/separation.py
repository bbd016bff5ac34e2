"""Separation of aircraft now and projected, and between samples of a curved flight."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from components.well_clear.relative_motion import (
    horizontal_products,
    modified_tau_s,
    nearly_zero,
    time_to_closest_s,
)
from components.well_clear.volume import Relative
from dsa_des.arrays.types import BoolArray, FloatArray, IntArray


class PairSeparation(NamedTuple):
    """Present distances, relative speeds, projected closest distances of pairs, (n,) each."""

    horizontal_m: FloatArray  # Distances now
    vertical_m: FloatArray
    horizontal_mps: FloatArray  # Relative speeds (not rates of the distances)
    vertical_mps: FloatArray
    miss_horizontal_m: FloatArray  # Projected closest distances within the lookahead
    miss_vertical_m: FloatArray
    # Of the horizontal closest approach; 0 and the distance now if it is past
    time_to_closest_s: FloatArray
    closest_m: FloatArray
    # Until the aircraft are at one height; NaN where they do not come closer
    time_to_level_s: FloatArray
    # NaN where the aircraft are within the distance or do not come closer
    modified_tau_s: FloatArray


def present_and_projected_separation(
    relative: Relative, lookahead_s: float, tau_distance_m: FloatArray
) -> PairSeparation:
    """Return distances, relative speeds, and closest distances projected within `lookahead_s`.

    `relative` is as for `violation_span`; a `tau_distance_m` (n,) that is NaN gives no modified
    tau.
    """
    east, north, up, v_east, v_north, climb = relative
    motion = horizontal_products(east, north, v_east, v_north)
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


#: Intervals are cut down to this, s.
FINEST_S = 1e-3
# Flights along the very edge would be cut up all the way: with so many pieces it ends.
_MOST_PIECES = 100_000
_FIRST_PIECES = 64
# Flights along the very edge would take all of the memory.
_PAIRS_AT_ONCE = 128


def first_time_inside_cylinder_s(
    apart: Callable[[IntArray, FloatArray], tuple[FloatArray, FloatArray]],
    between_s: tuple[FloatArray, FloatArray],
    closing_mps: FloatArray,
    horizontal_m: float,
    vertical_m: float,
) -> FloatArray:
    """Return when, s, each pair of flights is first inside a cylinder; NaN if never.

    `apart` gives the horizontal distance and the difference in height (m, not negative) of pairs
    (n,) at times (n,); neither changes faster than `closing_mps` (pairs,). `between_s` are the
    times looked at, two of (pairs,); sizes are radius and half height, m. The boundary is outside.
    Each time is within `FINEST_S` of the true one. Where a flight comes inside for less than that,
    it may be left out: it is then inside by no more than `closing_mps` times half of `FINEST_S`,
    0.1 m at 200 m/s. Where more than 100,000 pieces along the edge would have to be cut, their
    length stands for `FINEST_S`.
    """
    begin_s, end_s = between_s
    starts = range(0, len(closing_mps), _PAIRS_AT_ONCE)
    firsts = [
        _first_inside_from_pair_on(
            apart, some.start, begin_s[some], end_s[some], closing_mps[some],
            horizontal_m, vertical_m,
        )
        for some in (slice(first, first + _PAIRS_AT_ONCE) for first in starts)
    ]  # fmt: skip
    return np.concatenate(firsts) if firsts else np.empty(0)


def _first_inside_from_pair_on(
    apart: Callable[[IntArray, FloatArray], tuple[FloatArray, FloatArray]],
    first: int,
    begin_s: FloatArray,
    end_s: FloatArray,
    closing_mps: FloatArray,
    horizontal_m: float,
    vertical_m: float,
) -> FloatArray:
    """Return `first_time_inside_cylinder_s` of the pairs from the number `first` on."""
    earliest = np.full(len(begin_s), np.inf)
    length = (end_s - begin_s) / _FIRST_PIECES
    looked_at = np.flatnonzero(end_s >= begin_s)
    pair = np.repeat(looked_at, _FIRST_PIECES)
    number = np.tile(np.arange(_FIRST_PIECES, dtype=np.float64), len(looked_at))
    start: FloatArray = begin_s[pair] + length[pair] * number
    while len(start):
        half = 0.5 * length
        across_m, high_m = apart(first + pair, start + half[pair])
        drift_m = (closing_mps * half)[pair]
        maybe, within = _masks_possibly_and_surely_inside(
            across_m, high_m, drift_m, horizontal_m, vertical_m
        )
        pieces = np.bincount(pair[maybe], minlength=len(length))
        last = ((length <= FINEST_S) | (2 * pieces > _MOST_PIECES))[pair]
        inside = (across_m < horizontal_m) & (high_m < vertical_m)
        within, maybe = np.where(last, inside, within), np.where(last, inside, maybe)
        np.minimum.at(earliest, pair[within], start[within])
        cut = maybe & ~within & (start < earliest[pair])
        pair, start = pair[cut], start[cut]
        start = np.concatenate([start, start + half[pair]])
        pair = np.concatenate([pair, pair])
        length = half
    return np.where(np.isfinite(earliest), earliest, np.nan)


def _masks_possibly_and_surely_inside(
    across_m: FloatArray,
    high_m: FloatArray,
    drift_m: FloatArray | float,
    horizontal_m: float,
    vertical_m: float,
) -> tuple[BoolArray, BoolArray]:
    """Return in which pieces a pair may be inside at some time, and surely throughout (masks)."""
    maybe = (across_m - drift_m < horizontal_m) & (high_m - drift_m < vertical_m)
    within = (across_m + drift_m <= horizontal_m) & (high_m + drift_m <= vertical_m)
    return maybe, within
