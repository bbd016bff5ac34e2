"""Relative flights of many runs, looked at together: the first loss, and the closest approach.

What each gives is what `components.metrics.separation` finds flight by flight, to the bit.
"""

from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np

from components.flights.closest_approach import Approaches, closest_approaches
from components.flights.sample_times import OwnTimes, RegularTimes, SampleTimes
from components.flights.sampled_flight import CELLS_AT_ONCE
from components.flights.steered_flights import ManyFlights
from components.geometry.ellipsoid import line_of_sight_ned
from components.geometry.state import TrajectoryState
from components.metrics.separation import RelativeFlight, closest, distances_m, first_inside
from components.well_clear.curved_flights import first_inside_cylinder
from dsa_des.arrays.types import FloatArray, IntArray


class FlightsTogether:
    """The ownships and targets of many relative flights.

    Parameters
    ----------
    flights : sequence of RelativeFlight
    """

    def __init__(self, flights: Sequence[RelativeFlight]) -> None:
        self.flights = flights
        owns = {id(flight.own): flight.own for flight in flights}
        places = {key: place for place, key in enumerate(owns)}
        self._own_of = np.array([places[id(flight.own)] for flight in flights], dtype=np.int64)
        self._owns = ManyFlights(list(owns.values()))
        self._targets = ManyFlights([flight.target for flight in flights])

    def __len__(self) -> int:
        return len(self.flights)

    def own_at(self, flight: IntArray, time_s: FloatArray) -> TrajectoryState:
        """Return the states of the ownships of flights (n,), each at a time (n,) of its own."""
        return self._owns.each(self._own_of[flight], time_s)

    def target_at(self, flight: IntArray, time_s: FloatArray) -> TrajectoryState:
        """Return the states of the targets, likewise."""
        return self._targets.each(flight, time_s)

    def present_s(self) -> tuple[FloatArray, FloatArray]:
        """Return the first and the last time (flights,) at which both aircraft may be there, s."""
        limits = np.array([flight.present_s() for flight in self.flights]).reshape(-1, 2)
        return limits[:, 0], limits[:, 1]

    def closing_mps(self) -> FloatArray:
        """No distance of the two of a flight changes faster, m/s, (flights,)."""
        return np.array([flight.closing_mps for flight in self.flights])

    def level_distances_m(self, flight: IntArray, time_s: FloatArray) -> tuple[FloatArray, ...]:
        """Return horizontal distance and difference of altitudes; infinite where one is absent."""
        blocks = [
            self._level_distances_m(flight[first : first + CELLS_AT_ONCE],
                                    time_s[first : first + CELLS_AT_ONCE])
            for first in range(0, len(flight), CELLS_AT_ONCE)
        ]  # fmt: skip
        return tuple(np.concatenate(parts) for parts in zip(*blocks, strict=True))

    def _level_distances_m(
        self, flight: IntArray, time_s: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        return distances_m(self.own_at(flight, time_s), self.target_at(flight, time_s))[1:]


def _place(state: Any) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return latitude and longitude (deg) and altitude (m) of a state."""
    return state.lat_deg, state.lon_deg, state.alt_m


def first_losses_s(flights: Sequence[RelativeFlight], *limits_m: tuple[float, float]) -> FloatArray:
    """Return when targets first are within each pair of distances (exclusive).

    Flights that look between samples are asked by `components.well_clear.curved_flights`, with its
    error bound; others at their times only.

    Parameters
    ----------
    flights : sequence of RelativeFlight
    *limits_m : (horizontal, vertical)

    Returns
    -------
    (flights, limits)
        s; NaN where a target never is.
    """
    found = np.full((len(flights), len(limits_m)), np.nan)
    between = [number for number, flight in enumerate(flights) if flight.between_samples]
    for number in sorted(set(range(len(flights))) - set(between)):
        found[number] = first_inside(flights[number], *limits_m)
    if not between:
        return found
    rows = np.array(between)
    together = FlightsTogether([flights[number] for number in between])
    first_s, last_s = together.present_s()
    end_s = np.array([flight.end_s for flight in together.flights])
    closing_mps = together.closing_mps()
    for k, limits in enumerate(limits_m):
        # Who never comes into a cylinder comes into none within it.
        maybe = np.ones(len(rows), dtype=np.bool_)
        for before, wider in enumerate(limits_m[:k]):
            if wider[0] >= limits[0] and wider[1] >= limits[1]:
                maybe &= ~np.isnan(found[rows, before])
        some = np.flatnonzero(maybe)
        apart = partial(_of_some, together.level_distances_m, some)
        found[rows[some], k] = first_inside_cylinder(
            apart, (np.maximum(first_s, 0.0)[some], np.minimum(last_s, end_s)[some]),
            closing_mps[some], *limits,
        )  # fmt: skip
    return found


def nearest_of(flights: Sequence[RelativeFlight]) -> tuple[FloatArray, FloatArray]:
    """Return the smallest range (m) of each flight and its time (s), as `closest` does.

    Infinite and NaN where both are never there.
    """
    found = np.full((2, len(flights)), np.inf)
    short = [number for number, flight in enumerate(flights) if flight.is_short]
    for number in sorted(set(range(len(flights))) - set(short)):
        found[:, number] = closest(flights[number])[:2]
    if short:
        found[:, short] = _nearest([flights[number] for number in short])
    return found[0], found[1]


def _nearest(flights: Sequence[RelativeFlight]) -> tuple[FloatArray, FloatArray]:
    together = FlightsTogether(flights)
    first_s, last_s = together.present_s()
    best = Approaches.none(len(flights))
    grids: dict[tuple[float, float], list[int]] = {}
    for number, flight in enumerate(flights):
        grids.setdefault((flight.step_s, flight.grid_end_s), []).append(number)
    own_samples = OwnTimes([flight.sample_times_s() for flight in flights])
    ends_s = np.array([flight.grid_end_s for flight in flights])
    every = np.arange(len(flights))
    looks: list[tuple[IntArray, SampleTimes]] = [(every, own_samples)]
    looks += [(np.array(n), RegularTimes(step_s, end_s)) for (step_s, end_s), n in grids.items()]
    for some, times in looks:
        mine = Approaches(best.time_s[some], best.range_m[some])
        closest_approaches(
            partial(_of_some, together.own_at, some),
            partial(_of_some, together.target_at, some),
            times,
            closing_speed_mps=together.closing_mps()[some],
            present_s=(first_s[some], np.minimum(last_s, ends_s)[some]),
            best=mine,
        )
        best.time_s[some], best.range_m[some] = mine.time_s, mine.range_m
    return best.range_m, best.time_s


def _of_some(at: Any, some: IntArray, flight: IntArray, time_s: FloatArray) -> Any:
    return at(some[flight], time_s)


def ways_of(
    flights: Sequence[RelativeFlight], time_s: FloatArray, base_s: float
) -> tuple[FloatArray, FloatArray]:
    """Return how far ownships and targets move around a time (flights,) of each, m.

    Parameters
    ----------
    flights : sequence of RelativeFlight
    time_s : (flights,)
        When both are there.
    base_s : float
        So long before and after it, as far as both are there; the frame is that of the ownship's
        level plane then.

    Returns
    -------
    own, target : (2, flights)
        North and east.
    """
    together = FlightsTogether(flights)
    first_s, last_s = together.present_s()
    last_s = np.minimum(last_s, [flight.end_s for flight in flights])
    every = np.arange(len(flights))
    here = _place(together.own_at(every, time_s))
    ends = [np.clip(time_s + sign * base_s, first_s, last_s) for sign in (-1.0, 1.0)]
    found = []
    for at in (together.own_at, together.target_at):
        (north0, east0, _), (north1, east1, _) = (
            line_of_sight_ned(*here, *_place(at(every, end)), validate=False) for end in ends
        )
        found.append(np.array([north1 - north0, east1 - east0]))
    return found[0], found[1]
