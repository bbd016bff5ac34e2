"""True distances of the aircraft of an encounter: slant, horizontal and vertical.

Nothing here depends on what sensors see; it is read off the traffic block of a scene.
"""

import math
from collections.abc import Iterator
from copy import copy
from dataclasses import dataclass
from fractions import Fraction
from math import isnan
from typing import Any

import numpy as np

from components.flights.closest_approach import end_of_look, present_together_s
from components.flights.sample_times import (
    SampleTimes,
    SharedTimes,
    regular_count,
    regular_times_s,
)
from components.geometry.ellipsoid import line_of_sight
from components.traffic.source import TrafficSource
from components.well_clear.cylinder import inside_cylinder
from dsa_des.arrays.types import FloatArray
from dsa_des.block.component import Context
from dsa_des.scene.block import Block
from dsa_des.scene.scene import Scene
from dsa_des.time.randomness import Streams

#: Times looked at together: it bounds the memory, however long the run.
MOST_AT_ONCE = 65_536
# Times of a flight that are kept for metrics that ask for them again.
_KEPT = 4096


@dataclass(frozen=True, eq=False)
class Separation:
    """Distances of one target from the ownship over time.

    Parameters
    ----------
    name : str
    time_s : (times,)
    range_m : (times,)
        Slant range; infinite where either is absent.
    horizontal_m : (times,)
        In the ownship's local level plane.
    vertical_m : (times,)
        Difference of the altitudes above the ellipsoid, not negative.
    """

    name: str
    time_s: FloatArray
    range_m: FloatArray
    horizontal_m: FloatArray
    vertical_m: FloatArray


def traffic_block(scene: Scene) -> Block:
    """Return the block that moves the aircraft.

    Raises
    ------
    ValueError
        If the scene has none, or one that cannot say where aircraft are.
    """
    found = [b for b in scene.blocks.values() if issubclass(b.cls, TrafficSource)]
    if len(found) != 1:
        raise ValueError(
            f"needs one block of traffic that knows its flights; this scene has {len(found)}"
        )
    return found[0]


#: Spacing of the grid where none is given, s.
STEP_S = 0.1
# The speeds of turns and long legs hold to 2e-4, and the ownship's level plane turns with it.
_SPEED_MARGIN, _TURN_MARGIN_MPS = 1.001, 0.1


def separations(
    scene: Scene, step_s: float | None, until_s: float = math.inf
) -> "list[RelativeFlight]":
    """Return the distances of every target of a scene, on a regular grid and at the samples.

    Parameters
    ----------
    scene : Scene
    step_s : float or None
        Spacing of the grid; the times at which the source itself has samples are added. None looks
        between them for losses, with a grid of `STEP_S` for all else.
    until_s : float
        When the run ended, where that was before its time.
    """
    block = traffic_block(scene)
    context = Context(Streams(scene.seed), scene.ticks_per_s, sections=scene.sections)
    source: Any = block.cls(block.name, block.parameters, context)
    duration = scene.duration_s or source.natural_duration_s() or Fraction(0)
    context.duration_s = duration
    end_s = min(float(duration), until_s)
    count = regular_count(step_s or STEP_S, end_s)
    return [
        RelativeFlight(source, number, step_s, count, end_s)
        for number in range(len(source.targets))
    ]


class RelativeFlight:
    """The distances of one target from the ownship, in pieces of time one after the other.

    Parameters
    ----------
    source : TrafficSource
    number : int
        Which of its targets.
    step_s : float or None
        Spacing of the grid; None also looks between its times.
    count : int
        Number of its times.
    end_s : float
        Of the run.
    """

    def __init__(
        self, source: Any, number: int, step_s: float | None, count: int, end_s: float
    ) -> None:
        self._source, self._number = source, number
        #: Flights of ownship and target.
        self.own, self.target = source.own, source.targets[number]
        self.name: str = self.target.name
        self.between_samples = step_s is None
        self.step_s, self._count = step_s or STEP_S, count
        self.end_s = end_s
        self._known: list[Separation] | None = None

    def flown_by(self, own: Any) -> "RelativeFlight":
        """Return the same with another flight of the ownship."""
        found = copy(self)
        found.own, found._known = own, None
        return found

    @property
    def is_short(self) -> bool:
        """Whether all of its times can be laid out."""
        return self._count <= _KEPT

    @property
    def grid_end_s(self) -> float:
        """The last time of the grid, s."""
        return float(regular_times_s(self.step_s, np.array([self._count - 1]))[0])

    def sample_times_s(self) -> FloatArray:
        """Return 0 and the times within the grid at which the source itself has samples, s."""
        found = [np.zeros(1)]
        for times in self._samples():
            found.append(_between(times, self._number, 0.0, self.grid_end_s))
        return np.unique(np.concatenate(found))

    def present_s(self) -> tuple[FloatArray, FloatArray]:
        """Return the first and the last time (1,) at which both aircraft may be there, s."""
        return present_together_s(self.own, [self.target], self.end_s)

    @property
    def closing_mps(self) -> float:
        """No distance of the two changes faster, m/s."""
        fastest = float(self.own.max_speed_mps + self.target.max_speed_mps)
        return fastest * _SPEED_MARGIN + _TURN_MARGIN_MPS

    def at(self, time_s: FloatArray) -> Separation:
        """Return the distances at some times."""
        return _separation(self.own, self.target, time_s)

    def states(self, time_s: FloatArray) -> tuple[Any, Any]:
        """Return the states of ownship and target at some times."""
        return self.own.at(time_s), self.target.at(time_s)

    def pieces(self) -> Iterator[Separation]:
        """Give the distances, about `MOST_AT_ONCE` at a time; those of a short run are kept."""
        if self._count > _KEPT:
            yield from self._pieces()
            return
        if self._known is None:
            self._known = list(self._pieces())
        yield from self._known

    def _pieces(self) -> Iterator[Separation]:
        samples = self._samples()
        after_s = 0.0
        for start in range(0, self._count, MOST_AT_ONCE):
            number = np.arange(start, min(start + MOST_AT_ONCE, self._count))
            time_s = regular_times_s(self.step_s, number)
            last_s = float(time_s[-1])
            for times in samples:
                time_s = np.union1d(time_s, _between(times, self._number, after_s, last_s))
            yield _separation(self.own, self.target, time_s)
            after_s = float(np.nextafter(last_s, np.inf))

    def _samples(self) -> list[SampleTimes]:
        every: list[SampleTimes] = self._source.sample_times()
        if every:
            return every
        times = SharedTimes(self._source.sample_times_s(self.target))
        return [times]


def _between(times: SampleTimes, target: int, first_s: float, last_s: float) -> FloatArray:
    """Return the times of a target in [first_s, last_s]."""
    one = np.array([target])
    first, last = times.between(one, np.array([first_s]), np.array([last_s]))
    number = np.arange(first[0], last[0] + 1)
    return times.at(np.full(len(number), target), number)


def _separation(ownship: Any, target: Any, time_s: FloatArray) -> Separation:
    return Separation(target.name, time_s, *distances_m(ownship.at(time_s), target.at(time_s)))


def distances_m(own: Any, other: Any) -> tuple[FloatArray, FloatArray, FloatArray]:
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


def closest(flight: RelativeFlight) -> tuple[float, float, str]:
    """Return the smallest range (m), its time (s), the first of several, and where it is cut off.

    See `components.flights.closest_approach.end_of_look`.
    """
    best = (float("inf"), float("nan"))
    looked_s = np.full(2, np.nan)
    for piece in flight.pieces():
        place = int(np.argmin(piece.range_m))
        if piece.range_m[place] < best[0]:
            best = float(piece.range_m[place]), float(piece.time_s[place])
        there_s = piece.time_s[np.isfinite(piece.range_m)]
        if len(there_s):
            looked_s = np.array([np.fmin(looked_s[0], there_s[0]), there_s[-1]])
    present_s = np.array(flight.present_s())[:, 0]
    return *best, end_of_look(best[1], looked_s, present_s, flight.end_s)


def first_inside(flight: Any, *limits_m: tuple[float, float]) -> list[float]:
    """Return when a target first is within each pair of distances (exclusive), s; NaN if never.

    Asked at the flight's times only; `components.metrics.flights_together` looks between them.

    Parameters
    ----------
    flight : RelativeFlight
    *limits_m : (horizontal, vertical)
    """
    found = [float("nan")] * len(limits_m)
    for piece in flight.pieces():
        for number, (horizontal_m, vertical_m) in enumerate(limits_m):
            inside = inside_cylinder(piece.horizontal_m, piece.vertical_m, horizontal_m, vertical_m)
            if isnan(found[number]) and inside.any():
                found[number] = float(piece.time_s[np.argmax(inside)])
        if not any(map(isnan, found)):
            break
    return found
