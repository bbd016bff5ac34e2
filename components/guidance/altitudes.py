"""Level-offs at altitudes of a fixed grid, and which of them meet a volume."""

import math
from typing import Any

import numpy as np

from components.guidance.intervals import limits_of
from components.guidance.situation import Detector, State, contains_instant, overlaps_time
from components.well_clear.relative_motion import Span, nearly_equal
from dsa_des.arrays.types import BoolArray, FloatArray


class Altitudes:
    """The altitudes at which n ownships may level off, and their flights to each.

    A flight to an altitude accelerates to a climb rate until `accelerated_s`, holds it until
    `held_s`, and is level at `level_s`; it first brakes where it climbs away from the altitude or
    too fast for it. All follows from the values of a configuration.
    """

    cyclic = False

    def __init__(self, own: State, values: Any) -> None:
        self.own, self.own_value = own.columns(), own.up_m
        self.least, self.most = limits_of("alt", own.up_m, values)
        least, most, step = values["min_alt"], values["max_alt"], values["step_alt"]
        number = np.arange(math.floor((most - least) / step) + 2)
        self.values = np.broadcast_to(least + number * step, (len(own.up_m), len(number)))
        self.there = np.ones(self.values.shape, dtype=bool)
        self.instantaneous = values["vertical_accel"] == 0.0 or values["vertical_rate"] == 0.0
        self._compute_flights(values["vertical_accel"], values["vertical_rate"])
        self.lookahead_s: float = values["lookahead_time"]
        #: Whether horizons count from time 0, not from the phases of a flight.
        self.from_now: bool = values["bands_add_time_to_maneuver"]
        # Where horizons count from now, level flights are asked for that begin beyond them.
        self._choose_examined_altitudes(math.inf if self.from_now else self.lookahead_s, step)

    def find_conflicts(self, intruder: State, detector: Detector) -> "AltitudeConflicts":
        """Return the flights' conflicts with a volume around one intruder each, a (n, 1) state."""
        return AltitudeConflicts(self, intruder, detector)

    def _compute_flights(self, acceleration: float, rate: float) -> None:
        """Compute and store the times and climb rates of the flights to all altitudes."""
        climb, gap = self.own.climb_mps, self.values - self.own.up_m
        if self.instantaneous:
            self.accelerated_s = self.held_s = self.level_s = np.zeros(gap.shape)
            self._rate = self._acceleration = np.zeros(gap.shape)
            self._holds = np.zeros(gap.shape, dtype=bool)
            return
        a = acceleration
        stop = climb * np.abs(climb) / (2.0 * a)
        brakes = (climb * gap < 0.0) | (np.abs(stop) > np.abs(gap))
        start = np.where(brakes, 0.0, climb)
        left = np.where(brakes, gap - stop, gap)
        up = np.where(left >= 0.0, 1.0, -1.0)
        fast = np.maximum(rate, np.abs(start))
        speed = up * start  # towards the altitude, not negative
        hold_m = up * left - (fast**2 - speed**2) / (2.0 * a) - fast**2 / (2.0 * a)
        self._holds = hold_m >= 0.0
        peak = np.where(self._holds, fast, np.sqrt(np.maximum(a * up * left + 0.5 * speed**2, 0.0)))
        first_s = np.where(brakes, np.abs(climb) / a, 0.0)
        self.accelerated_s = first_s + (peak - speed) / a
        held = np.where(peak > 0.0, np.maximum(hold_m, 0.0) / np.where(peak > 0.0, peak, 1.0), 0.0)
        self.held_s = self.accelerated_s + held
        self.level_s = self.held_s + peak / a
        self._rate, self._acceleration = up * peak, up * a

    def _choose_examined_altitudes(self, lookahead_s: float, step: float) -> None:
        """Choose which altitudes to examine: those whose flights differ within the lookahead.

        Those whose climb is still held then are flown alike to either side, so one of them to each
        side stands for all.
        """
        count = self.values.shape[1]
        near = ~(self._holds & (self.held_s > lookahead_s))
        near |= np.abs(self.values - self.own.up_m) <= step
        some = near.any(axis=1)
        first = np.where(some, near.argmax(axis=1), 0)
        last = np.where(some, count - 1 - near[:, ::-1].argmax(axis=1), 0)
        first = np.maximum(first - 1, 0)
        width = int((np.minimum(last + 1, count - 1) - first).max(initial=0)) + 1
        first = np.minimum(first, count - width)[:, np.newaxis]
        #: Which altitudes are looked at, and who of them stands for each altitude.
        self._looked_at = first + np.arange(width)
        self._stands_for = np.clip(np.arange(count) - first, 0, width - 1)
        chosen = self.select_examined
        self._level_m = chosen(self.values)
        #: Times at which the flights that are looked at have accelerated, held and are level.
        self.phases_s = [chosen(t) for t in (self.accelerated_s, self.held_s, self.level_s)]
        self._speed, self._push = chosen(self._rate), chosen(self._acceleration)

    def select_examined(self, of_each: FloatArray) -> FloatArray:
        """Return from values (n, k) of all altitudes those of the altitudes that are examined."""
        return np.take_along_axis(of_each, self._looked_at, axis=1)

    def spread_to_all(self, chosen: BoolArray) -> BoolArray:
        """Return for all altitudes (n, k) the result of the examined one that stands for each."""
        return np.take_along_axis(chosen, self._stands_for, axis=1)

    def straight_flight_from(self, time_s: FloatArray) -> State:
        """Return straight flights by position and velocity at a time, as states run back to 0 s."""
        own = self.own
        values = self._level_m
        if self.instantaneous:
            level = np.zeros(np.broadcast(time_s, values).shape)
            up, rate = values + level, level
        else:
            (t1, t2, t3), speed, acceleration = self.phases_s, self._speed, self._push
            phase_s = np.minimum(time_s, t1)
            rate = own.climb_mps + acceleration * phase_s
            up = own.up_m + own.climb_mps * phase_s + 0.5 * acceleration * phase_s**2
            held_s = np.clip(time_s - t1, 0.0, t2 - t1)
            brake_s = np.clip(time_s - t2, 0.0, t3 - t2)
            up = up + speed * held_s
            up = up + speed * brake_s - 0.5 * acceleration * brake_s**2
            rate = rate - acceleration * brake_s
            level = np.asarray(time_s >= t3)
            up, rate = np.where(level, values, up), np.where(level, 0.0, rate)
        return State(own.east_m, own.north_m, up - rate * time_s, own.east_mps, own.north_mps, rate)


class AltitudeConflicts:
    """Times when flights to all altitudes are in a volume around each ownship's one intruder."""

    def __init__(self, altitudes: Altitudes, intruder: State, detector: Detector) -> None:
        self._altitudes, self._intruder, self._detector = altitudes, intruder, detector
        self._lookahead_s, self._from_now = altitudes.lookahead_s, altitudes.from_now
        #: Whole seconds on the way, and which flights are inside then.
        self._seconds: list[tuple[FloatArray, BoolArray]] = []
        t1, t2, t3 = altitudes.phases_s
        self._level_s = np.zeros(t1.shape) if altitudes.instantaneous else t3 + 1.0
        # Who is level beyond a horizon from now keeps clear of a cylinder all the time before it.
        self._level = self._straight_flight_span(
            self._level_s, self._from_now and detector.volume is None
        )
        if altitudes.instantaneous:
            return
        self._held_s, self._held_until_s = np.maximum(t1, 0.0), np.minimum(t2, self._lookahead_s)
        self._held = self._straight_flight_span(self._held_s, False)
        self._store_inside_at_seconds(np.zeros(t1.shape), t1)
        self._store_inside_at_seconds(np.ceil(t2), t3 + 1.0)

    def _straight_flight_span(self, begin_s: FloatArray, whole: bool) -> Span:
        """Return when straight flights from ``begin_s`` (``whole``: from 0 s) are in the volume."""
        if whole:
            flight, begin_s = self._altitudes.straight_flight_from(begin_s), np.zeros(begin_s.shape)
        else:
            begin_s = np.minimum(begin_s, self._lookahead_s)
            flight = self._altitudes.straight_flight_from(begin_s)
        # Beyond the lookahead, at whose end the volume may be asked for.
        return self._detector.span(flight, self._intruder, begin_s, self._lookahead_s + 1.0)

    def _store_inside_at_seconds(self, first_s: FloatArray, last_s: FloatArray) -> None:
        """Store for each whole second of an interval which flights are inside the volume then."""
        last_s = np.floor(np.minimum(last_s, self._lookahead_s))
        # All flights of an acceleration share their first seconds, so these are few.
        for number in range(int(np.max(last_s - first_s, initial=-1.0)) + 1):
            time_s = first_s + number
            due = (time_s <= last_s) & (time_s < self._lookahead_s)
            if due.any():
                flight = self._altitudes.straight_flight_from(time_s)
                span = self._detector.span(flight, self._intruder, time_s, time_s + 1.0)
                self._seconds.append((time_s, due & nearly_equal(span.begin_s, time_s)))

    def is_in_or_behind_conflict(self, from_s: Any, horizon_s: Any) -> BoolArray:
        """Return a mask (n, k), True for altitudes whose flights conflict within the horizon."""
        end_s = np.minimum(self._horizon_end_s(horizon_s, self._level_s), self._lookahead_s)
        begin_s = np.maximum(from_s, self._level_s)
        met = overlaps_time(self._level, begin_s, end_s) | contains_instant(
            self._level, from_s, begin_s, end_s
        )
        if not self._altitudes.instantaneous:
            end_s = np.minimum(self._horizon_end_s(horizon_s, self._held_s), self._held_until_s)
            begin_s = np.maximum(from_s, self._held_s)
            met |= overlaps_time(self._held, begin_s, end_s) | contains_instant(
                self._held, from_s, begin_s, end_s
            )
        last_s = horizon_s if self._from_now else np.inf
        for time_s, inside in self._seconds:
            met |= inside & (time_s >= from_s) & (time_s <= last_s)
        return self._altitudes.spread_to_all(met & np.asarray(from_s <= horizon_s))

    def _horizon_end_s(self, horizon_s: Any, phase_s: FloatArray) -> FloatArray:
        return np.asarray(horizon_s if self._from_now else horizon_s + phase_s)

    has_conflict_within_horizon = is_in_or_behind_conflict

    def has_conflict_before(self, until_s: FloatArray, horizon_s: FloatArray) -> BoolArray:
        """Return a mask (n, k), True for altitudes whose flights conflict before a time (n, 1)."""
        horizon_s = np.minimum(horizon_s, self._lookahead_s)
        until_s = np.minimum(until_s, horizon_s)
        late = (self._level_s > horizon_s) & self._from_now
        begin_s = np.where(late, 0.0, self._level_s)
        met = overlaps_time(self._level, begin_s, np.where(late, horizon_s, until_s))
        if not self._altitudes.instantaneous:
            met |= overlaps_time(self._held, self._held_s, np.minimum(self._held_until_s, until_s))
        for time_s, inside in self._seconds:
            met |= inside & (time_s <= until_s)
        return self._altitudes.spread_to_all(met)
