"""The modified voltage potential: conflicts of straight flights, and a velocity out of them.

Each pair by itself pushes the velocity away from where the other one will be closest; pushes add
up. What is remembered is which pairs have been in conflict and may not resume yet.
"""

from typing import NamedTuple

import numpy as np

from dsa_des.arrays.types import BoolArray, FloatArray

# Closer than this pass straight through each other; the way out is then to the left of the line.
_LEAST_MISS_M, _LEAST_TIME_S, _LEAST_SPEED2 = 0.1, 1e-6, 1e-9
# Tracks so near to each other are parallel, and keep the larger radius before they resume.
_PARALLEL_RAD = np.radians(30.0)


class KeptApart(NamedTuple):
    """The separation to keep: a radius, its factor while steering, and the lookahead."""

    radius_m: float
    margin: float
    lookahead_s: float


class Others(NamedTuple):
    """Positions and velocities of others, (2, n, others) east and north, relative to one's own."""

    position_m: FloatArray
    velocity_mps: FloatArray


def closest_times_and_positions(others: Others) -> tuple[FloatArray, FloatArray]:
    """Return when (s) others are closest, and their relative positions (m) then, (2, n, others)."""
    (east, north), (east_mps, north_mps) = others
    closing = -(east * east_mps + north * north_mps)
    time_s = closing / np.maximum(_squared_lengths(others.velocity_mps), _LEAST_SPEED2)
    return time_s, others.position_m + others.velocity_mps * time_s


def conflict_mask(others: Others, kept: KeptApart) -> BoolArray:
    """Return a mask (n, others), True if within the radius before lookahead ends, not if NaN."""
    speed2 = _squared_lengths(others.velocity_mps)
    time_s, miss = closest_times_and_positions(others)
    inside2 = kept.radius_m**2 - _squared_lengths(miss)
    half_s = np.sqrt(np.maximum(inside2, 0.0) / np.maximum(speed2, _LEAST_SPEED2))
    meets = (inside2 > 0.0) & (time_s - half_s < kept.lookahead_s) & (time_s + half_s > 0.0)
    return np.asarray(meets & (speed2 >= _LEAST_SPEED2))


def may_resume(others: Others, own_mps: FloatArray, kept: KeptApart) -> BoolArray:
    """Return which (n, others) move away, outside the radius, not close on nearly one's own track.

    `own_mps` is one's own velocity (2, n).
    """
    (east, north), (east_mps, north_mps) = others
    range_m = np.hypot(east, north)
    apart = (east * east_mps + north * north_mps > 0.0) & (range_m >= kept.radius_m)
    # Tracks matter of the few who are hardly apart.
    row, column = (apart & (range_m < kept.margin * kept.radius_m)).nonzero()
    own = own_mps[:, row]
    track, theirs = np.arctan2(*own), np.arctan2(*(own + others.velocity_mps[:, row, column]))
    apart_rad = np.abs((theirs - track + np.pi) % (2.0 * np.pi) - np.pi)
    apart[row, column] = ~(apart_rad < _PARALLEL_RAD)
    return apart


def velocity_after_push(
    others: Others, own_mps: FloatArray, pushing: BoolArray, kept: KeptApart
) -> FloatArray:
    """Return the velocity (2, n) to which the pushing others change one's own.

    Notes
    -----
    Each pushes against where it will be closest by what is missing there of the radius, in the time
    until then; the radius is stretched so that the circle about the other is touched, not cut.
    Hoekstra, van Gent & Ruigrok, "Designing for safety: the 'free flight' air traffic management
    concept", Reliability Engineering & System Safety 75, 2002.
    """
    row, column = pushing.nonzero()
    others = Others(*(part[:, row, column] for part in others))
    radius_m = kept.margin * kept.radius_m
    time_s, miss = closest_times_and_positions(others)
    range_m, miss_m = np.hypot(*others.position_m), np.hypot(*miss)
    through = miss_m <= _LEAST_MISS_M
    east, north = others.position_m
    aside = _LEAST_MISS_M * np.stack([north, -east]) / np.maximum(range_m, 1e-12)
    miss, miss_m = np.where(through, aside, miss), np.where(through, _LEAST_MISS_M, miss_m)
    outside = (radius_m < range_m) & (miss_m < range_m)
    far_m = np.where(outside, range_m, 1.0)
    angle = np.arcsin(np.where(outside, radius_m / far_m, 0.0))
    angle = angle - np.arcsin(np.where(outside, miss_m / far_m, 0.0))
    gain_m = np.where(outside, radius_m / np.cos(angle), radius_m) - miss_m
    push = gain_m / (np.maximum(np.abs(time_s), _LEAST_TIME_S) * miss_m) * miss
    # One after the other, so that it does not matter for whom else there is room.
    return own_mps - np.stack([np.bincount(row, of, len(pushing)) for of in push])


def _squared_lengths(vector: FloatArray) -> FloatArray:
    """Return squares of lengths of vectors (2, ...)."""
    return np.asarray(vector[0] * vector[0] + vector[1] * vector[1])
