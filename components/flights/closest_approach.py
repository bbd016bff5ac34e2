"""The instant of closest approach: time is halved, with the largest speeds as proof.

Distances are compared at given times. A target that is d away at one of them is nowhere nearer
than d - v·dt up to a time dt before or after it, with v the sum of the two largest speeds: a
stretch of time in which that leaves nothing nearer than what is known already is not looked at.
The result is that of looking at every time, to the bit. `refine_between_samples` then looks between
the nearest of these times and its neighbours.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from components.flights.fleet import Fleet, PieceSearch, Trajectory
from components.geometry import slant_range_m
from dsa_des.arrays.types import FloatArray, IntArray

# -- the times at which distances are compared; none are ever laid out in full: a flight of a month
# on a grid of tenths of a second has 26 million of them.

_DIGITS = 9


def regular_times_s(step_s: float, number: IntArray) -> FloatArray:
    """Return the times (s) of numbered points of a regular grid, whose point 0 is at 0 s.

    They are rounded to nanoseconds, so that 0.1 s steps read 99.6 and not 99.60000000000001.
    """
    return np.round(number * step_s, _DIGITS)


def regular_count(step_s: float, duration_s: float) -> int:
    """Return how many of the times 0, step, 2 step, ... lie in [0, ``duration_s``]."""
    return int(duration_s / step_s) + 1


class SampleTimes(Protocol):
    """The ascending sample times of each of many targets."""

    def time_of(self, target: IntArray, number: IntArray) -> FloatArray:
        """Return for each target the time (s) of its sample with the given number, shape (n,)."""

    def first_and_last_sample_numbers(
        self, target: IntArray, first_s: FloatArray, last_s: FloatArray
    ) -> tuple[IntArray, IntArray]:
        """Return each target's first and last sample number in [first_s, last_s], both (n,).

        Where there is none, the last is below the first.
        """


@dataclass(frozen=True)
class RegularTimes:
    """Every target's times are one grid: 0, step, 2 step, ... to the duration, up to rounding."""

    step_s: float
    duration_s: float

    def time_of(self, target: IntArray, number: IntArray) -> FloatArray:
        """Return for each target the time (s) of its sample with the given number, shape (n,)."""
        return regular_times_s(self.step_s, number)

    def first_and_last_sample_numbers(
        self, target: IntArray, first_s: FloatArray, last_s: FloatArray
    ) -> tuple[IntArray, IntArray]:
        """Return each target's first and last sample number in [first_s, last_s], both (n,)."""
        end = regular_count(self.step_s, self.duration_s) - 1
        guess = np.minimum(np.maximum(first_s, 0.0), self.duration_s) / self.step_s
        first = np.maximum(guess.astype(np.int64) - 1, 0)
        for _ in range(3):  # the division and the rounding are wrong by less than a step each
            first += self.time_of(target, first) < first_s
        guess = np.minimum(np.maximum(last_s, -self.step_s), self.duration_s) / self.step_s
        last = np.minimum(np.floor(guess).astype(np.int64) + 1, end)
        for _ in range(3):
            last -= self.time_of(target, last) > last_s
        return first, last


class KnownTimes:
    """Sample times given singly, ascending for each target; those of only one hold for all."""

    def __init__(self, *times_s: FloatArray) -> None:
        self._find = PieceSearch.from_starts(times_s)
        self._of_each = np.asarray(len(times_s) > 1)

    def time_of(self, target: IntArray, number: IntArray) -> FloatArray:
        """Return for each target the time (s) of its sample with the given number, shape (n,)."""
        return self._find.starts_s[self._find.first[target * self._of_each] + number]

    def first_and_last_sample_numbers(
        self, target: IntArray, first_s: FloatArray, last_s: FloatArray
    ) -> tuple[IntArray, IntArray]:
        """Return each target's first and last sample number in [first_s, last_s], both (n,)."""
        of = target * self._of_each
        times_s, start = self._find.starts_s, self._find.first[of]
        first, last = self._find(of, first_s), self._find(of, last_s)
        first += times_s[first] < first_s
        last -= times_s[last] > last_s
        return first - start, last - start


# As in `near_intervals`: speeds of turns and long legs hold to 2e-4, positions to under a metre.
_SPEED_MARGIN = 1.001
_RANGE_MARGIN_M = 1.0
#: So many stretches of time are looked at together: it bounds the memory, however long the run.
MOST_AT_ONCE = 32_768


@dataclass(frozen=True, eq=False)
class Approaches:
    """The closest approach of each target to the ownship: its time (s) and its slant range (m).

    Where two are never there together at any of the times these are NaN and infinite.
    """

    time_s: FloatArray
    range_m: FloatArray

    @classmethod
    def unknown(cls, targets: int) -> "Approaches":
        """Return approaches of that many targets before any comparison: ranges inf, times NaN."""
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
    """Return each target's smallest slant range to the ownship, and its earliest sample time.

    Flights are asked by `own_at` and `targets_at` of targets (n,), each at a time (n,) of its own;
    only times from `present_s[0]` to `present_s[1]` are looked at. What is known already, `best`,
    is improved in place.
    """
    closing = closing_speed_mps * _SPEED_MARGIN
    best = Approaches.unknown(len(closing)) if best is None else best
    target = np.arange(len(closing))
    first, last = times.first_and_last_sample_numbers(target, *present_s)
    some = first <= last
    waiting = [(target[some], first[some], last[some])]
    while waiting:
        target, first, last = waiting.pop()
        if len(target) > MOST_AT_ONCE:  # the later part waits
            waiting.append((target[MOST_AT_ONCE:], first[MOST_AT_ONCE:], last[MOST_AT_ONCE:]))
            target, first, last = (a[:MOST_AT_ONCE] for a in (target, first, last))
        middle = (first + last) // 2
        time_s = times.time_of(target, middle)
        range_m, there = _ranges_and_both_present(
            own_at(target, time_s), targets_at(target, time_s)
        )
        _update_where_closer(best, target[there], time_s[there], range_m[there])
        away_s = np.maximum(
            time_s - times.time_of(target, first), times.time_of(target, last) - time_s
        )
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


#: Distances are compared at times so far apart where nothing else is asked for, s.
STEP_S = 0.1
# Nearer by less is rounding: an aircraft in formation is closest when it first is.
_NEARER_M = 1e-3


def refine_between_samples(
    own_at: Callable[[IntArray, FloatArray], Any],
    targets_at: Callable[[IntArray, FloatArray], Any],
    step_s: FloatArray,
    present_s: tuple[FloatArray, FloatArray],
    best: Approaches,
) -> None:
    """Refine closest approaches in place by times up to one step before and after each.

    The square of a distance is a parabola in time where both fly straight: the vertex is exact
    then, and is come nearer to in smaller steps where they turn. Flights are asked as by
    `closest_approaches`.
    """
    target = np.flatnonzero(np.isfinite(best.range_m))
    for share in (1.0, 0.1, 0.01) if len(target) else ():
        middle, reach = best.time_s[target], share * step_s[target]
        ends = (
            np.maximum(middle - reach, present_s[0][target]),
            np.minimum(middle + reach, present_s[1][target]),
        )
        before, after = (
            _ranges_and_both_present(own_at(target, t), targets_at(target, t))[0] for t in ends
        )
        square = best.range_m[target] ** 2
        with np.errstate(invalid="ignore", divide="ignore"):
            rising = (square - before**2) / (middle - ends[0])
            slope = (after**2 - square) / (ends[1] - middle)
            bend = (slope - rising) / (ends[1] - ends[0])
            vertex = middle - 0.5 * (rising / bend + middle - ends[0])
        some = np.flatnonzero(np.isfinite(vertex) & (bend > 0.0))
        time_s = np.round(np.clip(vertex, *ends)[some], _DIGITS)
        here = target[some]
        range_m, there = _ranges_and_both_present(own_at(here, time_s), targets_at(here, time_s))
        nearer = there & (range_m < best.range_m[here] - _NEARER_M)
        best.range_m[here[nearer]], best.time_s[here[nearer]] = range_m[nearer], time_s[nearer]


def _ranges_and_both_present(own: Any, other: Any) -> tuple[FloatArray, Any]:
    """Return the slant ranges (m) between two states, and a mask, True if both are present."""
    range_m = slant_range_m(
        own.lat_deg, own.lon_deg, own.alt_m, other.lat_deg, other.lon_deg, other.alt_m
    )
    return range_m, own.present & other.present


def _update_where_closer(
    best: Approaches, target: IntArray, time_s: FloatArray, range_m: FloatArray
) -> None:
    """Update ``best`` in place where a new range is smaller, or as small and earlier."""
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


def describe_censoring_ends(
    own: Trajectory,
    targets: Fleet,
    compared_at: Sequence[SampleTimes],
    time_s: FloatArray,
    end_s: float,
) -> list[str]:
    """Return by target, in words, at which end of the times its closest approach is, or nothing."""
    present_s = np.array(common_presence_bounds_s(own, targets.intervals_present_s, end_s))
    looked_s = np.array(_sample_span_s(compared_at, *present_s))
    return [
        describe_censoring_end(time, looked_s[:, number], present_s[:, number], end_s)
        for number, time in enumerate(time_s.tolist())
    ]


def describe_censoring_end(
    time_s: float, looked_s: FloatArray, present_s: FloatArray, end_s: float
) -> str:
    """Return in words at which end of the times a closest approach lies; empty if at neither."""
    if time_s <= looked_s[0]:
        return "the start of its flight" if present_s[0] > 0.0 else "the start"
    if time_s >= looked_s[1]:
        return "the end of the run" if present_s[1] >= end_s else "the end of its flight"
    return ""


def common_presence_bounds_s(
    own: Any, intervals_s: FloatArray, end_s: float
) -> tuple[FloatArray, FloatArray]:
    """Return the first and last time (s) at which each target and the ownship may be present."""
    first, last = own.interval_present()
    return (
        np.maximum(intervals_s[:, 0], max(first, 0.0)),
        np.minimum(intervals_s[:, 1], min(last, end_s)),
    )


def _sample_span_s(
    compared_at: Sequence[SampleTimes], begin_s: FloatArray, end_s: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the times (s) of each target's first and last sample in [begin_s, end_s], or NaN."""
    first, last = np.full(len(begin_s), np.nan), np.full(len(begin_s), np.nan)
    for times in compared_at:
        targets = np.arange(len(begin_s))
        low, high = times.first_and_last_sample_numbers(targets, begin_s, end_s)
        some = np.flatnonzero(high >= low)
        first[some] = np.fmin(first[some], times.time_of(some, low[some]))
        last[some] = np.fmax(last[some], times.time_of(some, high[some]))
    return first, last


def approaches_of_run(
    own: Trajectory, targets: Fleet, times: Sequence[SampleTimes], end_s: float, *, between: bool
) -> Approaches:
    """Return closest approaches at the sample times and, with ``between``, between them."""
    best, speeds = Approaches.unknown(len(targets)), targets.max_speeds_mps
    present_s = common_presence_bounds_s(own, targets.intervals_present_s, end_s)
    flights = (lambda _, time_s: own.at(time_s)), targets.each
    for some in times:
        closest_approaches(
            *flights, some,
            closing_speed_mps=speeds + own.max_speed_mps, present_s=present_s, best=best,
        )  # fmt: skip
    if between:
        refine_between_samples(*flights, np.full(len(speeds), STEP_S), present_s, best)
    return best
