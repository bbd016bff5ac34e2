"""Kinds of guidance: manoeuvres in equal steps of direction or speed, or to altitudes.

A manoeuvre ends in straight flight; that flight is run back to time 0, so that closed forms for
straight flights apply to it from the manoeuvre's end on.
"""

import math
from typing import Any, NamedTuple, Protocol

import numpy as np

from components.guidance.altitudes import AltitudeConflicts, Altitudes
from components.guidance.intervals import FULL_TURN
from components.guidance.situation import Detector, State, meets
from dsa_des.arrays.types import AnyArray, BoolArray, FloatArray, IntArray


class Steps(NamedTuple):
    """Manoeuvres of n ownships from the leftmost or lowest to the rightmost or highest."""

    # (k,) of int: signed number of steps from the own value, ascending; 0 is no manoeuvre
    number: IntArray
    there: BoolArray  # (n, k) of bool: whether an ownship has that manoeuvre within its limits
    time_s: FloatArray  # (n, k) or (1, k): When each manoeuvre ends
    step_time_s: FloatArray  # (n, 1) or (1, 1): Of one step; 0 for those that take no time
    flight: State  # State of (n, k) or (n, 1): The flight after it, run back to time 0


def direction_steps(own: State, values: Any) -> Steps:
    """Return turns by multiples of a step to the left and right."""
    own = own.columns()
    step = values["step_hdir"]
    # A flight slower than a step is turned as if it flew that fast.
    least = max(values["step_hs"], values["min_airspeed"])
    speed = np.maximum(np.hypot(own.east_mps, own.north_mps), least)
    rate = np.full((1, 1), float(values["turn_rate"]))
    if values["turn_rate"] == 0.0 and values["bank_angle"] > 0.0:
        rate = 9.80665 * math.tan(values["bank_angle"]) / speed
    left, right = (_turns(values[key], step) for key in ("left_hdir", "right_hdir"))
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
    flight = State(east, north, own.up_m, v_east, v_north, own.climb_mps)
    return Steps(number, np.ones(turned.shape, dtype=bool), time_s, step_time_s, flight)


def speed_steps(own: State, values: Any) -> Steps:
    """Return changes of ground speed along the track; it may pass through zero."""
    speed = np.hypot(own.east_mps, own.north_mps)
    limits = limits_of("hs", speed, values)
    changed = _changes(speed, *limits, values["step_hs"], values["horizontal_accel"])
    own = own.columns()
    track = np.arctan2(own.east_mps, own.north_mps)
    east, north = np.sin(track), np.cos(track)
    flight = State(
        own.east_m + changed.back * east,
        own.north_m + changed.back * north,
        own.up_m,
        changed.rate * east,
        changed.rate * north,
        own.climb_mps,
    )
    return Steps(changed.number, changed.there, changed.time_s, changed.step_time_s, flight)


def climb_steps(own: State, values: Any) -> Steps:
    """Return changes of vertical speed."""
    limits = limits_of("vs", own.climb_mps, values)
    changed = _changes(own.climb_mps, *limits, values["step_vs"], values["vertical_accel"])
    own = own.columns()
    flight = State(
        own.east_m, own.north_m, own.up_m + changed.back, own.east_mps, own.north_mps, changed.rate
    )
    return Steps(changed.number, changed.there, changed.time_s, changed.step_time_s, flight)


def limits_of(name: str, own_value: FloatArray, values: Any) -> tuple[FloatArray, FloatArray]:
    """Return the least and most values of a kind, also relative to the own value where set."""
    below, above = values[f"below_relative_{name}"], values[f"above_relative_{name}"]
    least = np.full(np.shape(own_value), float(values[f"min_{name}"]))
    most = np.full(np.shape(own_value), float(values[f"max_{name}"]))
    if below > 0.0:
        least = np.maximum(least, own_value - below)
    if above > 0.0:
        most = np.minimum(most, own_value + above)
    return least, most


def _turns(most_rad: float, step: float) -> int:
    count = math.ceil(most_rad / step)
    return count - 1 if count * step > math.pi else count


class _Changes(NamedTuple):
    """As `Steps`, with the rate after each manoeuvre and where its flight was at time 0."""

    number: IntArray
    there: BoolArray
    time_s: FloatArray
    step_time_s: FloatArray
    rate: FloatArray
    back: FloatArray


def _changes(
    own: FloatArray, least: FloatArray, most: FloatArray, step: float, acceleration: float
) -> _Changes:
    down = np.maximum(np.ceil((own - least) / step), 0.0).astype(np.int64)[:, np.newaxis]
    up = np.maximum(np.ceil((most - own) / step), 0.0).astype(np.int64)[:, np.newaxis]
    number = np.arange(-int(down.max(initial=0)), int(up.max(initial=0)) + 1)
    there = (number >= -down) & (number <= up)
    now = own[:, np.newaxis]
    rate = now + number * step
    if acceleration == 0.0:
        nothing = np.zeros((1, len(number)))
        return _Changes(number, there, nothing, np.zeros((1, 1)), rate, np.zeros(rate.shape))
    step_time_s = np.full((1, 1), step / acceleration)
    time_s = np.abs(number) * step_time_s
    reached = now * time_s + 0.5 * np.sign(number) * acceleration * time_s**2
    return _Changes(number, there, time_s, step_time_s, rate, reached - rate * time_s)


_MOST = np.iinfo(np.int64).max


class StepConflicts:
    """When the flights after all steps meet a volume about one intruder of each ownship.

    The times are found once, over all that may be asked; every question only cuts them.

    Parameters
    ----------
    steps : Steps
        Of n ownships.
    intruder : State of (n, 1)
    detector : Detector
    lookahead_s : float
    from_now : bool
        Whether horizons count from time 0, not from the end of a manoeuvre.
    """

    def __init__(
        self,
        steps: Steps,
        intruder: State,
        detector: Detector,
        lookahead_s: float,
        from_now: bool = False,
    ) -> None:
        self._after_s = np.zeros((1, 1)) if from_now else steps.time_s
        self._from_now = from_now
        self._steps = steps
        self._lookahead_s = lookahead_s
        self._count = np.abs(steps.number)
        # In recovery, one that ends beyond its horizon keeps clear of the cylinder all the time.
        self._late = (steps.time_s > lookahead_s) & from_now
        # Others that end later are not asked for.
        begin_s = np.where(self._late, 0.0, np.minimum(steps.time_s, lookahead_s))
        end_s = lookahead_s + steps.step_time_s
        self._span = detector.span(steps.flight, intruder, begin_s, end_s)
        self._takes_time = bool(steps.step_time_s.any())
        lasts_s = steps.time_s + steps.step_time_s
        self._while_flown = (
            meets(self._span, steps.time_s, lasts_s) & steps.there
            if self._takes_time
            else np.zeros(steps.there.shape, dtype=bool)
        )

    def soon(self, from_s: Any, horizon_s: Any) -> BoolArray:
        """Tell which steps meet it after the manoeuvre."""
        time_s = self._steps.time_s
        begin_s = np.maximum(from_s, time_s)
        met = meets(self._span, begin_s, np.minimum(self._lookahead_s, horizon_s + self._after_s))
        return np.asarray(met & self._steps.there & np.asarray(from_s <= horizon_s))

    def unsafe(self, from_s: Any, horizon_s: Any) -> BoolArray:
        """Tell which steps meet it, or lie beyond one that meets it while it is flown."""
        met = self.soon(from_s, horizon_s)
        if self._takes_time:
            met |= self.lost(from_s, horizon_s)
        return met

    def lost(self, from_s: Any, horizon_s: Any) -> BoolArray:
        """Tell which steps lie at or beyond the first that meets it while it is flown."""
        if not self._takes_time:
            return self._while_flown
        first = np.ceil(from_s / self._steps.step_time_s)
        # Where horizons count from now, what is flown after them is not looked at either.
        last_s = np.minimum(self._lookahead_s, horizon_s) if self._from_now else self._lookahead_s
        last = np.floor(last_s / self._steps.step_time_s)
        due = (self._count >= first) & (self._count <= last)
        due = due & (self._steps.time_s < self._lookahead_s) & np.asarray(from_s <= horizon_s)
        return self._beyond(self._while_flown & due)

    def unsafe_before(self, until_s: FloatArray) -> BoolArray:
        """Tell which steps meet it until a time (n, 1), or while they are flown until then."""
        begin_s = np.where(self._late, 0.0, self._steps.time_s)
        end_s = np.where(self._late, self._lookahead_s, np.minimum(self._lookahead_s, until_s))
        met = meets(self._span, begin_s, end_s)
        met &= self._steps.there
        if self._takes_time:
            until_s = np.minimum(until_s, self._lookahead_s)
            early = self._count <= np.floor(until_s / self._steps.step_time_s)
            met |= self._beyond(self._while_flown & early)
        return met

    def _beyond(self, met: BoolArray) -> BoolArray:
        if not met.any():
            return met
        number = self._steps.number
        lost = np.zeros(met.shape, dtype=bool)
        for side in (number >= 0, number <= 0):
            first = np.where(met & side, self._count, _MOST).min(axis=1, initial=_MOST)
            lost |= side & (self._count >= first[:, np.newaxis])
        return lost


KINDS = ("hdir", "hs", "vs", "alt")


class Conflicts(Protocol):
    """When all manoeuvres of a kind meet a volume; see `StepConflicts`."""

    def soon(self, from_s: Any, horizon_s: Any) -> BoolArray:
        """Tell which meet it after the manoeuvre."""

    def lost(self, from_s: Any, horizon_s: Any) -> BoolArray:
        """Tell which lie beyond one that meets it while it is flown."""

    def unsafe(self, from_s: Any, horizon_s: Any) -> BoolArray:
        """Tell which do either."""

    def unsafe_before(self, until_s: FloatArray) -> BoolArray:
        """Tell which do either until a time."""


class ManoeuvreKind(Protocol):
    """Manoeuvres of one kind, of n ownships, by the k values that they lead to."""

    values: AnyArray  # (n, k): ascending; directions may lie outside of [0, 2 pi)
    there: BoolArray  # (n, k) of bool: whether an ownship has that value
    own_value: FloatArray  # (n,)
    least: FloatArray
    most: FloatArray
    cyclic: bool  # Whether values a full turn apart are the same
    instantaneous: bool  # Whether a manoeuvre takes no time

    def against(self, intruder: State, detector: Detector) -> Conflicts:
        """Return when the manoeuvres meet a volume about one intruder of each, (n, 1)."""


class _StepKind:
    def __init__(
        self,
        steps: Steps,
        own_value: FloatArray,
        step: float,
        limits: tuple[FloatArray, FloatArray],
        values: Any,
    ) -> None:
        self._steps, self._values = steps, values
        self.own_value = own_value
        self.values: AnyArray = own_value[:, np.newaxis] + steps.number * step
        self.there = steps.there
        self.least, self.most = limits
        self.cyclic = False
        self.instantaneous = not steps.step_time_s.any()

    def against(self, intruder: State, detector: Detector) -> Conflicts:
        from_now = self._values["bands_add_time_to_maneuver"]
        lookahead_s = self._values["lookahead_time"]
        return StepConflicts(self._steps, intruder, detector, lookahead_s, from_now)


class _AltitudeKind:
    def __init__(self, own: State, values: Any) -> None:
        self._altitudes = Altitudes(own, values)
        self._lookahead_s = values["lookahead_time"]
        self._from_now = values["bands_add_time_to_maneuver"]
        self.own_value = own.up_m
        self.values: AnyArray = self._altitudes.values
        self.there = np.ones(self.values.shape, dtype=bool)
        self.least, self.most = limits_of("alt", own.up_m, values)
        self.cyclic = False
        self.instantaneous = self._altitudes.instantaneous

    def against(self, intruder: State, detector: Detector) -> Conflicts:
        return AltitudeConflicts(
            self._altitudes, intruder, detector, self._lookahead_s, self._from_now
        )


def kind_of(name: str, own: State, values: Any) -> ManoeuvreKind:
    """Return the manoeuvres of one kind."""
    if name == "alt":
        return _AltitudeKind(own, values)
    if name == "hdir":
        track = np.arctan2(own.east_mps, own.north_mps) % FULL_TURN
        whole = np.zeros(track.shape), np.full(track.shape, FULL_TURN)
        made = _StepKind(direction_steps(own, values), track, values["step_hdir"], whole, values)
        made.cyclic = True
        return made
    if name == "hs":
        speed = np.hypot(own.east_mps, own.north_mps)
        limits = limits_of(name, speed, values)
        return _StepKind(speed_steps(own, values), speed, values["step_hs"], limits, values)
    limits = limits_of(name, own.climb_mps, values)
    return _StepKind(climb_steps(own, values), own.climb_mps, values["step_vs"], limits, values)
