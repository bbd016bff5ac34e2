"""First losses of separation and closest approaches, and the geometry of the meeting.

Results of many flights are those flight by flight, to the bit.
"""

import math
from collections.abc import Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from components.flights.closest_approach import (
    Approaches,
    KnownTimes,
    RegularTimes,
    SampleTimes,
    closest_approaches,
    describe_censoring_end,
)
from components.flights.fleet import CELLS_AT_ONCE
from components.flights.many_flights import fleet_of
from components.geometry import TrajectoryState, line_of_sight_ned
from components.metrics.separation import (
    RelativeFlight,
    lat_lon_alt_of,
    own_enu_with_mean_velocity,
    range_horizontal_vertical_m,
)
from components.well_clear.separation import first_time_inside_cylinder_s
from components.well_clear.volume import Volume, is_inside_cylinder, violation_span
from dsa_des.arrays.types import FloatArray, IntArray


def find_closest_approach(flight: RelativeFlight) -> tuple[float, float, str]:
    """Return a flight's smallest range (m), its earliest time (s), and a word for its censoring.

    See `components.flights.closest_approach.describe_censoring_end`.
    """
    best = (float("inf"), float("nan"))
    looked_s = np.full(2, np.nan)
    for piece in flight.separations_by_piece():
        index = int(np.argmin(piece.range_m))
        if piece.range_m[index] < best[0]:
            best = float(piece.range_m[index]), float(piece.time_s[index])
        there_s = piece.time_s[np.isfinite(piece.range_m)]
        if len(there_s):
            looked_s = np.array([np.fmin(looked_s[0], there_s[0]), there_s[-1]])
    present_s = np.array(flight.presence_start_and_end_s())[:, 0]
    return *best, describe_censoring_end(best[1], looked_s, present_s, flight.end_s)


def first_times_inside(flight: Any, *limits_m: tuple[float, float]) -> list[float]:
    """Return when the target is first within each (horizontal, vertical) distance, s; else NaN.

    Asked at the flight's times only, and exclusive; `flight_times_first_within_s` looks between
    them.
    """
    result = [float("nan")] * len(limits_m)
    for piece in flight.separations_by_piece():
        for number, (horizontal_m, vertical_m) in enumerate(limits_m):
            inside = is_inside_cylinder(
                piece.horizontal_m, piece.vertical_m, horizontal_m, vertical_m
            )
            if np.isnan(result[number]) and inside.any():
                result[number] = float(piece.time_s[np.argmax(inside)])
        if not np.isnan(result).any():
            break
    return result


def first_violation_s(flight: RelativeFlight, volume: Volume) -> float:
    """Return the first time at which a flight violates a well-clear volume, s; NaN if never.

    Between one time of the flight's grid, or sample of its source, and the next, both aircraft are
    taken to fly straight; the volume's closed form then tells when it is entered, at any time at
    all. Straight flights are exact. With a relative acceleration a, a spacing d of the times and a
    closing speed v, a velocity is wrong by a·d at most, and with it the begin of a violation by
    modified tau by some (τ + range/v)·a·d/v: at 1 m/s², 0.1 s and 100 m/s by 0.07 s with 35 s.
    """
    carried = np.empty(0)
    for piece in flight.separations_by_piece():
        there = np.isfinite(piece.range_m)
        time_s = np.concatenate([carried, piece.time_s[there]])
        carried = time_s[-1:] if len(there) and there[-1] else np.empty(0)
        if len(time_s) < 2:
            continue
        begin, end = time_s[:-1], time_s[1:]
        span = violation_span(
            volume, own_enu_with_mean_velocity(flight, begin, begin, end), 0.0, end - begin
        )
        met = np.isfinite(span.begin_s)
        if met.any():
            first = int(np.argmax(met))
            return float(begin[first] + span.begin_s[first])
    return float("nan")


class FlightsTogether:
    """The own and target aircraft of many relative flights, evaluated together."""

    def __init__(self, flights: Sequence[RelativeFlight]) -> None:
        self.flights = flights
        owns = {id(flight.own): flight.own for flight in flights}
        number_of = {key: number for number, key in enumerate(owns)}
        self._own_of = np.array([number_of[id(flight.own)] for flight in flights], dtype=np.int64)
        self._owns = fleet_of(list(owns.values()))
        self._targets = fleet_of([flight.target for flight in flights])

    def own_at(self, flight: IntArray, time_s: FloatArray) -> TrajectoryState:
        """Return the states of the ownships of flights (n,), each at a time (n,) of its own."""
        return self._owns.each(self._own_of[flight], time_s)

    def target_at(self, flight: IntArray, time_s: FloatArray) -> TrajectoryState:
        """Return the states of the targets of flights (n,), each at its own time (n,)."""
        return self._targets.each(flight, time_s)

    def presence_start_and_end_s(self) -> tuple[FloatArray, FloatArray]:
        """Return when both aircraft can be present, first and last time, (flights,) each, s."""
        limits = np.array([flight.presence_start_and_end_s() for flight in self.flights]).reshape(
            -1, 2
        )
        return limits[:, 0], limits[:, 1]

    def closing_speed_bound_mps(self) -> FloatArray:
        """Return an upper bound on how fast any distance in a flight changes, (flights,), m/s."""
        return np.array([flight.closing_speed_bound_mps for flight in self.flights])

    def horizontal_and_vertical_m(
        self, flight: IntArray, time_s: FloatArray
    ) -> tuple[FloatArray, ...]:
        """Return horizontal, vertical distance (n,), each at its time, m; infinite if absent."""
        return self.range_horizontal_vertical_at_m(flight, time_s)[1:]

    def range_horizontal_vertical_at_m(
        self, flight: IntArray, time_s: FloatArray
    ) -> tuple[FloatArray, ...]:
        """Return slant range, horizontal distance, altitude difference (n,) at own times, m."""
        blocks = []
        for first in range(0, len(flight), CELLS_AT_ONCE):
            some = flight[first : first + CELLS_AT_ONCE], time_s[first : first + CELLS_AT_ONCE]
            blocks.append(range_horizontal_vertical_m(self.own_at(*some), self.target_at(*some)))
        return tuple(np.concatenate(parts) for parts in zip(*blocks, strict=True))


def flight_times_first_within_s(
    flights: Sequence[RelativeFlight], *limits_m: tuple[float, float]
) -> FloatArray:
    """Return when (s) targets first meet each (horizontal, vertical) limit, (flights, limits).

    NaN where a target never is. Flights that look between samples are asked by
    `components.well_clear.separation`, with its error bound; others at their times only.
    """
    result = np.full((len(flights), len(limits_m)), np.nan)
    between = [number for number, flight in enumerate(flights) if flight.between_samples]
    for number in sorted(set(range(len(flights))) - set(between)):
        result[number] = first_times_inside(flights[number], *limits_m)
    if not between:
        return result
    rows = np.array(between)
    together = FlightsTogether([flights[number] for number in between])
    first_s, last_s = together.presence_start_and_end_s()
    end_s = np.array([flight.end_s for flight in together.flights])
    closing_mps = together.closing_speed_bound_mps()
    for k, limits in enumerate(limits_m):
        # Who never comes into a cylinder comes into none within it.
        maybe = np.ones(len(rows), dtype=np.bool_)
        for before, wider in enumerate(limits_m[:k]):
            if wider[0] >= limits[0] and wider[1] >= limits[1]:
                maybe &= ~np.isnan(result[rows, before])
        some = np.flatnonzero(maybe)
        apart = partial(_states_of_some, together.horizontal_and_vertical_m, some)
        result[rows[some], k] = first_time_inside_cylinder_s(
            apart, (np.maximum(first_s, 0.0)[some], np.minimum(last_s, end_s)[some]),
            closing_mps[some], *limits,
        )  # fmt: skip
    return result


def nearest_ranges_and_times(flights: Sequence[RelativeFlight]) -> tuple[FloatArray, FloatArray]:
    """Return each flight's smallest range (m) and its time (s), each (flights,).

    Infinite and NaN where both are never there.
    """
    result = np.full((2, len(flights)), np.inf)
    short = [number for number, flight in enumerate(flights) if flight.has_few_sample_times]
    for number in sorted(set(range(len(flights))) - set(short)):
        result[:, number] = find_closest_approach(flights[number])[:2]
    if short:
        result[:, short] = _nearest_of_short_flights([flights[number] for number in short])
    return result[0], result[1]


def _nearest_of_short_flights(flights: Sequence[RelativeFlight]) -> tuple[FloatArray, FloatArray]:
    together = FlightsTogether(flights)
    first_s, last_s = together.presence_start_and_end_s()
    best = Approaches.unknown(len(flights))
    grids: dict[tuple[float, float], list[int]] = {}
    for number, flight in enumerate(flights):
        grids.setdefault((flight.step_s, flight.grid_end_s), []).append(number)
    own_samples = KnownTimes(*(flight.source_sample_times_s() for flight in flights))
    ends_s = np.array([flight.grid_end_s for flight in flights])
    every = np.arange(len(flights))
    looks: list[tuple[IntArray, SampleTimes]] = [(every, own_samples)]
    looks += [(np.array(n), RegularTimes(step_s, end_s)) for (step_s, end_s), n in grids.items()]
    for some, times in looks:
        mine = Approaches(best.time_s[some], best.range_m[some])
        closest_approaches(
            partial(_states_of_some, together.own_at, some),
            partial(_states_of_some, together.target_at, some),
            times,
            closing_speed_mps=together.closing_speed_bound_mps()[some],
            present_s=(first_s[some], np.minimum(last_s, ends_s)[some]),
            best=mine,
        )
        best.time_s[some], best.range_m[some] = mine.time_s, mine.range_m
    return best.range_m, best.time_s


def loss_nmac_and_start_times_s(
    sizes_m: tuple[tuple[float, float], ...],
    runs: Sequence[list[RelativeFlight]],
    tau_s: float = 0.0,
) -> FloatArray:
    """Return times (3, runs), s: first loss of well clear, first NMAC, start (0); NaN if never.

    Of runs with several flights the first counts; NaN for what never happens, (3, runs). Sizes are
    (horizontal, vertical) of well clear and of a collision; a modified tau of 0 is a cylinder.
    """
    flights = [flight for run in runs for flight in run]
    of_run = np.repeat(np.arange(len(runs)), [len(run) for run in runs])
    first = flight_times_first_within_s(flights, *sizes_m)
    if tau_s > 0.0:
        volume = Volume(*sizes_m[0], horizontal_time_s=tau_s)
        first[:, 0] = [first_violation_s(flight, volume) for flight in flights]
    result = np.full((3, len(runs)), np.nan)
    for value in (0, 1):
        np.fmin.at(result[value], of_run, first[:, value])
    result[2, of_run] = 0.0
    return result


def run_times_first_within_s(
    limits_m: Sequence[tuple[float, float]], runs: Sequence[list[RelativeFlight]]
) -> FloatArray:
    """Return when (s) any target is first within each (horizontal, vertical) limit, (limits, runs).

    (limits, runs); NaN for never. Limits fall.
    """
    flights = [flight for run in runs for flight in run]
    of_run = np.repeat(np.arange(len(runs)), [len(run) for run in runs])
    first = flight_times_first_within_s(flights, *limits_m)
    result = np.full((len(limits_m), len(runs)), np.nan)
    for number in range(len(limits_m)):
        np.fmin.at(result[number], of_run, first[:, number])
    return result


def _states_of_some(at: Any, some: IntArray, flight: IntArray, time_s: FloatArray) -> Any:
    return at(some[flight], time_s)


def displacements_around(
    flights: Sequence[RelativeFlight], time_s: FloatArray, base_s: float
) -> tuple[FloatArray, FloatArray]:
    """Return own and target displacements over a span at each time: north, east, (2, flights), m.

    From `base_s` before it to as long after it, as far as both are there; (north, east) in the
    ownship's level plane then, each (2, flights).
    """
    together = FlightsTogether(flights)
    first_s, last_s = together.presence_start_and_end_s()
    last_s = np.minimum(last_s, [flight.end_s for flight in flights])
    every = np.arange(len(flights))
    here = lat_lon_alt_of(together.own_at(every, time_s))
    ends = [np.clip(time_s + sign * base_s, first_s, last_s) for sign in (-1.0, 1.0)]
    result = []
    for at in (together.own_at, together.target_at):
        (north0, east0, _), (north1, east1, _) = (
            line_of_sight_ned(*here, *lat_lon_alt_of(at(every, end)), validate=False)
            for end in ends
        )
        result.append(np.array([north1 - north0, east1 - east0]))
    return result[0], result[1]


# How far apart distances are looked at to choose runs by.
_COARSE_S = 1.0
# Courses are taken over this time to both sides of the closest approach.
_BASE_S = 0.5


def nearest_course_and_bearing_deg(runs: Sequence[list[RelativeFlight]]) -> FloatArray:
    """Return nearest intruders' relative course, bearing at closest approach, (2, runs), degrees.

    Course: the intruder's less the ownship's. Bearing from where the intruder closes in, clockwise
    from the ownship's course: opposite to its velocity relative to the ownship. NaN where they
    never meet.
    """
    flights = [flight for run in runs for flight in run]
    nearest = _nearest_flight_of_each_run(runs, *nearest_ranges_and_times(flights))
    angles = np.full((2, len(runs)), np.nan)
    angles[:, nearest.runs] = _course_and_bearing_deg(
        *displacements_around([flights[k] for k in nearest.flights], nearest.time_s, _BASE_S)
    )
    return angles


def nearest_meeting_geometry(
    sizes_m: Sequence[tuple[float, float]], runs: Sequence[list[RelativeFlight]]
) -> FloatArray:
    """Return roughly the time, distances, speed, lead time, course and bearing of each run's
    nearest meeting, then two distances per cylinder, (7 + 2 cylinders, runs).

    Time (s), horizontal and vertical distance (m) and relative speed in the level plane (m/s) at
    the closest approach, NaN for how long before it was foreseen, then course and bearing
    (`nearest_course_and_bearing_deg`), degrees; NaN where none is met. Then how near any comes to
    the side while no further up or down than each cylinder reaches, and up or down while no
    further to the side, m; infinite where it never is. Distances are looked at every `_COARSE_S`:
    enough to choose by.
    """
    flights = [flight for run in runs for flight in run]
    result = np.full((7 + 2 * len(sizes_m), len(runs)), np.nan)
    result[7:] = np.inf
    if not flights:
        return result
    together = FlightsTogether(flights)
    many = 1 + int(max(flight.end_s for flight in flights) / _COARSE_S)
    times_s, every = _COARSE_S * np.arange(many), np.arange(len(flights))
    level_m, up_m = (
        part.reshape(len(flights), many)
        for part in together.horizontal_and_vertical_m(
            np.repeat(every, many), np.tile(times_s, len(flights))
        )
    )
    range_m = np.hypot(level_m, up_m)
    index = np.argmin(range_m, axis=1)
    nearest = _nearest_flight_of_each_run(runs, range_m[every, index], times_s[index])
    some, time_s = nearest.flights, nearest.time_s
    own_m, other_m = displacements_around([flights[k] for k in some], time_s, _BASE_S)
    speed_mps = np.hypot(*(other_m - own_m)) / (2.0 * _BASE_S)
    result[0, nearest.runs] = time_s
    result[1, nearest.runs] = level_m[some, index[some]]
    result[2, nearest.runs] = up_m[some, index[some]]
    result[3, nearest.runs] = speed_mps
    result[5:7, nearest.runs] = _course_and_bearing_deg(own_m, other_m)
    of = np.repeat(np.arange(len(runs)), [len(run) for run in runs])
    for k, (radius_m, half_m) in enumerate(sizes_m):
        for row, near, miss_m in ((0, up_m < half_m, level_m), (1, level_m < radius_m, up_m)):
            found = np.where(near, miss_m, np.inf).min(axis=1)
            np.minimum.at(result[7 + row * len(sizes_m) + k], of, found)
    return result


def run_nearest_range_and_time(runs: Sequence[list[RelativeFlight]]) -> FloatArray:
    """Return each run's smallest range over all its flights (m) and its time (s), (2, runs).

    NaN where no two are ever there together.
    """
    range_m, time_s = nearest_ranges_and_times([flight for run in runs for flight in run])
    nearest = _nearest_flight_of_each_run(runs, range_m, time_s)
    result = np.full((2, len(runs)), np.nan)
    result[:, nearest.runs] = range_m[nearest.flights], nearest.time_s
    return result


class _Nearest(NamedTuple):
    """Indices of runs that meet another aircraft, each one's nearest flight (index) and time."""

    runs: list[int]
    flights: IntArray
    time_s: FloatArray


def _nearest_flight_of_each_run(
    runs: Sequence[list[RelativeFlight]], distance_m: FloatArray, time_s: FloatArray
) -> _Nearest:
    met: list[int] = []
    nearest: list[int] = []
    start = 0
    for number, run in enumerate(runs):
        index = start + int(np.argmin(distance_m[start : start + len(run)])) if run else start
        if run and np.isfinite(distance_m[index]):
            met.append(number)
            nearest.append(index)
        start += len(run)
    chosen = np.array(nearest, dtype=np.int64)
    return _Nearest(met, chosen, time_s[chosen])


def _course_and_bearing_deg(own_m: FloatArray, other_m: FloatArray) -> FloatArray:
    """Return intruders' relative course and bearing from both displacements, (2, flights), deg."""
    angles = np.empty((2, own_m.shape[1]))
    for number, (own, other) in enumerate(zip(own_m.T.tolist(), other_m.T.tolist(), strict=True)):
        course = [math.degrees(math.atan2(e, n)) for n, e in (own, other)]
        closing = math.degrees(math.atan2(own[1] - other[1], own[0] - other[0]))
        angles[:, number] = (course[1] - course[0]) % 360.0, (closing - course[0]) % 360.0
    return angles
