"""The four kinds of guidance: their values, limits, and manoeuvres, alike for whoever asks."""

from typing import Any, Protocol

import numpy as np

from components.guidance.altitudes import AltitudeConflicts, Altitudes
from components.guidance.intervals import FULL_TURN
from components.guidance.situation import Detector, State
from components.guidance.step_bands import StepConflicts
from components.guidance.steps import Steps, climb_steps, direction_steps, limits_of, speed_steps
from dsa_des.arrays.types import AnyArray, BoolArray, FloatArray

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
    """Manoeuvres of one kind, of n ownships, by the k values that they lead to.

    Attributes
    ----------
    values : (n, k)
        Ascending; directions may lie outside of [0, 2 pi).
    there : (n, k) of bool
        Whether an ownship has that value.
    own_value : (n,)
    least, most : (n,)
    cyclic : bool
        Whether values a full turn apart are the same.
    instantaneous : bool
        Whether a manoeuvre takes no time.
    """

    values: AnyArray
    there: BoolArray
    own_value: FloatArray
    least: FloatArray
    most: FloatArray
    cyclic: bool
    instantaneous: bool

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
    """Return the manoeuvres of one kind.

    Parameters
    ----------
    name : {"hdir", "hs", "vs", "alt"}
        Direction over ground, ground speed, vertical speed, altitude.
    own : State of (n,)
        Of the ownships, each at the origin of its plane.
    values : mapping
        Values of a configuration, by key.
    """
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
