"""Arrays that are in order: their union, and where one lies in another."""

from collections import OrderedDict
from collections.abc import Sequence
from typing import Any, TypeVar

import numpy as np

from dsa_des.arrays.types import FloatArray, IntArray

_Array = TypeVar("_Array", IntArray, FloatArray)
#: Places that were found, by the lengths of both arrays: guesses for the next that ask.
_found: OrderedDict[tuple[int, int], IntArray] = OrderedDict()
_MOST_FOUND = 8
# To search among fewer is as fast as to look at a guess.
_WORTH_A_GUESS = 512


def sorted_union(arrays: Sequence[_Array]) -> _Array:
    """Return every value once, ascending.

    A stable sort merges runs that are already in order; `numpy.unique` hashes integers, which
    was measured to take ten times as long here.

    Parameters
    ----------
    arrays : sequence of ndarray, shape (n,)
        At least one; whole numbers or doubles, no NaN.
    """
    joined: Any = np.concatenate(arrays)
    values: _Array = joined if len(arrays) == 1 else np.sort(joined, kind="stable")
    if len(values) == 0:
        return values
    new = np.empty(len(values), dtype=bool)
    new[0] = True
    rise = values[1:] != values[:-1]
    new[1:] = rise
    return values if bool(rise.all()) else values[new]


def last_at_or_before(values: IntArray, asked: IntArray) -> tuple[IntArray, bool]:
    """Return the place of the last of `values` that is not above each of `asked`; -1 for none.

    With it comes whether each of `asked` is known to be one of `values`.

    Parameters
    ----------
    values, asked : ndarray of int64
        Ascending. Where they are the same, as for blocks that run at the same instants, a
        comparison answers it; a search was measured to take a tenth of a whole run. Nor are they
        searched where they are those of a search before, which a comparison shows as well: several
        blocks ask for the same.
    """
    if values is asked or (
        len(values) == len(asked)
        and bool(np.array_equal(values, asked))
        and bool((values[1:] > values[:-1]).all())
    ):
        return np.arange(len(asked)), True
    if len(asked) < _WORTH_A_GUESS or not bool((values[1:] > values[:-1]).all()):
        return np.searchsorted(values, asked, side="right") - 1, False
    key = len(values), len(asked)
    guess = _found.get(key)
    if guess is not None and bool(np.array_equal(values[guess], asked)):
        return guess.copy(), True
    places: IntArray = np.searchsorted(values, asked, side="right") - 1
    met = places[0] >= 0 and bool(np.array_equal(values[places], asked))
    if met:
        _found[key] = places.copy()
        if len(_found) > _MOST_FOUND:
            _found.popitem(last=False)
    return places, met
