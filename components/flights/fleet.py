"""Many flights asked at once: arrays of instants by aircraft, or each aircraft at its own time."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from components.geometry import TrajectoryState
from dsa_des.arrays.column_values import constant_column
from dsa_des.arrays.growing_arrays import Growing
from dsa_des.arrays.types import BoolArray, FloatArray, IntArray

CELLS_AT_ONCE = 8192
"""Cells worked on together: the two dozen arrays in flight then stay in the processor's cache."""


class Trajectory(Protocol):
    """The flight of one aircraft."""

    name: str

    @property
    def max_speed_mps(self) -> float:
        """Largest speed along its path."""

    def interval_present(self) -> tuple[float, float]:
        """Return the first and the last time (s) at which the aircraft is present."""

    def at(self, time_s: Any) -> TrajectoryState:
        """Return the aircraft's state at the given times (s)."""


class Fleet(Sequence[Any]):
    """Many flights, evaluated together, to the bit as each alone; an item is a single flight."""

    @cached_property
    def max_speeds_mps(self) -> FloatArray:
        """Largest speed (m/s) of each flight along its path, shape (flights,)."""
        return np.array([flight.max_speed_mps for flight in self], dtype=np.float64)

    @cached_property
    def intervals_present_s(self) -> FloatArray:
        """First and last time (s) at which each flight is present, shape (flights, 2)."""
        intervals = [flight.interval_present() for flight in self]
        return np.array(intervals, dtype=np.float64).reshape(-1, 2)

    @abstractmethod
    def each(self, aircraft: IntArray, time_s: FloatArray) -> TrajectoryState:
        """Return the states (n,) of the given flights, each at its own time (s)."""

    def ground_speeds_mps(self, aircraft: IntArray, time_s: FloatArray) -> FloatArray:
        """Return flights' ground speeds (m/s), each at its own time; NaN if no script sets it."""
        return np.full(len(time_s), np.nan)

    def fixed_attitudes_rad(self, aircraft: IntArray, time_s: FloatArray) -> FloatArray:
        """Return flights' fixed yaw, pitch, roll (3, n), each at its time; NaN where not fixed."""
        return np.full((3, len(time_s)), np.nan)

    def at(self, time_s: npt.ArrayLike) -> TrajectoryState:
        """Return the states of all flights at the given times, shape (times, flights)."""
        times, count = checked_one_axis_times(time_s), len(self)
        aircraft = np.tile(np.arange(count), len(times))
        return self.each(aircraft, np.repeat(times, count)).reshape((len(times), count))

    def subset(self, columns: IntArray) -> Fleet:
        """Return a fleet of the flights with the given indices, which ascend."""
        return type(self)([self[i] for i in columns.tolist()])  # type: ignore[call-arg]


def evaluate_in_blocks(
    state: Callable[[IntArray, FloatArray], TrajectoryState],
    aircraft: IntArray,
    time_s: FloatArray,
) -> TrajectoryState:
    """Evaluate states of aircraft and time pairs in blocks that fit the cache, and join them."""
    blocks = [
        state(aircraft[first : first + CELLS_AT_ONCE], time_s[first : first + CELLS_AT_ONCE])
        for first in range(0, len(aircraft), CELLS_AT_ONCE)
    ]
    if len(blocks) == 1:
        return blocks[0]
    if not blocks:
        return uninitialized_state(1, 0).reshape((0,))
    columns = zip(*(block.arrays() for block in blocks), strict=True)
    return TrajectoryState(*(np.concatenate(parts) for parts in columns))


def checked_one_axis_times(time_s: npt.ArrayLike) -> FloatArray:
    """Return times as a float array; ValueError if it does not have exactly one axis."""
    times = np.asarray(time_s, dtype=np.float64, order="C")
    if times.ndim != 1:
        raise ValueError(f"time_s has shape {times.shape}: it must have one axis")
    return times


def uninitialized_state(rows: int, columns: int) -> TrajectoryState:
    """Return a state of uninitialized arrays of shape (rows, columns), to be filled."""
    shape = (rows, columns)
    lat, lon, alt, yaw, pitch, roll = (np.empty(shape) for _ in range(6))
    return TrajectoryState(lat, lon, alt, yaw, pitch, roll, np.empty(shape, dtype=bool))


def assemble_rows(rows: Sequence[IntArray], states: Sequence[TrajectoryState]) -> TrajectoryState:
    """Return the states of all parts as one, each part's states at the rows given for it."""
    if not states:
        return uninitialized_state(1, 0).reshape((0,))
    order = np.argsort(np.concatenate(rows), kind="stable")
    columns = zip(*(state.arrays() for state in states), strict=True)
    return TrajectoryState(*(np.concatenate(parts)[order] for parts in columns))


#: Halving so many times takes no longer than expecting where a piece is.
_FEW_STEPS = 3


class PieceSearch(Growing):
    """Finds a path's piece at a time, for many paths with pieces stored one after the other."""

    def __init__(self, starts_s: FloatArray, counts: IntArray) -> None:
        ends = np.cumsum(counts)
        self.starts_s = starts_s
        #: Index of each aircraft's first and last piece among all.
        self.first, self.last = ends - counts, ends - 1
        self._steps = int(counts.max(initial=1) - 1).bit_length()
        self._per_s = self._pieces_per_second(counts) if self._steps > _FEW_STEPS else None

    def _pieces_per_second(self, counts: IntArray) -> FloatArray | None:
        """Return each path's pieces per second, or None if any path's are not evenly spaced."""
        begin, end = self.starts_s[self.first], self.starts_s[self.last]
        if not (begin < end).all():
            return None
        per_s = (counts - 1) / (end - begin)
        place = np.arange(len(self.starts_s)) - np.repeat(self.first, counts)
        apart = (self.starts_s - np.repeat(begin, counts)) * np.repeat(per_s, counts) - place
        return per_s if bool((np.abs(apart) < 0.25).all()) else None

    @classmethod
    def from_starts(cls, starts_s: Sequence[FloatArray]) -> PieceSearch:
        """Return a search among several paths' pieces, given each path's start times (s)."""
        counts = np.array([len(starts) for starts in starts_s], dtype=np.int64)
        return cls(np.concatenate([*starts_s, np.empty(0)]), counts)

    def with_paths(self, more: PieceSearch) -> PieceSearch:
        """Return a search in which the paths of another one follow after these."""
        before = len(self.starts_s)
        both = self.with_appended(
            starts_s=more.starts_s, first=more.first + before, last=more.last + before
        )
        both._steps, both._per_s = max(self._steps, more._steps), None
        return both

    def __call__(self, aircraft: IntArray, time_s: FloatArray) -> IntArray:
        """Return the last piece that starts at or before a time, or the first one."""
        low, high = self.first.take(aircraft), self.last.take(aircraft)
        if self._per_s is not None:  # at most one piece from where it is expected
            ahead = (time_s - self.starts_s.take(low)) * self._per_s.take(aircraft)
            ahead = np.fmin(np.fmax(ahead, 0.0), high - low)
            guess = low + ahead.astype(np.int64)
            guess = np.where(self.starts_s.take(guess) > time_s, np.maximum(guess - 1, low), guess)
            after = np.minimum(guess + 1, high)
            return np.where(self.starts_s.take(after) <= time_s, after, guess)
        for _ in range(self._steps):
            middle = (low + high + 1) // 2
            begun = self.starts_s.take(middle) <= time_s
            low = np.where(begun, middle, low)
            high = np.where(begun, high, np.maximum(middle - 1, low))
        return low


class LoneFlight(Fleet):
    """A fleet of one flight, for types of flight that have no fleet class of their own."""

    def __init__(self, flight: Any) -> None:
        self._flight = flight

    def __len__(self) -> int:
        return 1

    def __getitem__(self, index: int) -> Any:  # type: ignore[override]
        return (self._flight,)[index]

    def each(self, aircraft: IntArray, time_s: FloatArray) -> TrajectoryState:
        """Return the states (n,) of the only flight at the given times (s)."""
        state: TrajectoryState = self._flight.at(time_s)
        return state


class MixedFleet(Fleet):
    """Flights of several types, kept in one fleet for each type, which ``makers`` build."""

    def __init__(
        self, flights: Sequence[Any], makers: Mapping[type, Callable[[Sequence[Any]], Fleet]]
    ) -> None:
        self._flights = list(flights)
        self._fleets: list[Fleet] = []
        #: Of each flight its fleet, and its index there.
        self._fleet, self._index = np.zeros((2, len(flights)), dtype=np.int64)
        kinds = [type(flight) for flight in flights]
        for kind in dict.fromkeys(kinds):
            numbers = [number for number, one in enumerate(kinds) if one is kind]
            of_kind = [flights[number] for number in numbers]
            make = makers.get(kind)
            made = [LoneFlight(f) for f in of_kind] if make is None else [make(of_kind)]
            self._fleet[numbers] = len(self._fleets) + np.arange(len(numbers)) % len(made)
            self._index[numbers] = np.arange(len(numbers)) // len(made)
            self._fleets += made

    def __len__(self) -> int:
        return len(self._flights)

    def __getitem__(self, index: int) -> Any:  # type: ignore[override]
        return self._flights[index]

    def _fleets_with_rows_and_flights(
        self, aircraft: IntArray
    ) -> list[tuple[Fleet, IntArray, IntArray]]:
        """Return for each fleet concerned: itself, the asking rows, and its flights' indices."""
        fleet = self._fleet[aircraft]
        asked = np.flatnonzero(np.bincount(fleet, minlength=1)).tolist()
        rows = [np.flatnonzero(fleet == number) for number in asked]
        return [
            (self._fleets[number], row, self._index[aircraft[row]])
            for number, row in zip(asked, rows, strict=True)
        ]

    def each(self, aircraft: IntArray, time_s: FloatArray) -> TrajectoryState:
        """Return the states (n,) of the given flights, each at its own time (s)."""
        parts = self._fleets_with_rows_and_flights(aircraft)
        states = [fleet.each(index, time_s[row]) for fleet, row, index in parts]
        return assemble_rows([row for _, row, _ in parts], states)

    def ground_speeds_mps(self, aircraft: IntArray, time_s: FloatArray) -> FloatArray:
        """Return flights' ground speeds (m/s), each at its own time; NaN if no script sets it."""
        speed_mps = super().ground_speeds_mps(aircraft, time_s)
        for fleet, row, index in self._fleets_with_rows_and_flights(aircraft):
            speed_mps[row] = fleet.ground_speeds_mps(index, time_s[row])
        return speed_mps

    def fixed_attitudes_rad(self, aircraft: IntArray, time_s: FloatArray) -> FloatArray:
        """Return flights' fixed yaw, pitch, roll (3, n), each at its time; NaN where not fixed."""
        fixed_rad = super().fixed_attitudes_rad(aircraft, time_s)
        for fleet, row, index in self._fleets_with_rows_and_flights(aircraft):
            fixed_rad[:, row] = fleet.fixed_attitudes_rad(index, time_s[row])
        return fixed_rad


@dataclass(frozen=True, eq=False)
class FormulaGroup:
    """Single-leg flights that share one formula of motion, evaluated as one array expression."""

    formula: Callable[[FloatArray, FloatArray], tuple[FloatArray, ...]]
    columns: IntArray
    table: FloatArray
    times_s: tuple[FloatArray, FloatArray, FloatArray]
    attitude: FloatArray
    yaw_is_fixed: BoolArray

    def at(self, times: FloatArray) -> TrajectoryState:
        """Return states, shape (times, flights); values that never change take one row's memory."""
        start_s, end_s, until_s = self.times_s
        shape = len(times), len(start_s)
        moving: list[FloatArray] = []
        present = np.empty(shape, dtype=bool)
        rows = max(1, CELLS_AT_ONCE // len(start_s))
        for first in range(0, len(times), rows):
            block = slice(first, first + rows)
            t = times[block, np.newaxis]
            inside = np.maximum(t, start_s)
            np.minimum(inside, until_s, out=inside)
            inside -= start_s
            now = self.formula(self.table, inside)
            # Of flights that keep their altitude one row of them is for all times.
            moving = moving or [
                np.empty(shape)
                if len(v) == len(inside)
                else constant_column(v[0], len(times), v.dtype)
                for v in now
            ]
            for out, values in zip(moving, now, strict=True):
                if out.flags.writeable:
                    out[block] = values
            np.logical_and(t >= start_s, t <= end_s, out=present[block])
        lat, lon, alt, yaw = moving or np.empty((4, *shape))
        fixed_yaw, *others = self.attitude
        pitch, roll = (constant_column(angle, len(times), angle.dtype) for angle in others)
        if np.count_nonzero(self.yaw_is_fixed):
            yaw = np.where(self.yaw_is_fixed, fixed_yaw, yaw)
        return TrajectoryState(lat, lon, alt, yaw, pitch, roll, present)
