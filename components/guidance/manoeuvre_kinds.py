"""Kinds of guidance: manoeuvres in equal steps of direction or speed, or to altitudes.

A manoeuvre ends in straight flight; that flight is run back to time 0, so that closed forms for
straight flights apply to it from the manoeuvre's end on.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from components.arguments.units import STANDARD_GRAVITY_M_S2
from components.guidance.altitudes import AltitudeConflicts, Altitudes
from components.guidance.intervals import FULL_TURN, limits_of
from components.guidance.situation import Detector, State, contains_instant, overlaps_time
from dsa_des.arrays.types import AnyArray, BoolArray, FloatArray, IntArray


class Steps(NamedTuple):
    """The manoeuvres that n ownships may fly, from leftmost or lowest to rightmost or highest.

    `number` (k,) is the signed number of steps from the own value, ascending; 0 is no manoeuvre.
    """

    number: IntArray
    there: BoolArray  # (n, k): whether an ownship has that manoeuvre within its limits
    time_s: FloatArray  # (n, k) or (1, k): When each manoeuvre ends
    step_time_s: FloatArray  # (n, 1) or (1, 1): Of one step; 0 for those that take no time
    flight: State  # State of (n, k) or (n, 1): The flight after it, run back to time 0
    values: AnyArray  # (n, k): ascending; directions may lie outside of [0, 2 pi)
    own_value: FloatArray  # (n,)
    least: FloatArray
    most: FloatArray
    cyclic: bool  # Whether values a full turn apart are the same
    lookahead_s: float
    from_now: bool  # Whether horizons count from time 0, not from the end of a manoeuvre

    @property
    def instantaneous(self) -> bool:
        """Return whether a manoeuvre takes no time."""
        return not self.step_time_s.any()

    def find_conflicts(self, intruder: State, detector: Detector) -> "StepConflicts":
        """Return manoeuvres' conflicts with a volume around one intruder each, a (n, 1) state."""
        return StepConflicts(self, intruder, detector)


def _direction_steps(own: State, values: Any) -> Steps:
    """Return the turns of each ownship to the left and right by multiples of a step."""
    step = values["step_hdir"]
    own_value = np.arctan2(own.east_mps, own.north_mps) % FULL_TURN
    own = own.columns()
    # A flight slower than a step is turned as if it flew that fast.
    least = max(values["step_hs"], values["min_airspeed"])
    speed = np.maximum(np.hypot(own.east_mps, own.north_mps), least)
    rate = np.full((1, 1), float(values["turn_rate"]))
    if values["turn_rate"] == 0.0 and values["bank_angle"] > 0.0:
        rate = STANDARD_GRAVITY_M_S2 * math.tan(values["bank_angle"]) / speed
    left, right = (_turn_step_count(values[key], step) for key in ("left_hdir", "right_hdir"))
    number = np.arange(-left, right + 1)
    track = np.arctan2(own.east_mps, own.north_mps)
    turned = track + number * step
    v_east, v_north = speed * np.sin(turned), speed * np.cos(turned)
    if not rate.any():
        step_time_s = np.zeros((1, 1))
        time_s = np.zeros((1, len(number)))
        east, north = own.east_m, own.north_m
    else:
        step_time_s = step / rate
        time_s = np.abs(number) * step_time_s
        radius = np.where(number < 0, -speed / rate, speed / rate)
        east = own.east_m + radius * (np.cos(track) - np.cos(turned)) - v_east * time_s
        north = own.north_m + radius * (np.sin(turned) - np.sin(track)) - v_north * time_s
    return Steps(
        number, np.ones(turned.shape, dtype=bool), time_s, step_time_s,
        State(east, north, own.up_m, v_east, v_north, own.climb_mps),
        own_value[:, np.newaxis] + number * step, own_value,
        np.zeros(own_value.shape), np.full(own_value.shape, FULL_TURN), True,
        values["lookahead_time"], values["bands_add_time_to_maneuver"],
    )  # fmt: skip


def _turn_step_count(most_rad: float, step: float) -> int:
    count = math.ceil(most_rad / step)
    return count - 1 if count * step > math.pi else count


def _speed_steps(name: str, own: State, values: Any) -> Steps:
    """Return changes of ground speed along the track (hs), also through zero, or of climb (vs)."""
    over_ground = name == "hs"
    own_value = np.hypot(own.east_mps, own.north_mps) if over_ground else own.climb_mps
    acceleration = values["horizontal_accel" if over_ground else "vertical_accel"]
    step, (least, most) = values[f"step_{name}"], limits_of(name, own_value, values)
    down = np.maximum(np.ceil((own_value - least) / step), 0.0).astype(np.int64)[:, np.newaxis]
    up = np.maximum(np.ceil((most - own_value) / step), 0.0).astype(np.int64)[:, np.newaxis]
    number = np.arange(-int(down.max(initial=0)), int(up.max(initial=0)) + 1)
    now = own_value[:, np.newaxis]
    rate = now + number * step
    step_time_s, back_m = np.zeros((1, 1)), np.zeros(rate.shape)
    time_s = np.abs(number) * step_time_s
    if acceleration != 0.0:
        step_time_s = np.full((1, 1), step / acceleration)
        time_s = np.abs(number) * step_time_s
        reached_m = now * time_s + 0.5 * np.sign(number) * acceleration * time_s**2
        back_m = reached_m - rate * time_s  # where the flight after it was at time 0
    own = own.columns()
    if over_ground:
        track = np.arctan2(own.east_mps, own.north_mps)
        east, north = np.sin(track), np.cos(track)
        flight = State(
            own.east_m + back_m * east, own.north_m + back_m * north, own.up_m,
            rate * east, rate * north, own.climb_mps,
        )  # fmt: skip
    else:
        flight = State(
            own.east_m, own.north_m, own.up_m + back_m, own.east_mps, own.north_mps, rate
        )
    return Steps(
        number, (number >= -down) & (number <= up), time_s, step_time_s, flight, rate, own_value,
        least, most, False, values["lookahead_time"], values["bands_add_time_to_maneuver"],
    )  # fmt: skip


class StepConflicts:
    """Times when flights after all steps are in a volume around each ownship's one intruder.

    The times are computed once, over all that may be asked; every question only cuts them.
    """

    def __init__(self, steps: Steps, intruder: State, detector: Detector) -> None:
        self._after_s = np.zeros((1, 1)) if steps.from_now else steps.time_s
        self._steps, self._lookahead_s = steps, steps.lookahead_s
        self._count = np.abs(steps.number)
        # What ends beyond a horizon from now keeps clear of a cylinder all the time before it.
        whole = steps.from_now and detector.volume is None
        begin_s = np.where(whole, 0.0, np.minimum(steps.time_s, self._lookahead_s))
        # Beyond the lookahead, at whose end the volume may be asked for.
        end_s = self._lookahead_s + np.where(steps.step_time_s > 0.0, steps.step_time_s, 1.0)
        self._span = detector.span(steps.flight, intruder, begin_s, end_s)
        if not steps.instantaneous:
            lasts_s = steps.time_s + steps.step_time_s
            self._while_flown = overlaps_time(self._span, steps.time_s, lasts_s) & steps.there

    def has_conflict_within_horizon(self, from_s: Any, horizon_s: Any) -> BoolArray:
        """Return a mask (n, k), True for steps whose flight conflicts within the horizon after."""
        time_s = self._steps.time_s
        begin_s = np.maximum(from_s, time_s)
        end_s = np.minimum(self._lookahead_s, horizon_s + self._after_s)
        met = overlaps_time(self._span, begin_s, end_s) | contains_instant(
            self._span, from_s, begin_s, end_s
        )
        return np.asarray(met & self._steps.there & np.asarray(from_s <= horizon_s))

    def is_in_or_behind_conflict(self, from_s: Any, horizon_s: Any) -> BoolArray:
        """Return a mask (n, k), True for steps in conflict or reached only through a conflict."""
        met = self.has_conflict_within_horizon(from_s, horizon_s)
        if self._steps.instantaneous:
            return met
        first = np.ceil(from_s / self._steps.step_time_s)
        # Where horizons count from now, what is flown after them is not looked at either.
        from_now = self._steps.from_now
        last_s = np.minimum(self._lookahead_s, horizon_s) if from_now else self._lookahead_s
        last = np.floor(last_s / self._steps.step_time_s)
        due = (self._count >= first) & (self._count <= last)
        due = due & (self._steps.time_s < self._lookahead_s) & np.asarray(from_s <= horizon_s)
        return met | self._spread_conflicts_outwards(self._while_flown & due)

    def has_conflict_before(self, until_s: FloatArray, horizon_s: FloatArray) -> BoolArray:
        """Return a mask (n, k), True for steps that conflict before a time (n, 1)."""
        horizon_s = np.minimum(horizon_s, self._lookahead_s)
        until_s = np.minimum(until_s, horizon_s)
        late = (self._steps.time_s > horizon_s) & self._steps.from_now
        begin_s = np.where(late, 0.0, self._steps.time_s)
        met = overlaps_time(self._span, begin_s, np.where(late, horizon_s, until_s))
        met &= self._steps.there
        if not self._steps.instantaneous:
            early = self._count <= np.floor(until_s / self._steps.step_time_s)
            met |= self._spread_conflicts_outwards(self._while_flown & early)
        return met

    def _spread_conflicts_outwards(self, met: BoolArray) -> BoolArray:
        if not met.any():
            return met
        # Outwards to either side, from no manoeuvre on.
        own, lost = int(-self._steps.number[0]), np.empty(met.shape, dtype=bool)
        for met_outwards, lost_outwards in (
            (met[:, own:], lost[:, own:]), (met[:, own::-1], lost[:, own::-1])
        ):  # fmt: skip
            np.logical_or.accumulate(met_outwards, axis=1, out=lost_outwards)
        return lost


KINDS = ("hdir", "hs", "vs", "alt")


#: The manoeuvres of one kind, of n ownships, and when they meet a volume.
ManoeuvreKind = Steps | Altitudes
Conflicts = StepConflicts | AltitudeConflicts


def manoeuvres_of_kind(name: str, own: State, values: Any) -> ManoeuvreKind:
    """Return the manoeuvres of one of `KINDS` for n ownships, by a configuration's values."""
    if name == "alt":
        return Altitudes(own, values)
    return _direction_steps(own, values) if name == "hdir" else _speed_steps(name, own, values)
