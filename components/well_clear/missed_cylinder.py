"""Cylinders that encounters just miss, and how likely a manoeuvre is to lead into one of them.

A turn moves an aircraft to the side, by some hundred metres in the time that is left, and changes
no altitude; a climb or descent moves it up or down, and hardly to the side. So what counts is not
the closest approach alone: a turn can lead to whom is met at the same altitude at any time, and a
climb to whom passes above or below.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from dsa_des.arrays.types import FloatArray

#: How far turns and climbs lead, m, and what else they move: a part of a cylinder's size.
_TURNED_M, _CLIMBED_M, _SLACK = 350.0, 100.0, 0.15


class Missed(NamedTuple):
    """Horizontal and vertical distances (m, one per run) by which encounters miss a cylinder.

    Then how near to the side while about its height apart or less, and how near up or down while
    about its radius apart or less (`widen_cylinders`); infinite where they never are. NaN where
    nobody is met.
    """

    level: FloatArray
    up: FloatArray
    beside: FloatArray
    above: FloatArray


def widen_cylinders(sizes_m: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    """Return cylinders (radius, half height) slightly enlarged, so that they also cover what
    manoeuvres shift along the other direction.
    """
    return [((1.0 + _SLACK) * radius_m, (1.0 + _SLACK) * half_m) for radius_m, half_m in sizes_m]


def probability_of_induced_entry(
    size_m: tuple[float, float], missed: Missed, *, climbs: bool
) -> FloatArray:
    """Return an estimated probability per run that a manoeuvre leads into a just missed cylinder.

    By a turn only where somebody is met at the same altitude: whom it brings nearer to the side
    then, or who is near at the closest approach and met there earlier or later. 0 where nobody is.
    """
    radius_m, half_m = size_m
    level, up, beside, above = (
        np.maximum(np.nan_to_num(at, nan=np.inf, posinf=np.inf) - size, 0.0)
        for at, size in zip(missed, (radius_m, half_m) * 2, strict=True)
    )
    turned = np.exp(-((beside / _TURNED_M) ** 2))
    later = np.exp(-((level / _TURNED_M) ** 2) - (up / half_m) ** 2)
    result: FloatArray = np.maximum(turned, np.where(np.isfinite(beside), later, 0.0))
    return np.maximum(result, np.exp(-((above / _CLIMBED_M) ** 2))) if climbs else result
