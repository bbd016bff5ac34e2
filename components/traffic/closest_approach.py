"""The instant of closest approach: time is halved, with the largest speeds as proof.

Distances are compared at given times. A target that is d away at one of them is nowhere nearer
than d - v·dt up to a time dt before or after it, with v the sum of the two largest speeds: a
stretch of time in which that leaves nothing nearer than what is known already is not looked at.
What is found is what looking at every time would find, to the bit.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from components.geometry.ellipsoid import line_of_sight
from components.traffic.sample_times import SampleTimes
from dsa_des.arrays.types import FloatArray, IntArray

# As in `near_intervals`: speeds of turns and long legs hold to 2e-4, positions to under a metre.
_SPEED_MARGIN = 1.001
_RANGE_MARGIN_M = 1.0
#: So many stretches of time are looked at together: it bounds the memory, however long the run.
MOST_AT_ONCE = 32_768


@dataclass(frozen=True, eq=False)
class Approaches:
    """The closest approach of each of many targets.

    Parameters
    ----------
    time_s : (targets,)
        NaN where target and ownship are never there together at any of the times.
    range_m : (targets,)
        Slant range; infinite there.
    """

    time_s: FloatArray
    range_m: FloatArray

    @classmethod
    def none(cls, targets: int) -> "Approaches":
        """Return what is known before anything was looked at."""
        return cls(np.full(targets, np.nan), np.full(targets, np.inf))


def closest_approaches(
    own_at: Callable[[IntArray, FloatArray], Any],
    targets_at: Callable[[IntArray, FloatArray], Any],
    times: SampleTimes,
    *,
    closing_speed_mps: FloatArray,
    present_s: tuple[FloatArray, FloatArray],
    best: Approaches | None = None,
) -> Approaches:
    """Find the time of the smallest slant range of each target; the first one of several.

    Parameters
    ----------
    own_at : callable
        States of the ownships of targets (n,) of int, each at a time (n,) of its own.
    targets_at : callable
        States of targets (n,) of int, each at a time (n,) of its own.
    times : SampleTimes
        Where distances are compared.
    closing_speed_mps : (targets,)
        Largest speed of the target plus that of the ownship.
    present_s : two (targets,)
        First and last time that are looked at; who is not there at a time in between is left out.
    best : Approaches, optional
        What other times gave; improved in place.

    Returns
    -------
    Approaches
    """
    closing = closing_speed_mps * _SPEED_MARGIN
    best = Approaches.none(len(closing)) if best is None else best
    target = np.arange(len(closing))
    first, last = times.between(target, *present_s)
    some = first <= last
    waiting = [(target[some], first[some], last[some])]
    while waiting:
        target, first, last = waiting.pop()
        if len(target) > MOST_AT_ONCE:  # the later part waits
            waiting.append((target[MOST_AT_ONCE:], first[MOST_AT_ONCE:], last[MOST_AT_ONCE:]))
            target, first, last = (a[:MOST_AT_ONCE] for a in (target, first, last))
        middle = (first + last) // 2
        time_s = times.at(target, middle)
        range_m, there = _apart(own_at(target, time_s), targets_at(target, time_s))
        _improve(best, target[there], time_s[there], range_m[there])
        away_s = np.maximum(time_s - times.at(target, first), times.at(target, last) - time_s)
        nearest_m = range_m - closing[target] * away_s - _RANGE_MARGIN_M
        open_ = nearest_m <= best.range_m[target]
        before, after = open_ & (first < middle), open_ & (middle < last)
        halves = (
            np.concatenate((target[before], target[after])),
            np.concatenate((first[before], middle[after] + 1)),
            np.concatenate((middle[before] - 1, last[after])),
        )
        if len(halves[0]) > MOST_AT_ONCE:
            # Those that may come nearest first: what they find spares the others.
            order = np.argsort(np.concatenate((nearest_m[before], nearest_m[after])), kind="stable")
            halves = halves[0][order], halves[1][order], halves[2][order]
        if len(halves[0]):
            waiting.append(halves)
    return best


def _apart(own: Any, other: Any) -> tuple[FloatArray, Any]:
    """Return slant ranges between two states, and whether both are there."""
    _, _, range_m = line_of_sight(
        own.lat_deg, own.lon_deg, own.alt_m, other.lat_deg, other.lon_deg, other.alt_m,
        validate=False,
    )  # fmt: skip
    return range_m, own.present & other.present


def _improve(best: Approaches, target: IntArray, time_s: FloatArray, range_m: FloatArray) -> None:
    """Note what is nearer than all that was known, or as near and earlier."""
    maybe = range_m <= best.range_m[target]
    target, time_s, range_m = target[maybe], time_s[maybe], range_m[maybe]
    order = np.lexsort((time_s, range_m, target))
    one = order[np.flatnonzero(np.diff(target[order], prepend=-1))]
    known_m, known_s = best.range_m[target[one]], best.time_s[target[one]]
    nearer = range_m[one] < known_m
    nearer |= (range_m[one] == known_m) & (time_s[one] < known_s)
    one = one[nearer]
    best.range_m[target[one]] = range_m[one]
    best.time_s[target[one]] = time_s[one]


def looked_at_one_by_one(
    own: Any, targets: Sequence[Any], times_of: Callable[[Any], FloatArray], end_s: float
) -> Approaches:
    """Find closest approaches by looking at every time of every target.

    Parameters
    ----------
    own : object with `at(time_s)`
    targets : sequence of the like
    times_of : callable
        Gives the times (n,) of a target.
    end_s : float
        Times outside [0, `end_s`] are left out.
    """
    best = Approaches.none(len(targets))
    for number, target in enumerate(targets):
        times = times_of(target)
        times = times[(times >= 0) & (times <= end_s)]
        for start in range(0, len(times), MOST_AT_ONCE):
            some = times[start : start + MOST_AT_ONCE]
            which = np.full(len(some), number)
            range_m, there = _apart(own.at(some), target.at(some))
            _improve(best, which[there], some[there], range_m[there])
    return best
