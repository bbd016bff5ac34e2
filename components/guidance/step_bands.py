"""Which steps of a manoeuvre keep clear of intruders."""

import math

import numpy as np

from components.guidance.situation import Detector, Required, State
from components.guidance.steps import Steps
from components.well_clear.violation import Relative
from dsa_des.arrays.types import BoolArray


def meets_within(
    steps: Steps, intruder: State, detector: Detector, horizon_s: float, lookahead_s: float
) -> bool:
    """Tell whether any step meets a volume soon after its manoeuvre.

    Parameters
    ----------
    steps : Steps
    intruder : State
        Of one.
    detector : Detector
    horizon_s, lookahead_s : float
    """
    relative = steps.flight.less(intruder)
    end_s = np.minimum(lookahead_s, horizon_s + steps.time_s)
    return bool(detector.meets(relative, steps.time_s, end_s).any())


def clear_steps(steps: Steps, intruder: State, required: Required) -> BoolArray:
    """Tell which steps keep clear of one intruder.

    Parameters
    ----------
    steps : Steps
    intruder : State
        Of one.
    required : Required

    Returns
    -------
    (n,) of bool
        A step is clear if neither the manoeuvre nor the flight after it meets the volume.
    """
    relative = steps.flight.less(intruder)
    clear = ~_met_after(steps, relative, required)
    if steps.step_time_s > 0.0:
        clear &= ~_lost_on_the_way(steps, relative, required)
    return clear


def _met_after(steps: Steps, relative: Relative, required: Required) -> BoolArray:
    end_s = np.minimum(required.lookahead_s, required.horizon_s + steps.time_s)
    if required.from_s <= required.horizon_s:
        begin_s = np.maximum(required.from_s, steps.time_s)
        met = required.detector.meets(relative, begin_s, end_s)
    else:
        met = np.zeros(len(steps.number), dtype=bool)
    if required.before is not None:
        until_s = np.full(len(steps.number), min(required.lookahead_s, required.from_s))
        met = met | required.before.meets(relative, steps.time_s, until_s)
    return np.asarray(met)


def _lost_on_the_way(steps: Steps, relative: Relative, required: Required) -> BoolArray:
    """Tell which steps lie at or beyond the first that meets the volume while it is flown."""
    count = np.abs(steps.number)
    lasts = steps.time_s + steps.step_time_s
    met = np.zeros(len(count), dtype=bool)
    step_s = steps.step_time_s
    due = (count >= math.ceil(required.from_s / step_s)) & (
        count <= math.floor(required.lookahead_s / step_s)
    )
    due &= (steps.time_s < required.lookahead_s) & (required.from_s <= required.horizon_s)
    met |= due & required.detector.meets(relative, steps.time_s, lasts)
    if required.before is not None:
        early = count <= math.floor(min(required.from_s, required.lookahead_s) / step_s)
        met |= early & required.before.meets(relative, steps.time_s, lasts)
    lost = np.zeros(len(count), dtype=bool)
    for side in (steps.number >= 0, steps.number <= 0):
        lost |= side & (count >= np.min(count[met & side], initial=np.iinfo(np.int64).max))
    return lost
