"""Which values of a study's runs are cut off by the start or the end of the run."""

from typing import Any

import numpy as np

from components.metrics.rows import is_named
from components.sensor.cut_off import START, in_scan, said
from dsa_des.arrays.types import AnyArray, BoolArray, FloatArray
from dsa_des.studies.metric import Group

#: Columns of the sensors' scans that `scan_time_s` needs.
SCANS = {"scans": ("block", "time_s")}


def scan_time_s(group: Group, name: str, number: int) -> FloatArray:
    """Return when a sensor's scan `number` (from 1) is in every replica, s; NaN without so many."""
    return group.once(("scan_time_s", name, number), lambda: _scan_time_s(group, name, number))


def _scan_time_s(group: Group, name: str, number: int) -> FloatArray:
    columns: Any = group.tables["scans"]
    start, end = (np.searchsorted(columns["replica"], np.arange(len(group)), s) for s in _SIDES)
    found = np.full(len(group), np.nan)
    of_sensor = is_named(columns["block"], name)
    left, width = np.flatnonzero(end > start), _FIRST_LOOK
    while len(left):  # farther, where a replica has not so many scans among its first rows
        rows = start[left, np.newaxis] + np.arange(width)
        inside = rows < end[left, np.newaxis]
        rows = np.where(inside, rows, 0)
        mine = inside & of_sensor[rows]
        there = mine & (np.cumsum(mine, axis=1) == number)
        seen = there.any(axis=1)
        found[left[seen]] = columns["time_s"][rows[there]]
        left = left[~seen & inside[:, -1]]
        width *= 8
    return found


# Rows of a replica among which its scan is sought first.
_FIRST_LOOK = 64
_SIDES: Any = ("left", "right")


def at_start(group: Group, name: str, time_s: FloatArray, scans: int = 1) -> BoolArray:
    """Return whether something was seen as early as a run's start lets it.

    Parameters
    ----------
    group : Group
    name : str
        The sensor.
    time_s : (replicas,)
        When it was.
    scans : int
        How many scans it takes.
    """
    return in_scan(time_s, scan_time_s(group, name, scans))


def start_or_never(cut: BoolArray, values: FloatArray) -> AnyArray:
    """Return the column that says where values are cut off, for those that only a start cuts."""
    return said(np.where(cut, START, ""), values)
