"""The four kinds of guidance: their values, limits, and manoeuvres, alike for whoever asks."""

import math
from typing import Any, Protocol

import numpy as np

from components.guidance.altitudes import Altitudes
from components.guidance.situation import Detector, Required, State
from components.guidance.step_bands import clear_steps, meets_within
from components.guidance.steps import Steps, climb_steps, direction_steps, speed_steps
from dsa_des.arrays.types import AnyArray, BoolArray

KINDS = ("hdir", "hs", "vs", "alt")
FULL_TURN = 2.0 * math.pi


class Kind(Protocol):
    """Manoeuvres of one kind by the values that they lead to.

    Attributes
    ----------
    values : (n,)
        Ascending; directions may lie outside of [0, 2 pi).
    own_value, least, most : float
    cyclic : bool
        Whether values a full turn apart are the same.
    instantaneous : bool
        Whether a manoeuvre takes no time.
    """

    values: AnyArray
    own_value: float
    least: float
    most: float
    cyclic: bool
    instantaneous: bool

    def clear(self, intruder: State, required: Required) -> BoolArray:
        """Tell which values lead clear of one intruder."""

    def meets_within(
        self, intruder: State, detector: Detector, horizon_s: float, lookahead_s: float
    ) -> bool:
        """Tell whether any value leads into a volume soon after its manoeuvre."""


class _StepKind:
    def __init__(
        self, steps: Steps, own_value: float, step: float, limits: tuple[float, float]
    ) -> None:
        self._steps = steps
        self.own_value = own_value
        self.values: AnyArray = own_value + steps.number * step
        self.least, self.most = limits
        self.cyclic = False
        self.instantaneous = steps.step_time_s == 0.0

    def clear(self, intruder: State, required: Required) -> BoolArray:
        return clear_steps(self._steps, intruder, required)

    def meets_within(
        self, intruder: State, detector: Detector, horizon_s: float, lookahead_s: float
    ) -> bool:
        return meets_within(self._steps, intruder, detector, horizon_s, lookahead_s)


class _AltitudeKind:
    def __init__(self, own: State, values: Any) -> None:
        self._altitudes = Altitudes(own, values)
        self.own_value = float(own.up_m)
        self.values: AnyArray = self._altitudes.values
        self.least, self.most = values["min_alt"], values["max_alt"]
        self.cyclic = False
        self.instantaneous = self._altitudes.instantaneous
        self.clear = self._altitudes.clear
        self.meets_within = self._altitudes.meets_within


def kind_of(name: str, own: State, values: Any) -> Kind:
    """Return the manoeuvres of one kind.

    Parameters
    ----------
    name : {"hdir", "hs", "vs", "alt"}
        Direction over ground, ground speed, vertical speed, altitude.
    own : State
        Of the ownship, at the origin of its plane.
    values : mapping
        Values of a configuration, by key.
    """
    if name == "alt":
        return _AltitudeKind(own, values)
    if name == "hdir":
        track = float(np.arctan2(own.east_mps, own.north_mps)) % FULL_TURN
        made = _StepKind(direction_steps(own, values), track, values["step_hdir"], (0.0, FULL_TURN))
        made.cyclic = True
        return made
    if name == "hs":
        speed = float(np.hypot(own.east_mps, own.north_mps))
        limits = values["min_hs"], values["max_hs"]
        return _StepKind(speed_steps(own, values), speed, values["step_hs"], limits)
    climb, limits = float(own.climb_mps), (values["min_vs"], values["max_vs"])
    return _StepKind(climb_steps(own, values), climb, values["step_vs"], limits)
