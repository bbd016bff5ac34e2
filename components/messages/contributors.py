"""Which sensors contributed to an entry: bit masks, and their names."""

from functools import lru_cache
from typing import Any

import numpy as np

from dsa_des.arrays.types import IntArray
from dsa_des.block.message import Text

_BITS_OF_INT64 = 63
_COUNTED_BITS = 12


def mask_dtype_for_sensors(sensors: int) -> type:
    """Return the NumPy type of masks with a bit for each sensor.

    Beyond 63 sensors masks are Python's integers, which hold any number of bits.
    """
    return np.int64 if sensors <= _BITS_OF_INT64 else object


def joined_sensor_names_of_masks(contributors: IntArray, sensors: tuple[str, ...]) -> Text:
    """Return for each bit mask the names of its sensors, joined by ``+``."""
    if len(sensors) <= _COUNTED_BITS:  # counting was measured to be the fastest
        used = np.bincount(contributors, minlength=1)
        masks = np.flatnonzero(used)
        codes = (np.cumsum(used > 0) - 1).take(contributors)
    else:
        masks, codes = np.unique(contributors, return_inverse=True)
    return Text(codes, tuple("+".join(sensor_names_in_mask(int(mask), sensors)) for mask in masks))


@lru_cache(maxsize=256)
def sensor_names_in_mask(mask: int, sensors: tuple[str, ...]) -> tuple[str, ...]:
    """Return the names of the sensors whose bits are set in one mask."""
    return tuple(name for i, name in enumerate(sensors) if mask >> i & 1)


def contributor_names_by_entry(message: Any) -> Text:
    """Return for each entry of a message the names of its contributing sensors joined by ``+``."""
    return joined_sensor_names_of_masks(message.contributors, message.sensors)
