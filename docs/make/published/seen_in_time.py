"""Which aircraft of encounters that nobody mitigates are seen in time: Andrews's rate along them.

Over a flat Earth and in steps of a second, so independent of the flights of the scenes.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from components.arguments.units import FOOT_M, NAUTICAL_MILE_M
from components.encounters.pairing import Pairs
from components.optical.silhouette import visible_area
from components.visual.acquisition import (
    UNALERTED_PER_SR_S,
    VISUAL_RANGE_DEPTH,
    acquisition_rate_per_s,
    angular_size_rad,
)
from dsa_des.arrays.types import FloatArray

_GRAVITY_FT_S2 = 32.174


@dataclass(frozen=True)
class Eyes:
    """Who looks out; the defaults are those of MIT Lincoln Laboratory's block."""

    visual_range_nmi: float = 20.0
    looking: float = 1.0
    beta_per_sr_s: float = UNALERTED_PER_SR_S
    #: Of a Cessna 172, as its sphere, cylinder and plate.
    area_m2: tuple[float, float, float] = (10.2, 3.0, 38.7)
    azimuth_deg: tuple[float, float] = (-110.0, 90.0)
    elevation_deg: tuple[float, float] = (-20.0, 35.0)
    smallest_arcmin: float = 1.0


def opportunity(pairs: Pairs, eyes: Eyes, observer: int) -> FloatArray:
    """Return the integral of the rate up to each second, (seconds + 1, pairs).

    `observer` is 0 (the ownship looks out) or 1.
    """
    other = 1 - observer
    apart = [
        0.5 * (one[1:] + one[:-1]) * FOOT_M
        for one in (getattr(pairs, f"{axis}_ft")[other] - getattr(pairs, f"{axis}_ft")[observer]
                    for axis in ("north", "east", "up"))
    ]  # fmt: skip
    north, east, up = apart
    range_m = np.maximum(np.sqrt(north**2 + east**2 + up**2), 1.0)
    heading, roll, pitch = _attitude(pairs, observer)
    target_heading, target_roll, target_pitch = _attitude(pairs, other)
    # Into body axes: turned by the heading, pitched, and rolled.
    ahead = north * np.cos(heading) + east * np.sin(heading)
    right = -north * np.sin(heading) + east * np.cos(heading)
    forward = ahead * np.cos(pitch) + up * np.sin(pitch)
    down = ahead * np.sin(pitch) - up * np.cos(pitch)
    aside = right * np.cos(roll) + down * np.sin(roll)
    below = -right * np.sin(roll) + down * np.cos(roll)
    azimuth = np.degrees(np.arctan2(aside, forward))
    elevation = np.degrees(np.arcsin(np.clip(-below / range_m, -1.0, 1.0)))
    front, side, horizontal = eyes.area_m2
    bearing = np.arctan2(east, north)
    area = visible_area(
        (target_heading - bearing).reshape(-1), target_pitch.reshape(-1), target_roll.reshape(-1),
        np.arcsin(np.clip(up / range_m, -1.0, 1.0)).reshape(-1),
        front_m2=front, side_m2=side, horizontal_m2=horizontal, model="convex_hull",
    ).reshape(range_m.shape)  # fmt: skip
    shows = (azimuth >= eyes.azimuth_deg[0]) & (azimuth <= eyes.azimuth_deg[1])
    shows &= (elevation >= eyes.elevation_deg[0]) & (elevation <= eyes.elevation_deg[1])
    shows &= angular_size_rad(area, range_m) >= math.radians(eyes.smallest_arcmin / 60.0)
    rate = acquisition_rate_per_s(
        area, range_m, beta_per_sr_s=eyes.beta_per_sr_s * eyes.looking,
        extinction_per_m=VISUAL_RANGE_DEPTH / (eyes.visual_range_nmi * NAUTICAL_MILE_M),
    )  # fmt: skip
    summed = np.cumsum(np.where(shows, rate, 0.0), axis=0)
    return np.concatenate([np.zeros((1, summed.shape[1])), summed])


def unseen(opportunities: FloatArray, event_s: float, left_s: float) -> FloatArray:
    """Return how likely each pair's other aircraft is not seen so long before an event."""
    at = min(max(event_s - left_s, 0.0), len(opportunities) - 1.0)
    whole = min(int(at), len(opportunities) - 2)
    low, high = opportunities[whole], opportunities[whole + 1]
    found: FloatArray = np.exp(-(low + (at - whole) * (high - low)))
    return found


def _attitude(pairs: Pairs, who: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return heading, bank and pitch in the middle of each second, as flown without slip."""

    def middle(values: FloatArray) -> FloatArray:
        return 0.5 * (values[1:] + values[:-1])

    heading = pairs.heading_rad[who]
    half = 0.5 * np.remainder(np.diff(heading, axis=0) + math.pi, 2.0 * math.pi) - 0.5 * math.pi
    speed = middle(pairs.speed_ft_s[who])
    climb = np.diff(pairs.up_ft[who], axis=0)
    bank = np.arctan(speed * 2.0 * half / _GRAVITY_FT_S2)
    return heading[:-1] + half, bank, np.arcsin(np.clip(climb / speed, -1.0, 1.0))


def shares_unseen(
    some: list[Pairs], eyes: Eyes, event_s: float, lefts_s: Sequence[float]
) -> FloatArray:
    """Return which share is not seen so long before, by one pilot and by both: (2, times)."""
    weight = np.concatenate([pairs.weight for pairs in some])
    sums = [[opportunity(pairs, eyes, who) for who in (0, 1)] for pairs in some]
    found = np.empty((2, len(lefts_s)))
    for place, left_s in enumerate(lefts_s):
        own, other = (
            np.concatenate([unseen(both[who], event_s, left_s) for both in sums]) for who in (0, 1)
        )
        found[:, place] = [
            np.average(0.5 * (own + other), weights=weight), np.average(own * other, weights=weight)
        ]  # fmt: skip
    return found
