"""Closest approaches that are only where looking began or ended: nearer ones may lie beyond."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from components.traffic.flight_limits import intervals_present_s
from components.traffic.sample_times import SampleTimes
from dsa_des.arrays.types import FloatArray


def censored_approaches(source: Any, time_s: FloatArray, end_s: float) -> list[str]:
    """Say of each closest approach whether it is at an end of what was looked at.

    Parameters
    ----------
    source : TrafficSource
    time_s : (targets,)
        When each target is closest; NaN for those never there.
    end_s : float
        Of the run.

    Returns
    -------
    list of str
        ``"the start"``, ``"the end of the run"``, ``"the start of its flight"`` or
        ``"the end of its flight"``; empty where the aircraft are nearer than before and after.
    """
    present_s = np.array(present_together_s(source.own, source.targets, end_s))
    looked_s = np.array(_looked_at_s(source, *present_s))
    return [
        end_of_look(time, looked_s[:, number], present_s[:, number], end_s)
        for number, time in enumerate(time_s.tolist())
    ]


def end_of_look(time_s: float, looked_s: FloatArray, present_s: FloatArray, end_s: float) -> str:
    """Say of one closest approach whether it is at an end of what was looked at.

    Parameters
    ----------
    time_s : float
    looked_s, present_s : (2,)
        First and last time that was looked at, and at which both aircraft may be there.
    end_s : float
        Of the run.
    """
    if time_s <= looked_s[0]:
        return "the start of its flight" if present_s[0] > 0.0 else "the start"
    if time_s >= looked_s[1]:
        return "the end of the run" if present_s[1] >= end_s else "the end of its flight"
    return ""


def present_together_s(
    own: Any, targets: Sequence[Any], end_s: float
) -> tuple[FloatArray, FloatArray]:
    """Return the first and the last time (targets,) of a run at which both may be there, s."""
    first, last = intervals_present_s([own])[0].tolist()
    intervals = intervals_present_s(targets)
    return (
        np.maximum(intervals[:, 0], max(first, 0.0)),
        np.minimum(intervals[:, 1], min(last, end_s)),
    )


def _looked_at_s(
    source: Any, begin_s: FloatArray, end_s: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the first and the last sample (targets,) in [begin_s, end_s]; NaN without any."""
    first, last = np.full(len(begin_s), np.nan), np.full(len(begin_s), np.nan)
    every: list[SampleTimes] = source.sample_times()
    if not every:
        for number, target in enumerate(source.targets):
            times = source.sample_times_s(target)
            times = times[(times >= begin_s[number]) & (times <= end_s[number])]
            if len(times):
                first[number], last[number] = times.min(), times.max()
    for times in every:
        targets = np.arange(len(begin_s))
        low, high = times.between(targets, begin_s, end_s)
        some = np.flatnonzero(high >= low)
        first[some] = np.fmin(first[some], times.at(some, low[some]))
        last[some] = np.fmax(last[some], times.at(some, high[some]))
    return first, last
