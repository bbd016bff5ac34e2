"""Level-offs at altitudes of a fixed grid, and which of them keep clear of intruders."""

import math
from typing import Any

import numpy as np

from components.guidance.situation import Detector, Required, State
from components.well_clear.nearly import nearly_equal
from dsa_des.arrays.types import BoolArray, FloatArray


class Altitudes:
    """The altitudes at which the ownship may level off, and its flight to each.

    A flight to an altitude accelerates to a climb rate until `accelerated_s`, holds it until
    `held_s`, and is level at `level_s`; it first brakes where it climbs away from the altitude or
    too fast for it.

    Parameters
    ----------
    own : State
    values : mapping
        Values of a configuration, by key.
    """

    def __init__(self, own: State, values: Any) -> None:
        self.own = own
        least, most, step = values["min_alt"], values["max_alt"], values["step_alt"]
        number = np.arange(math.floor((most - least) / step) + 2)
        self.values = least + number * step
        self.instantaneous = values["vertical_accel"] == 0.0 or values["vertical_rate"] == 0.0
        self._plan(values["vertical_accel"], values["vertical_rate"])

    def _plan(self, acceleration: float, rate: float) -> None:
        """Find the times and rates of the flights to all altitudes."""
        climb, gap = float(self.own.climb_mps), self.values - float(self.own.up_m)
        if self.instantaneous:
            self.accelerated_s = self.held_s = self.level_s = np.zeros(len(gap))
            self._rate = self._acceleration = np.zeros(len(gap))
            return
        a = acceleration
        stop = climb * abs(climb) / (2.0 * a)
        brakes = (climb * gap < 0.0) | (np.abs(stop) > np.abs(gap))
        start = np.where(brakes, 0.0, climb)
        left = np.where(brakes, gap - stop, gap)
        up = np.where(left >= 0.0, 1.0, -1.0)
        fast = np.maximum(rate, np.abs(start))
        speed = up * start  # towards the altitude, not negative
        hold_m = up * left - (fast**2 - speed**2) / (2.0 * a) - fast**2 / (2.0 * a)
        peak = np.where(
            hold_m >= 0.0, fast, np.sqrt(np.maximum(a * up * left + 0.5 * speed**2, 0.0))
        )
        first_s = np.where(brakes, abs(climb) / a, 0.0)
        self.accelerated_s = first_s + (peak - speed) / a
        held = np.where(peak > 0.0, np.maximum(hold_m, 0.0) / np.where(peak > 0.0, peak, 1.0), 0.0)
        self.held_s = self.accelerated_s + held
        self.level_s = self.held_s + peak / a
        self._rate, self._acceleration = up * peak, up * a

    def _flight_at(self, time_s: FloatArray) -> State:
        """Return the straight flight at a time of each altitude's manoeuvre, run back to 0."""
        climb, at = self.own.climb_mps, self.own.up_m
        if self.instantaneous:
            level = np.zeros(np.broadcast(time_s, self.values).shape)
            up, rate = self.values + level, level
        else:
            t1, t2, t3 = self.accelerated_s, self.held_s, self.level_s
            phase_s = np.minimum(time_s, t1)
            rate = climb + self._acceleration * phase_s
            up = at + climb * phase_s + 0.5 * self._acceleration * phase_s**2
            held_s = np.clip(time_s - t1, 0.0, t2 - t1)
            brake_s = np.clip(time_s - t2, 0.0, t3 - t2)
            up = up + self._rate * held_s
            up = up + self._rate * brake_s - 0.5 * self._acceleration * brake_s**2
            rate = rate - self._acceleration * brake_s
            level = np.asarray(time_s >= t3)
            up, rate = np.where(level, self.values, up), np.where(level, 0.0, rate)
        same = np.zeros(np.shape(up))
        return State(
            self.own.east_m + same,
            self.own.north_m + same,
            up - rate * time_s,
            self.own.east_mps + same,
            self.own.north_mps + same,
            rate,
        )

    def clear(self, intruder: State, required: Required) -> BoolArray:
        """Tell at which altitudes the ownship may level off, clear of one intruder."""
        r = required
        if self.instantaneous:
            return ~self._met_level(intruder, r, np.zeros(len(self.values)))
        met = self._met_at_seconds(intruder, r, np.zeros(len(self.values)), self.accelerated_s)
        met |= self._met_held(intruder, r)
        met |= self._met_at_seconds(intruder, r, np.ceil(self.held_s), self.level_s + 1.0)
        met |= self._met_level(intruder, r, self.level_s + 1.0)
        return ~met

    def meets_within(
        self, intruder: State, detector: Detector, horizon_s: float, lookahead_s: float
    ) -> bool:
        """Tell whether any flight to an altitude meets a volume soon after it."""
        return not bool(self.clear(intruder, Required(detector, horizon_s, lookahead_s)).all())

    def _met(
        self, intruder: State, r: Required, time_s: FloatArray, end_s: FloatArray
    ) -> BoolArray:
        """Tell whether the flights at a time meet what is required until another."""
        relative = self._flight_at(time_s).less(intruder)
        found = np.zeros(np.shape(time_s), dtype=bool)
        if r.from_s <= r.horizon_s:
            found |= r.detector.meets(relative, np.maximum(r.from_s, time_s), end_s)
        if r.before is not None:
            until_s = np.minimum(end_s, min(r.lookahead_s, r.from_s))
            found |= r.before.meets(relative, time_s, until_s)
        return found

    def _met_held(self, intruder: State, r: Required) -> BoolArray:
        end_s = np.minimum(np.minimum(r.horizon_s + self.accelerated_s, self.held_s), r.lookahead_s)
        return self._met(intruder, r, np.maximum(self.accelerated_s, 0.0), end_s)

    def _met_level(self, intruder: State, r: Required, time_s: FloatArray) -> BoolArray:
        end_s = np.minimum(r.horizon_s + time_s, r.lookahead_s)
        return self._met(intruder, r, time_s, np.maximum(end_s, time_s))

    def _met_at_seconds(
        self, intruder: State, r: Required, first_s: FloatArray, last_s: FloatArray
    ) -> BoolArray:
        """Tell which flights are inside at a whole second of an interval."""
        last_s = np.minimum(np.floor(last_s), r.lookahead_s)
        met = np.zeros(len(self.values), dtype=bool)
        # All flights of an acceleration share their first seconds, so these are few.
        most = int(np.max(last_s - first_s, initial=-1.0))
        for number in range(most + 1):
            time_s = first_s + number
            due = (time_s <= last_s) & ~met
            if due.any():
                met |= due & self._inside(intruder, r, time_s)
        return met

    def _inside(self, intruder: State, r: Required, time_s: FloatArray) -> BoolArray:
        relative = self._flight_at(time_s).less(intruder)
        found = np.zeros(len(time_s), dtype=bool)
        if r.from_s <= r.horizon_s:
            begin = r.detector.span(relative, time_s, time_s + 1.0).begin_s
            found |= (time_s >= r.from_s) & nearly_equal(begin, time_s)
        if r.before is not None:
            begin = r.before.span(relative, time_s, time_s + 1.0).begin_s
            found |= (time_s <= r.from_s) & nearly_equal(begin, time_s)
        return found
