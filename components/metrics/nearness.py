"""How near runs come to being within a cylinder about the ownship, for splitting.

Two scores tell it, each of the truth up to an instant. ``separation``: the least distance so far,
in sizes of the cylinder. ``time_to_go``: the least time so far after which a target would be within
the cylinder if both flew straight on, s. A manoeuvre is decided while aircraft are far apart and
shows in their distance much later, but at once in where they are heading; so the time to go parts
runs by what is still open.
"""

from collections.abc import Sequence

import numpy as np

from components.flights.fleet import CELLS_AT_ONCE
from components.geometry import line_of_sight_ned
from components.metrics.losses import FlightsTogether, first_losses_s
from components.metrics.separation import RelativeFlight, position_of
from components.well_clear.volume import cylinder_span
from dsa_des.arrays.types import FloatArray, IntArray

#: Scores → levels that a pilot may choose, falling to the event: from 128 s and 512 sizes.
SCORES: dict[str, FloatArray] = {
    "time_to_go": np.append(2.0 ** (np.arange(56, -9, -1) / 8.0), 0.0),
    "separation": 2.0 ** (np.arange(72, -1, -1) / 8.0),
}
# Headings are looked at so often, and are those over so long before, s.
_STEP_S, _BASE_S = 1.0, 0.1

Runs = Sequence[list[RelativeFlight]]


def first_reached_s(
    score: str, cylinder_m: tuple[float, float], levels: Sequence[float], runs: Runs
) -> FloatArray:
    """Return when the first target of each run reaches each level of a score, s, (levels, runs).

    NaN for never. The cylinder is (radius, half height); levels fall, and the last may be the event
    itself: 1 size, or 0 s to go.
    """
    radius_m, half_m = cylinder_m
    flights = [flight for run in runs for flight in run]
    if score == "separation":
        limits_m = [(level * radius_m, level * half_m) for level in levels]
        first = first_losses_s(flights, *limits_m)
    else:
        first = _first_heading_s(flights, cylinder_m, levels)
    of_run = np.repeat(np.arange(len(runs)), [len(run) for run in runs])
    result = np.full((len(levels), len(runs)), np.nan)
    for number in range(len(levels)):
        np.fmin.at(result[number], of_run, first[:, number])
    return result


def _first_heading_s(
    flights: Sequence[RelativeFlight], cylinder_m: tuple[float, float], levels: Sequence[float]
) -> FloatArray:
    """Return when each flight first has so little time to go, s, (flights, levels)."""
    inside_s = first_losses_s(flights, cylinder_m)[:, 0]
    first = np.full((len(flights), len(levels)), np.inf)
    if flights and levels[0] > 0.0:
        together = FlightsTogether(flights)
        begin_s, end_s = together.present_s()
        begin_s = np.maximum(begin_s, 0.0) + _BASE_S
        end_s = np.minimum(end_s, [flight.end_s for flight in flights])
        many = np.maximum(np.floor((end_s - begin_s) / _STEP_S).astype(np.int64) + 1, 0)
        flight = np.repeat(np.arange(len(flights)), many)
        number = np.arange(len(flight)) - np.repeat(np.cumsum(many) - many, many)
        time_s = begin_s[flight] + _STEP_S * number
        to_go_s = np.concatenate(
            [np.empty(0)] + [
                _to_go_s(together, flight[start : start + CELLS_AT_ONCE],
                         time_s[start : start + CELLS_AT_ONCE], cylinder_m)
                for start in range(0, len(flight), CELLS_AT_ONCE)
            ]
        )  # fmt: skip
        for place, level in enumerate(levels):
            some = to_go_s <= level
            np.minimum.at(first[:, place], flight[some], time_s[some])
    # Who is within it has no time to go, at whatever instant it came there.
    first = np.fmin(first, inside_s[:, np.newaxis])
    return np.where(np.isinf(first), np.nan, first)


def _to_go_s(
    together: FlightsTogether, flight: IntArray, time_s: FloatArray, cylinder_m: tuple[float, float]
) -> FloatArray:
    """Return after which time each flight would be within the cylinder, infinite for never, s."""
    own, before = (position_of(together.own_at(flight, at)) for at in (time_s, time_s - _BASE_S))
    target, earlier = (
        position_of(together.target_at(flight, at)) for at in (time_s, time_s - _BASE_S)
    )

    def level(place: list[FloatArray]) -> FloatArray:
        return np.array(line_of_sight_ned(*own, *place, validate=False)[1::-1])

    now = np.array([*level(target), target[2] - own[2]])
    then = np.array([*(level(earlier) - level(before)), earlier[2] - before[2]])
    return cylinder_span(*cylinder_m, (*now, *((now - then) / _BASE_S))).begin_s
