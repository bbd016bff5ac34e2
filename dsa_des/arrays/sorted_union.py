"""The union of arrays that are in order, and where their values lie in it."""

from collections.abc import Sequence
from itertools import accumulate
from typing import Any, TypeVar

import numpy as np

from dsa_des.arrays.types import FloatArray, IntArray

_Array = TypeVar("_Array", IntArray, FloatArray)


def sorted_union_and_positions(arrays: Sequence[_Array]) -> tuple[_Array, list[IntArray]]:
    """Return every value once, ascending, and the position of each array's values among them.

    The arrays (n,), at least one, are in any order: whole numbers or doubles, no NaN. A stable sort
    merges runs that are already in order; `numpy.unique` hashes integers, which was measured to
    take ten times as long here. A search for the positions afterwards was measured to take six
    times as long as the sort.
    """
    first = arrays[0]
    if len(first) == 1 and all(len(array) == 1 and array[0] == first[0] for array in arrays):
        return first, [np.zeros(1, dtype=np.int64) for _ in arrays]
    joined: Any = np.concatenate(arrays)
    order = joined.argsort(kind="stable")
    values: _Array = joined.take(order)
    if len(values) == 0:
        return values, [order for _ in arrays]
    new = np.empty(len(values), dtype=bool)
    new[0] = True
    np.not_equal(values[1:], values[:-1], out=new[1:])
    position = np.empty_like(order)
    if new.all():
        position[order] = np.arange(len(values))
    else:
        position[order] = new.cumsum() - 1
        values = values[new]
    ends = accumulate(map(len, arrays))
    return values, [position[end - len(a) : end] for a, end in zip(arrays, ends, strict=True)]
