"""True distances and velocities of the aircraft of an encounter, relative to the ownship.

Nothing here depends on what sensors see; it is read off the traffic block of a scene.
"""

import itertools
import math
from collections.abc import Iterator, Mapping
from copy import copy
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np

from components.flights.closest_approach import (
    STEP_S,
    SampleTimes,
    common_presence_bounds_s,
    regular_count,
    regular_times_s,
)
from components.geometry import line_of_sight, north_east_up_offsets_m
from components.traffic.source import TrafficSource
from dsa_des.arrays.types import FloatArray
from dsa_des.block.component import Context
from dsa_des.scene.block_table import Block
from dsa_des.scene.scene import Scene
from dsa_des.time.randomness import Streams

#: Times looked at together: it bounds the memory, however long the run.
MOST_AT_ONCE = 65_536
#: In place of who looks: distances are those between any two.
ANY_TWO = -2
# Times of a flight that are kept for metrics that ask for them again.
_KEPT = 4096
# The speeds of turns and long legs hold to 2e-4, and the ownship's level plane turns with it.
_SPEED_MARGIN, _TURN_MARGIN_MPS = 1.001, 0.1
# Velocities are differences of positions so far apart, s.
_BASE_S = 0.05


@dataclass(frozen=True, eq=False)
class Separation:
    """Distances between ownship and a target at some times; infinite where either is absent.

    The horizontal one lies in the ownship's level plane, the vertical one is the difference of the
    altitudes above the ellipsoid, not negative.
    """

    name: str
    time_s: FloatArray
    range_m: FloatArray
    horizontal_m: FloatArray
    vertical_m: FloatArray


def only_traffic_block(scene: Scene) -> Block:
    """Return the scene's only traffic block with known flights; ValueError if none or several."""
    result = [b for b in scene.blocks.values() if issubclass(b.cls, TrafficSource)]
    if len(result) != 1:
        raise ValueError(
            f"needs one block of traffic that knows its flights; this scene has {len(result)}"
        )
    return result[0]


def traffic_and_duration(scene: Scene) -> tuple[Any, float]:
    """Return a scene's traffic source, built without a run, and the duration of the run, s."""
    block = only_traffic_block(scene)
    context = Context(Streams(scene.seed), scene.ticks_per_s, sections=scene.sections)
    source: Any = block.cls(block.name, block.parameters, context)
    duration = scene.duration_s or source.natural_duration_s() or Fraction(0)
    context.duration_s = duration
    return source, float(duration)


def relative_flights(
    scene: Scene, step_s: float | None, until_s: float = math.inf, viewer: int = -1
) -> "list[RelativeFlight]":
    """Return the relative flight of every target of a scene, up to the time `until_s`.

    Seen from a target, by its index, it and the ownship (-1) change places; with `ANY_TWO` those of
    any two aircraft.

    They are taken on a grid of `step_s` and at the times of the source's own samples. None looks
    between them for losses, with a grid of `STEP_S` for all else.
    """
    source, duration_s = traffic_and_duration(scene)
    end_s = min(duration_s, until_s)
    count = regular_count(step_s or STEP_S, end_s)
    seen = [number for number in range(len(source.targets)) if number not in source.unseen]
    if viewer == ANY_TWO:
        pairs = list(itertools.combinations([-1, *seen], 2))
    else:
        pairs = [(viewer, number) for number in sorted({*seen, viewer} - {-1})]
    return [RelativeFlight(source, number, step_s, count, end_s, looks) for looks, number in pairs]


class RelativeFlight:
    """The distances between one target and the ownship over a run, computed piece by piece.

    A grid of `count` times, `step_s` apart; a spacing of None also looks between them.
    """

    def __init__(
        self,
        source: Any,
        number: int,
        step_s: float | None,
        count: int,
        end_s: float,
        viewer: int = -1,
    ) -> None:
        self._source = source
        #: Which of the targets the two are; -1 for the ownship.
        self.places = viewer, -1 if number == viewer else number
        #: Flights of who looks (the ownship, if nothing else is said) and of the target.
        self.own, self.target = (
            source.own if place < 0 else source.targets[place] for place in self.places
        )
        self.name: str = self.target.name if number != viewer else source.roster.own_name
        self.between_samples = step_s is None
        self.step_s, self._count = step_s or STEP_S, count
        self.end_s = end_s
        self._known: list[Separation] | None = None

    def replace_flights(self, flights: Mapping[int, Any]) -> "RelativeFlight":
        """Return this relative flight with the given aircraft's flights (-1: ownship) replaced."""
        result = copy(self)
        result.own, result.target = (
            flights.get(place, nominal)
            for place, nominal in zip(self.places, (self.own, self.target), strict=True)
        )
        result._known = None
        return result

    @property
    def has_few_sample_times(self) -> bool:
        """Return whether its sample times are few enough for one array."""
        return self._count <= _KEPT

    @property
    def grid_end_s(self) -> float:
        """The last time of the grid, s."""
        return float(regular_times_s(self.step_s, np.array([self._count - 1]))[0])

    def source_sample_times_s(self) -> FloatArray:
        """Return 0 and the times within the grid at which the source itself has samples, s."""
        result = [np.zeros(1)]
        for times in self._samples():
            result += [
                _sample_times_between(times, n, 0.0, self.grid_end_s)
                for n in self._targets_with_samples
            ]
        return np.unique(np.concatenate(result))

    def presence_start_and_end_s(self) -> tuple[FloatArray, FloatArray]:
        """Return the first and last time at which both aircraft can be present, (1,) each, s."""
        return common_presence_bounds_s(
            self.own, np.array([self.target.interval_present()]), self.end_s
        )

    @property
    def closing_speed_bound_mps(self) -> float:
        """Upper bound on how fast any distance of the two aircraft changes, m/s."""
        fastest = float(self.own.max_speed_mps + self.target.max_speed_mps)
        return fastest * _SPEED_MARGIN + _TURN_MARGIN_MPS

    def separation_at(self, time_s: FloatArray) -> Separation:
        """Return the distances at some times."""
        return Separation(self.name, time_s, *range_horizontal_vertical_m(*self.states(time_s)))

    def states(self, time_s: FloatArray) -> tuple[Any, Any]:
        """Return the states of ownship and target at some times."""
        return self.own.at(time_s), self.target.at(time_s)

    def separations_by_piece(self) -> Iterator[Separation]:
        """Yield distances over pieces of about `MOST_AT_ONCE` times; short runs computed once."""
        if not self.has_few_sample_times:
            yield from self._separations_by_piece()
            return
        if self._known is None:
            self._known = list(self._separations_by_piece())
        yield from self._known

    def _separations_by_piece(self) -> Iterator[Separation]:
        samples = self._samples()
        after_s = 0.0
        for start in range(0, self._count, MOST_AT_ONCE):
            number = np.arange(start, min(start + MOST_AT_ONCE, self._count))
            time_s = regular_times_s(self.step_s, number)
            last_s = float(time_s[-1])
            for times in samples:
                for number_sampled in self._targets_with_samples:
                    new_s = _sample_times_between(times, number_sampled, after_s, last_s)
                    time_s = np.union1d(time_s, new_s)
            yield self.separation_at(time_s)
            after_s = float(np.nextafter(last_s, np.inf))

    @property
    def _targets_with_samples(self) -> list[int]:
        """Return the indices of the pair's targets, whose own sample times also count."""
        return [place for place in self.places if place >= 0]

    def _samples(self) -> list[SampleTimes]:
        every: list[SampleTimes] = self._source.sample_times()
        return every


def _sample_times_between(
    times: SampleTimes, target: int, first_s: float, last_s: float
) -> FloatArray:
    """Return the sample times of one target in [first_s, last_s], s."""
    one = np.array([target])
    first, last = times.first_and_last_sample_numbers(one, np.array([first_s]), np.array([last_s]))
    number = np.arange(first[0], last[0] + 1)
    return times.time_of(np.full(len(number), target), number)


def range_horizontal_vertical_m(own: Any, other: Any) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return slant range, horizontal distance and difference of altitudes between two states, m.

    Infinite where either is absent.
    """
    _, elevation_rad, range_m = line_of_sight(
        own.lat_deg, own.lon_deg, own.alt_m, other.lat_deg, other.lon_deg, other.alt_m,
        validate=False,
    )  # fmt: skip
    there = np.asarray(own.present & other.present)
    return (
        np.where(there, range_m, np.inf),
        np.where(there, range_m * np.cos(elevation_rad), np.inf),
        np.where(there, np.abs(np.asarray(other.alt_m) - np.asarray(own.alt_m)), np.inf),
    )


def lat_lon_alt_of(state: Any) -> list[FloatArray]:
    """Return latitude and longitude (deg) and altitude (m) of a state."""
    parts = state.lat_deg, state.lon_deg, state.alt_m
    return [np.ascontiguousarray(part, dtype=np.float64) for part in parts]


def own_enu_relative_to_target(
    flight: RelativeFlight, time_s: FloatArray
) -> tuple[FloatArray, ...]:
    """Return ownship less target: east, north, up (m) and their three rates (m/s).

    East and north in the ownship's level plane and difference of altitudes, m, and their rates,
    m/s: ownship less target.
    """
    first_s, last_s = (float(times[0]) for times in flight.presence_start_and_end_s())
    before = np.maximum(time_s - _BASE_S, max(first_s, 0.0))
    after = np.minimum(time_s + _BASE_S, last_s)
    return own_enu_with_mean_velocity(flight, time_s, before, after)


def own_enu_with_mean_velocity(
    flight: RelativeFlight, time_s: FloatArray, before: FloatArray, after: FloatArray
) -> tuple[FloatArray, ...]:
    """Return ownship less target: east, north, up (m), rates averaged over before to after."""
    here, _ = flight.states(time_s)
    origin = lat_lon_alt_of(here)

    def separation_vectors(at_s: FloatArray) -> FloatArray:
        mine, theirs = map(lat_lon_alt_of, flight.states(at_s))
        own, other = (north_east_up_offsets_m(*origin, *position) for position in (mine, theirs))
        return np.stack([own[1] - other[1], own[0] - other[0], mine[2] - theirs[2]])

    now = separation_vectors(time_s)
    lasts_s = np.where(after > before, after - before, 1.0)
    rate = (separation_vectors(after) - separation_vectors(before)) / lasts_s
    return (*now, *rate)
