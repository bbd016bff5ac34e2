"""Columns with one value in every entry: views of arrays that are made once.

What a sensor says of every detection alike (the variance of its grid, that it measures no range
rate) would otherwise be a new array in every message.
"""

from functools import lru_cache

import numpy as np

from dsa_des.arrays.types import FloatArray

_SMALLEST = 64


def constant_column(value: float, count: int) -> FloatArray:
    """Return a read-only array of shape (count,) that holds one value.

    Parameters
    ----------
    value : float
    count : int

    Returns
    -------
    (count,) array
        It must not be written to: others hold it too.
    """
    size = _SMALLEST if count <= _SMALLEST else 1 << (count - 1).bit_length()
    return _whole(value, size)[:count]


@lru_cache(maxsize=256)
def _whole(value: float, size: int) -> FloatArray:
    column = np.full(size, value)
    column.flags.writeable = False
    return column
