"""Checks of the directions that the optical functions accept."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from components.arguments.checks import FloatArray, finite

# Beyond this the gap between neighbouring doubles is over a tenth of a radian: no direction is left
# in the number.
_LARGEST_MEANINGFUL_ANGLE_RAD = 1e15


def angle(name: str, value: ArrayLike) -> FloatArray:
    """Return an angle in radians as finite float64, safe to add to another one.

    Values beyond 1e15 rad carry no direction any more; they are reduced only so that sums of two
    of them cannot overflow. Everything smaller passes through unchanged, to the bit.
    """
    array = finite(name, value)
    if np.any(np.abs(array) > _LARGEST_MEANINGFUL_ANGLE_RAD):
        array = np.where(
            np.abs(array) > _LARGEST_MEANINGFUL_ANGLE_RAD, np.fmod(array, 2.0 * np.pi), array
        )
    return array
