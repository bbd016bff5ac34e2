"""Intervals of guidance values: formed of clear values, wrapped or clipped, painted over."""

import math
import struct
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from dsa_des.arrays.types import BoolArray, FloatArray

#: Guidance values that are fewer doubles apart are one place, and so are a zero and one below
#: `_TINY`.
_DOUBLES_APART = 2**40
_TINY = 1e-5
_TURN = 2.0 * math.pi
# Doubles of one sign are in the order of their bits read as whole numbers.
_DOUBLES, _AS_WHOLE_NUMBERS = struct.Struct("=2d"), struct.Struct("=2q")


class Interval(NamedTuple):
    """Values from `low` to `high`."""

    low: float
    high: float


def same_place(one: float, other: float) -> bool:
    """Tell whether two guidance values are one place.

    As `components.well_clear.nearly.nearly_equal` has it, for two numbers at a time, which arrays
    are ten times as slow for.
    """
    if one == 0.0 or other == 0.0:
        return abs(one) < _TINY and abs(other) < _TINY
    if (one > 0.0) != (other > 0.0):
        return False
    first, second = _AS_WHOLE_NUMBERS.unpack(_DOUBLES.pack(abs(one), abs(other)))
    return abs(int(first) - int(second)) <= _DOUBLES_APART


def clear_intervals(
    values: FloatArray, clear: BoolArray, least: float, most: float, cyclic: bool
) -> list[Interval]:
    """Return the intervals of values that are clear, within the limits.

    Parameters
    ----------
    values : (n,)
        Ascending.
    clear : (n,) of bool
        A clear value without a clear neighbour makes no interval.
    least, most : float
    cyclic : bool
        Whether values are directions, of which 0 and a full turn are one place.
    """
    edges = np.flatnonzero(np.diff(np.concatenate([[0], clear.astype(int), [0]])))
    found = []
    for first, end in zip(edges[::2], edges[1::2], strict=True):
        if end - first >= 2:
            found.append(Interval(float(values[first]), float(values[end - 1])))
    if not cyclic:
        clipped = [Interval(max(low, least), min(high, most)) for low, high in found]
        return [one for one in clipped if one.low < one.high]
    return [part for one in found for part in _wrapped(one)]


def _wrapped(interval: Interval) -> list[Interval]:
    """Return an interval of directions within [0, 2 pi], in two where it holds 0."""
    if interval.high - interval.low >= _TURN or same_place(interval.high - interval.low, _TURN):
        return [Interval(0.0, _TURN)]
    low, high = interval.low % _TURN, interval.high % _TURN
    low = 0.0 if same_place(low, _TURN) else low
    high = _TURN if same_place(high, 0.0) else high
    return [Interval(low, high)] if low < high else [Interval(low, _TURN), Interval(0.0, high)]


class Band(NamedTuple):
    """A stretch of guidance values of one region."""

    low: float
    high: float
    region: str


def painted(
    layers: list[tuple[str, list[Interval], bool]], least: float, most: float
) -> list[Band]:
    """Return the bands from the lowest to the highest value.

    Parameters
    ----------
    layers : list of (region, intervals, outside)
        From the bottom up: what lies within the intervals is painted, or where `outside`, what
        does not. The ground is NONE.
    least, most : float
    """
    places = [least, most]
    for _, intervals, _ in layers:
        for interval in intervals:
            for value in interval:
                if not any(same_place(value, place) for place in places):
                    places.append(value)
    places.sort()
    bands: list[Band] = []
    for low, high in pairwise(places):
        middle, region = 0.5 * (low + high), "NONE"
        for name, intervals, outside in layers:
            within = any(one.low <= middle <= one.high for one in intervals)
            if within != outside:
                region = name
        if bands and bands[-1].region == region:
            bands[-1] = Band(bands[-1].low, high, region)
        else:
            bands.append(Band(low, high, region))
    return bands
