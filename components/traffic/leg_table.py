"""The legs of many scripted flights in one table, so that they are evaluated together."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from components.geometry.angles import FloatArray
from components.traffic.leg_builder import FORMULAS
from components.traffic.legs import ScriptedTrajectory
from components.traffic.piece_search import PieceSearch
from components.traffic.straight_flights import StraightFlights
from components.traffic.trajectory import TrajectoryState

IntArray = npt.NDArray[np.int64]


class LegTable:
    """All legs of many flights, found by flight and time.

    Parameters
    ----------
    trajectories : sequence of ScriptedTrajectory
        At least one.
    """

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
