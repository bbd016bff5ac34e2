"""Intervals of guidance values: formed of clear values, wrapped or clipped, painted over."""

import math
import struct
from collections.abc import Iterable
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from dsa_des.arrays.types import BoolArray, FloatArray

#: Guidance values that are fewer doubles apart are one place, and so are a zero and one below
#: `TINY`.
DOUBLES_APART = 2**40
TINY = 1e-5
FULL_TURN = 2.0 * math.pi
# Doubles of one sign are in the order of their bits read as whole numbers.
_DOUBLES, _AS_WHOLE_NUMBERS = struct.Struct("=2d"), struct.Struct("=2q")


class Interval(NamedTuple):
    """Values from `low` to `high`."""

    low: float
    high: float


def is_same_value(one: float, other: float) -> bool:
    """Return whether two guidance values are equal but for rounding: a few doubles apart at most.

    As `nearly_equal` of `components.well_clear.relative_motion`, for two numbers at a time: arrays
    are ten times as slow.
    """
    if one == 0.0 or other == 0.0:
        return abs(one) < TINY and abs(other) < TINY
    if (one > 0.0) != (other > 0.0):
        return False
    first, second = _AS_WHOLE_NUMBERS.unpack(_DOUBLES.pack(abs(one), abs(other)))
    return abs(int(first) - int(second)) <= DOUBLES_APART


def limits_of(name: str, own_value: FloatArray, values: Any) -> tuple[FloatArray, FloatArray]:
    """Return least and largest values of a manoeuvre kind, as configured around the own value."""
    below, above = values[f"below_relative_{name}"], values[f"above_relative_{name}"]
    least = np.full(np.shape(own_value), float(values[f"min_{name}"]))
    most = np.full(np.shape(own_value), float(values[f"max_{name}"]))
    if below > 0.0:
        least = np.maximum(least, own_value - below)
    if above > 0.0:
        most = np.minimum(most, own_value + above)
    return least, most


def clear_intervals(
    values: FloatArray, clear: BoolArray, least: float, most: float, cyclic: bool
) -> list[Interval]:
    """Return intervals of neighbouring clear values, within limits or, if cyclic, [0, 2 pi]."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], clear.astype(int), [0]])))
    result = []
    for first, end in zip(edges[::2], edges[1::2], strict=True):
        if end - first >= 2:
            result.append(Interval(float(values[first]), float(values[end - 1])))
    if not cyclic:
        clipped = [Interval(max(low, least), min(high, most)) for low, high in result]
        return [one for one in clipped if one.low < one.high and not is_same_value(*one)]
    return [part for one in result for part in _wrap_interval(one)]


def _wrap_interval(interval: Interval) -> list[Interval]:
    """Return an interval of directions within [0, 2 pi], split in two where it contains north."""
    if interval.high - interval.low >= FULL_TURN or is_same_value(
        interval.high - interval.low, FULL_TURN
    ):
        return [Interval(0.0, FULL_TURN)]
    low, high = interval.low % FULL_TURN, interval.high % FULL_TURN
    low = 0.0 if is_same_value(low, FULL_TURN) else low
    high = FULL_TURN if is_same_value(high, 0.0) else high
    return [Interval(low, high)] if low < high else [Interval(low, FULL_TURN), Interval(0.0, high)]


class Band(NamedTuple):
    """A stretch of guidance values of one region."""

    low: float
    high: float
    region: str


def paint_bands(
    layers: list[tuple[str, list[Interval], bool]], least: float, most: float
) -> list[Band]:
    """Return bands from least to most; of layers (region, intervals, outside) later ones cover."""
    places = [least, most]
    for _, intervals, _ in layers:
        for interval in intervals:
            for value in interval:
                if not any(is_same_value(value, known) for known in places):
                    places.append(value)
    places.sort()
    bands = []
    for low, high in pairwise(places):
        middle, region = 0.5 * (low + high), "NONE"
        for name, intervals, outside in layers:
            within = any(one.low <= middle <= one.high for one in intervals)
            if within != outside:
                region = name
        bands.append(Band(low, high, region))
    return join_neighbours(bands)


def rename_none_to_recovery(bands: list[Band]) -> list[Band]:
    """Return the bands with NONE called RECOVERY, equal neighbours joined."""
    return join_neighbours(
        Band(low, high, "RECOVERY" if region == "NONE" else region) for low, high, region in bands
    )


def join_neighbours(bands: Iterable[Band]) -> list[Band]:
    """Return bands from the lowest to the highest value with equal neighbours as one."""
    result: list[Band] = []
    for band in bands:
        if result and result[-1].region == band.region:
            result[-1] = Band(result[-1].low, band.high, band.region)
        else:
            result.append(band)
    return result
