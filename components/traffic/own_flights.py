"""The flights of many ownships, each of which may be steered while it is flown."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from components.geometry.state import TrajectoryState
from components.messages.steering import Manoeuvre
from components.traffic.flight_protocols import EachFlight
from components.traffic.leg_table import LegTable
from components.traffic.steered_flight import (
    AROUND_S,
    SteeredFlight,
    SteeredPart,
    flown_from,
)
from dsa_des.arrays.types import FloatArray, IntArray


class OwnFlights:
    """What every ownship flies: its own flight, and after manoeuvres what each of them led to.

    As many `components.traffic.steered_flight.SteeredFlight`, to the bit.

    Parameters
    ----------
    flights : EachFlight
        What each of them flies until its first manoeuvre.
    count : int
    """

    def __init__(self, flights: EachFlight, count: int) -> None:
        self._flights = flights
        #: Of each ownship: when its parts begin, in order, and which they are.
        self._start_s = np.full((count, 1), np.inf)
        self._part = np.zeros((count, 1), dtype=np.int64)
        #: How many parts each of them has.
        self.count = np.zeros(count, dtype=np.int64)
        self._parts: LegTable | None = None
        self._flown: list[SteeredPart] = []

    @classmethod
    def of(cls, steered: Sequence[SteeredFlight], flights: EachFlight) -> OwnFlights:
        """Return flights that were steered before.

        Parameters
        ----------
        steered : sequence of SteeredFlight
        flights : EachFlight
            What each of them flew until its first manoeuvre.
        """
        made = cls(flights, len(steered))
        parts = [flight.parts for flight in steered]
        made.count[:] = [len(of_one) for of_one in parts]
        made._flown = [flight for of_one in parts for _, flight in of_one]
        if made._flown:
            made._parts = LegTable(made._flown)
        room = len(steered), int(made.count.max(initial=0)) + 1
        made._start_s, made._part = np.full(room, np.inf), np.zeros(room, dtype=np.int64)
        there = np.arange(room[1]) < made.count[:, np.newaxis]
        made._start_s[there] = [start_s for of_one in parts for start_s, _ in of_one]
        made._part[there] = np.arange(len(made._flown))
        return made

    def parts_of(self, ownship: int) -> tuple[tuple[float, SteeredPart], ...]:
        """Return what an ownship flies after each of its manoeuvres, and from when on, s."""
        columns = range(int(self.count[ownship]))
        return tuple(
            (float(self._start_s[ownship, k]), self._flown[self._part[ownship, k]]) for k in columns
        )

    def each(
        self, ownship: IntArray, time_s: FloatArray, known: IntArray | None = None
    ) -> TrajectoryState:
        """Return the states of ownships (n,), each at a time (n,) of its own, in s.

        Parameters
        ----------
        ownship : (n,) of int
        time_s : (n,)
        known : (n,) of int, optional
            How many of the ownship's manoeuvres are known; all by default.
        """
        if self._parts is None:
            return self._flights.each(ownship, time_s)
        part = (self._start_s[ownship] <= time_s[:, np.newaxis]).sum(axis=1)
        if known is not None:
            part = np.minimum(part, known)
        steered = part > 0
        if not steered.any():
            return self._flights.each(ownship, time_s)
        which = self._part[ownship[steered], part[steered] - 1]
        told = self._parts.state(which, time_s[steered])
        if steered.all():
            return told
        own = self._flights.each(ownship[~steered], time_s[~steered])
        columns = []
        for alone, after in zip(own.arrays(), told.arrays(), strict=True):
            column = np.empty(len(ownship), dtype=alone.dtype)
            column[~steered], column[steered] = alone, after
            columns.append(column)
        return TrajectoryState(*columns)

    def fastest_by(self, ownship: IntArray, time_s: FloatArray) -> FloatArray:
        """Return the largest speed of any manoeuvre begun by ownships (n,) by times (n,), or 0."""
        if not self._flown:
            return np.zeros(len(ownship))
        speeds = np.array([part.max_speed_mps for part in self._flown])[self._part[ownship]]
        begun = self._start_s[ownship] <= time_s[:, np.newaxis]
        return np.asarray(np.where(begun, speeds, 0.0).max(axis=1))

    def steer(self, ownship: IntArray, time_s: FloatArray, told: Sequence[Manoeuvre]) -> None:
        """Let ownships fly manoeuvres from times on.

        Parameters
        ----------
        ownship : (n,) of int
            Each once.
        time_s : (n,)
            Not before earlier manoeuvres of the same one.
        told : sequence of n Manoeuvre
        """
        around = self.each(
            np.repeat(ownship, len(AROUND_S)), (time_s[:, np.newaxis] + AROUND_S).reshape(-1)
        ).reshaped((len(ownship), len(AROUND_S)))
        before = [
            self._flown[self._part[own, self.count[own] - 1]] if self.count[own] else None
            for own in ownship.tolist()
        ]
        new = flown_from("ownship", around, time_s, told, before)
        table = LegTable(new)
        self._parts = table if self._parts is None else LegTable.joined(self._parts, table)
        if int(self.count[ownship].max()) + 1 >= self._start_s.shape[1]:
            room = self._start_s.shape
            self._start_s = np.concatenate([self._start_s, np.full(room, np.inf)], axis=1)
            self._part = np.concatenate([self._part, np.zeros(room, dtype=np.int64)], axis=1)
        place = self.count[ownship]
        self._start_s[ownship, place] = time_s
        self._part[ownship, place] = len(self._flown) + np.arange(len(new))
        self.count[ownship] += 1
        self._flown += new
