"""Many flights at once: arrays of instants by aircraft, or each aircraft at a time of its own."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import copy
from typing import Any

import numpy as np
import numpy.typing as npt

from components.flights.geodesic_motion import geodesic_state
from components.flights.leg_motion import FORMULAS, hold_state
from components.flights.sample_times import PieceSearch
from components.flights.sampled_flight import (
    CELLS_AT_ONCE,
    SampledTrajectory,
    TrajectoryState,
    evaluate_segments,
    locate,
)
from components.flights.scripted_flights import ScriptedTrajectory, StraightFlights
from dsa_des.arrays.types import BoolArray, FloatArray, IntArray


class LegTable:
    """All legs of many flights, found by flight and time."""

    def __init__(self, trajectories: Sequence[ScriptedTrajectory]) -> None:
        segments = [segment for t in trajectories for segment in t.segments]
        self._find = PieceSearch([np.array([s.start_s for s in t.segments]) for t in trajectories])
        self._start = np.array([t.start_time_s for t in trajectories])
        self._end = np.array([t.end_time_s for t in trajectories])
        self._until = np.array([t.evaluated_until_s for t in trajectories])
        self._pitch = np.array([segment.pitch_rad for segment in segments])
        self._roll = np.array([segment.roll_rad for segment in segments])
        # NaN where the attitude follows from the motion.
        fixed = [[np.nan if a is None else a for a in t.fixed_attitude_rad] for t in trajectories]
        self._fixed = np.array(fixed).reshape(-1, 3).T.copy()
        self._kind = np.array([list(FORMULAS).index(s.kind) for s in segments], dtype=np.int64)
        self._slot = np.empty(len(segments), dtype=np.int64)
        self._tables: dict[int, FloatArray] = {}
        for kind in np.bincount(self._kind).nonzero()[0].tolist():  # np.unique imports np.ma
            members = np.flatnonzero(self._kind == kind)
            self._slot[members] = np.arange(len(members))
            self._tables[kind] = np.stack([segments[i].parameters for i in members], axis=-1)

    @classmethod
    def of_straight(cls, flights: StraightFlights) -> LegTable:
        """Return the table of flights that have one leg each, and straight ones."""
        count = len(flights)
        table = cls.__new__(cls)
        table._find = PieceSearch.of_one_each(count)
        table._start, table._end, table._until = flights.start_s, flights.end_s, flights.until_s
        table._pitch, table._roll = flights.pitch_rad, np.zeros(count)
        table._fixed = flights.fixed_rad
        straight = list(FORMULAS).index("geodesic")
        table._kind = np.full(count, straight, dtype=np.int64)
        table._slot = np.arange(count)
        table._tables = {straight: flights.table} if count else {}
        return table

    @classmethod
    def joined(cls, one: LegTable, other: LegTable) -> LegTable:
        """Return the table of the flights of both, those of `other` after those of `one`."""
        table = cls.__new__(cls)
        table._find = PieceSearch.joined(one._find, other._find)
        for name in ("_start", "_end", "_until", "_pitch", "_roll", "_fixed", "_kind"):
            both = [getattr(one, name), getattr(other, name)]
            setattr(table, name, np.concatenate(both, axis=-1))
        before = np.zeros(len(FORMULAS), dtype=np.int64)
        for kind, members in one._tables.items():
            before[kind] = members.shape[1]
        table._slot = np.concatenate([one._slot, other._slot + before[other._kind]])
        table._tables = dict(one._tables)
        for kind, members in other._tables.items():
            known = [one._tables[kind]] if kind in one._tables else []
            table._tables[kind] = np.concatenate([*known, members], axis=-1)
        return table

    def state(self, aircraft: IntArray, time_s: FloatArray) -> TrajectoryState:
        """Return states of flights (n,), each at a time (n,) of its own, in s."""
        start, until = self._start[aircraft], self._until[aircraft]
        elapsed = np.where(time_s > start, time_s, start)
        elapsed = np.where(elapsed < until, elapsed, until) - start
        leg = self._find(aircraft, elapsed)
        elapsed -= self._find.starts_s[leg]
        lat, lon, alt, yaw = (np.empty(len(aircraft)) for _ in range(4))
        for kind, formula in enumerate(FORMULAS.values()):
            if kind not in self._tables:
                continue
            chosen: slice | IntArray = slice(None)
            if len(self._tables) > 1:
                chosen = np.flatnonzero(self._kind[leg] == kind)
            table = self._tables[kind].take(self._slot[leg[chosen]], axis=1)
            values = formula(table, np.ascontiguousarray(elapsed[chosen]))
            for out, value in zip((lat, lon, alt, yaw), values, strict=True):
                out[chosen] = value
        derived = (yaw, self._pitch[leg], self._roll[leg])
        attitude = [
            np.where(np.isnan(given[aircraft]), angle, given[aircraft])
            for given, angle in zip(self._fixed, derived, strict=True)
        ]
        present = (time_s >= self._start[aircraft]) & (time_s <= self._end[aircraft])
        return TrajectoryState(lat, lon, alt, attitude[0], attitude[1], attitude[2], present)


class ScriptedFleet:
    """Scripted aircraft evaluated together, bit for bit as each would be alone.

    All aircraft with a single straight leg are one array expression, all that stand still
    another; those with several legs are looked up leg by leg.
    """

    def __init__(self, trajectories: Sequence[ScriptedTrajectory]) -> None:
        straight = isinstance(trajectories, StraightFlights)
        self._whole = trajectories if straight else list(trajectories)
        self._columns = np.arange(len(self._whole))
        self._others = np.empty(0, dtype=np.int64)
        self._legs: LegTable | None = None
        self._place_in_legs = np.arange(len(self._whole))
        if isinstance(trajectories, StraightFlights):
            self._groups = [_Group.of_straight(trajectories)] if len(trajectories) else []
            self._legs = LegTable.of_straight(trajectories)
            return
        kinds = [t.segments[0].kind if len(t.segments) == 1 else "" for t in self.trajectories]
        self._groups = [
            _Group.of([i for i, k in enumerate(kinds) if k == kind], self.trajectories, formula)
            for kind, formula in (("geodesic", geodesic_state), ("hold", hold_state))
            if kind in kinds
        ]
        self._others = np.array(
            [i for i, k in enumerate(kinds) if k not in ("geodesic", "hold")], dtype=np.int64
        )

    @property
    def trajectories(self) -> list[ScriptedTrajectory]:
        """The aircraft, in order."""
        return [self._whole[i] for i in self._columns.tolist()]

    @property
    def names(self) -> list[str]:
        """Their names."""
        return [trajectory.name for trajectory in self.trajectories]

    def subset(self, columns: IntArray) -> ScriptedFleet:
        """Return the fleet of some aircraft, without preparing them anew."""
        fleet = copy(self)
        fleet._columns = self._columns[columns]
        parts = [group.subset(columns) for group in self._groups]
        fleet._groups = [part for part in parts if part is not None]
        fleet._others = np.flatnonzero(np.isin(columns, self._others))
        # The table of legs is found by our own places, so that there is one for all subsets.
        fleet._place_in_legs = self._place_in_legs[columns]
        return fleet

    def at(self, time_s: npt.ArrayLike) -> TrajectoryState:
        """Give every aircraft's state at some times."""
        times = _times(time_s)
        state = _empty_state(len(times), len(self._columns))
        for group in self._groups:
            group.fill(state, times)
        if len(self._others):
            shape = len(times), len(self._others)
            aircraft = np.broadcast_to(self._others, shape).reshape(-1)
            several = self.each(aircraft, np.repeat(times, len(self._others))).reshaped(shape)
            for out, columns in zip(state.arrays(), several.arrays(), strict=True):
                out[:, self._others] = columns
        return state

    def each(self, aircraft: IntArray, time_s: FloatArray) -> TrajectoryState:
        """Give single aircraft's states (n,), each at a time (n,) of its own, in s."""
        if self._legs is None:
            self._legs = LegTable(self.trajectories)
            self._place_in_legs = np.arange(len(self._columns))
        return _in_blocks(self._legs.state, self._place_in_legs[aircraft], time_s)


class _Group:
    """Aircraft of one segment each that share a formula."""

    def __init__(
        self,
        members: IntArray,
        whole: bool,
        formula: Callable[[FloatArray, FloatArray], tuple[FloatArray, ...]],
        table: FloatArray,
        times_s: tuple[FloatArray, FloatArray, FloatArray],
        attitude: FloatArray,
        yaw_is_fixed: BoolArray,
    ) -> None:
        self._formula = formula
        self._members = members
        self._columns: slice | IntArray = slice(None) if whole else members
        self._table = table[:, np.newaxis]
        self._start, self._end, self._until = times_s
        self._attitude, self._yaw_is_fixed = attitude, yaw_is_fixed

    @classmethod
    def of(
        cls,
        members: list[int],
        trajectories: list[ScriptedTrajectory],
        formula: Callable[[FloatArray, FloatArray], tuple[FloatArray, ...]],
    ) -> _Group:
        """Return the group of some of many flights."""
        chosen = [trajectories[i] for i in members]
        derived = [(np.nan, t.segments[0].pitch_rad, t.segments[0].roll_rad) for t in chosen]
        attitude = [
            [d if f is None else f for f, d in zip(t.fixed_attitude_rad, angles, strict=True)]
            for t, angles in zip(chosen, derived, strict=True)
        ]
        return cls(
            np.array(members),
            len(members) == len(trajectories),
            formula,
            np.stack([t.segments[0].parameters for t in chosen], axis=-1),
            (
                np.array([t.start_time_s for t in chosen]),
                np.array([t.end_time_s for t in chosen]),
                np.array([t.evaluated_until_s for t in chosen]),
            ),
            np.array(attitude).T,
            np.array([t.fixed_attitude_rad[0] is not None for t in chosen]),
        )

    @classmethod
    def of_straight(cls, flights: StraightFlights) -> _Group:
        """Return the group of flights that are all straight."""
        derived = np.stack(
            (np.full(len(flights), np.nan), flights.pitch_rad, np.zeros(len(flights)))
        )
        fixed = flights.fixed_rad
        return cls(
            np.arange(len(flights)),
            True,
            geodesic_state,
            flights.table,
            (flights.start_s, flights.end_s, flights.until_s),
            np.where(np.isnan(fixed), derived, fixed),
            ~np.isnan(fixed[0]),
        )

    def subset(self, columns: IntArray) -> _Group | None:
        """Return the group of those of its members that are among some aircraft."""
        place = np.searchsorted(columns, self._members)
        place[place == len(columns)] = 0
        kept = np.flatnonzero(columns[place] == self._members) if len(columns) else place[:0]
        if len(kept) == 0:
            return None
        group = copy(self)
        group._members = place[kept]
        group._columns = slice(None) if len(kept) == len(columns) else group._members
        group._table = np.ascontiguousarray(self._table[..., kept])
        group._start, group._end = self._start[kept], self._end[kept]
        group._until, group._yaw_is_fixed = self._until[kept], self._yaw_is_fixed[kept]
        group._attitude = np.ascontiguousarray(self._attitude[:, kept])
        return group

    def fill(self, state: TrajectoryState, times: FloatArray) -> None:
        """Write the group's columns of the state."""
        rows = max(1, CELLS_AT_ONCE // len(self._start))
        fixed_yaw, pitch, roll = self._attitude
        for first in range(0, len(times), rows):
            block = slice(first, first + rows)
            t = times[block, np.newaxis]
            inside = np.maximum(t, self._start)
            np.minimum(inside, self._until, out=inside)
            inside -= self._start
            lat, lon, alt, yaw = self._formula(self._table, inside)
            if self._yaw_is_fixed.any():
                yaw = np.where(self._yaw_is_fixed, fixed_yaw, yaw)
            present = (t >= self._start) & (t <= self._end)
            values = (lat, lon, alt, yaw, pitch, roll, present)
            for out, value in zip(state.arrays(), values, strict=True):
                out[block, self._columns] = value


class SampledFleet:
    """Sampled aircraft evaluated together, bit for bit as each would be alone.

    Aircraft with the same sample times are looked up once for all of them.
    """

    def __init__(self, trajectories: Sequence[SampledTrajectory]) -> None:
        self.trajectories = list(trajectories)
        self.names = [trajectory.name for trajectory in self.trajectories]
        self._bases: list[tuple[FloatArray, list[int]]] = []
        by_bytes: dict[bytes, list[int]] = {}
        for i, trajectory in enumerate(self.trajectories):
            base = trajectory.sample_times_s
            columns = by_bytes.setdefault(base.tobytes(), [])
            if not columns:
                self._bases.append((base, columns))
            columns.append(i)
        lengths = [len(trajectory.sample_times_s) for trajectory in self.trajectories]
        self._first_segment = np.concatenate([[0], np.cumsum(lengths)[:-1]]).astype(np.intp)
        self._table = np.ascontiguousarray(
            np.concatenate([t.coefficients for t in self.trajectories], axis=1)
            if self.trajectories
            else np.zeros((25, 0))
        )
        self._find: PieceSearch | None = None

    def subset(self, columns: IntArray) -> SampledFleet:
        """Return the fleet of some aircraft, given by their indices, ascending."""
        return SampledFleet([self.trajectories[i] for i in columns.tolist()])

    def at(self, time_s: npt.ArrayLike) -> TrajectoryState:
        """Give every aircraft's state at some times."""
        times = _times(time_s)
        count = len(self.trajectories)
        state = _empty_state(len(times), count)
        rows = max(1, CELLS_AT_ONCE // max(1, count))
        for first in range(0, len(times), rows) if count else ():
            block = slice(first, first + rows)
            t = times[block]
            shape = (len(t), count)
            index, elapsed = np.empty(shape, dtype=np.intp), np.empty(shape)
            present = np.empty(shape, dtype=bool)
            for base, columns in self._bases:
                segment, since, there = locate(base, t)
                index[:, columns] = segment[:, np.newaxis] + self._first_segment[columns]
                elapsed[:, columns] = since[:, np.newaxis]
                present[:, columns] = there[:, np.newaxis]
            values = evaluate_segments(
                self._table[:, index.reshape(-1)], elapsed.reshape(-1), present.reshape(-1)
            ).reshaped(shape)
            for out, value in zip(state.arrays(), values.arrays(), strict=True):
                out[block] = value
        return state

    def each(self, aircraft: IntArray, time_s: FloatArray) -> TrajectoryState:
        """Give single aircraft's states (n,), each at a time (n,) of its own, in s."""
        if self._find is None:
            self._find = PieceSearch([t.sample_times_s for t in self.trajectories])
        return _in_blocks(self._state, aircraft, time_s)

    def _state(self, aircraft: IntArray, time_s: FloatArray) -> TrajectoryState:
        assert self._find is not None
        samples, first, last = self._find.starts_s, self._find.first, self._find.last
        start, end = samples[first[aircraft]], samples[last[aircraft]]
        inside = np.where(time_s > start, time_s, start)
        inside = np.where(inside < end, inside, end)
        segment = self._find(aircraft, inside)
        present = (time_s >= start) & (time_s <= end)
        return evaluate_segments(
            self._table.take(segment, axis=1), inside - samples[segment], present
        )


def fleet_of(flights: Sequence[Any]) -> ScriptedFleet | SampledFleet | None:
    """Return flights as a fleet, or None where they are not all scripted or all sampled."""
    kinds = {type(flight) for flight in flights}
    if kinds <= {ScriptedTrajectory}:
        return ScriptedFleet(flights)
    return SampledFleet(flights) if kinds == {SampledTrajectory} else None


def _in_blocks(
    state: Callable[[IntArray, FloatArray], TrajectoryState],
    aircraft: IntArray,
    time_s: FloatArray,
) -> TrajectoryState:
    """Evaluate pairs of aircraft and time, a cache's worth at a time."""
    blocks = [
        state(aircraft[first : first + CELLS_AT_ONCE], time_s[first : first + CELLS_AT_ONCE])
        for first in range(0, len(aircraft), CELLS_AT_ONCE)
    ]
    if len(blocks) == 1:
        return blocks[0]
    if not blocks:
        return _empty_state(1, 0).reshaped((0,))
    columns = zip(*(block.arrays() for block in blocks), strict=True)
    return TrajectoryState(*(np.concatenate(parts) for parts in columns))


def _times(time_s: npt.ArrayLike) -> FloatArray:
    times = np.asarray(time_s, dtype=np.float64, order="C")
    if times.ndim != 1:
        raise ValueError(f"time_s has shape {times.shape}: it must have one axis")
    return times


def _empty_state(rows: int, columns: int) -> TrajectoryState:
    shape = (rows, columns)
    lat, lon, alt, yaw, pitch, roll = (np.empty(shape) for _ in range(6))
    return TrajectoryState(lat, lon, alt, yaw, pitch, roll, np.empty(shape, dtype=bool))
