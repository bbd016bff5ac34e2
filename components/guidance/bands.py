"""Bands of guidance: values that lead to each region's volume, and those that lead out again."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np

from components.alert_configuration.configuration import REGIONS, Alerter, Configuration, Level
from components.guidance.intervals import Band, Interval, clear_intervals, painted
from components.guidance.kinds import Kind, kind_of
from components.guidance.situation import Detector, Required, State
from components.well_clear.nearly import surely_less
from dsa_des.arrays.types import BoolArray

_PAINTED = ("NEAR", "MID", "FAR")
# The search for the earliest recovery ends when it is known this well, s.
_SEARCHED_S = 0.5


class Recovery(NamedTuple):
    """How a violation that cannot be avoided is left.

    Parameters
    ----------
    time_s : float
        From when on the volume is clear; minus infinity where nothing avoids a collision.
    cylinder_m : (float, float)
        Radius and half height that stay clear until then.
    shrinks : int
        How often the cylinder was made smaller.
    """

    time_s: float
    cylinder_m: tuple[float, float]
    shrinks: int


class Guidance(NamedTuple):
    """The bands of one kind.

    Parameters
    ----------
    own_value : float
    bands : list of Band
        In SI units and radians, from the lowest to the highest value.
    recovery : Recovery or None
        Where one was needed.
    """

    own_value: float
    bands: list[Band]
    recovery: Recovery | None


@dataclass(frozen=True)
class GuidedIntruder:
    """One intruder as guidance sees it.

    Parameters
    ----------
    state : State
        In the ownship's plane.
    alerter : Alerter
    early_level : int
        The level whose early alerting time counts; 0 for none.
    """

    state: State
    alerter: Alerter
    early_level: int = 0


def guidance(
    kind_name: str, configuration: Configuration, own: State, intruders: list[GuidedIntruder]
) -> Guidance:
    """Return the bands of one kind at one instant, without memory.

    Parameters
    ----------
    kind_name : {"hdir", "hs", "vs", "alt"}
    configuration : Configuration
    own : State
    intruders : list of GuidedIntruder
    """
    kind = kind_of(kind_name, own, configuration)
    corrective = REGIONS.index(configuration["corrective_region"])
    layers: list[tuple[str, list[Interval], bool]] = []
    saturated = False
    for region in _PAINTED:
        concerned = _concerned(configuration, kind, own, intruders, region)
        if concerned is None:
            continue
        clear = np.ones(len(kind.values), dtype=bool)
        for intruder, detector, horizon_s in concerned:
            clear &= kind.clear(intruder.state, _required(configuration, detector, horizon_s))
        intervals = _intervals(kind, clear)
        layers.insert(0, (region, intervals, True))
        if not intervals:
            saturated = REGIONS.index(region) >= corrective
            break
    recovery: Recovery | None = None
    found: list[Interval] = []
    if saturated and configuration[f"recovery_{kind_name}"]:
        recovery, found = _recover(configuration, kind, own, intruders)
    if kind.instantaneous and recovery is None and _inside(configuration, own, intruders):
        sizes = configuration["min_horizontal_recovery"], configuration["min_vertical_recovery"]
        recovery = Recovery(0.0, sizes, 0)
    if found:
        layers.append(("RECOVERY", found, False))
    bands = painted(layers, kind.least, kind.most)
    if recovery is not None and recovery.time_s >= 0.0:
        bands = _named_recovery(bands)
    return Guidance(kind.own_value, bands, recovery)


def _required(configuration: Configuration, detector: Detector, horizon_s: float) -> Required:
    return Required(detector, horizon_s, configuration["lookahead_time"])


def _intervals(kind: Kind, clear: BoolArray) -> list[Interval]:
    return clear_intervals(kind.values, clear, kind.least, kind.most, kind.cyclic)


def _level_of(alerter: Alerter, region: str) -> tuple[int, Level] | None:
    for number, level in enumerate(alerter.levels, start=1):
        if level.region == region:
            return number, level
    return None


def _concerned(
    configuration: Configuration,
    kind: Kind,
    own: State,
    intruders: list[GuidedIntruder],
    region: str,
) -> list[tuple[GuidedIntruder, Detector, float]] | None:
    """Return who counts for a region, with detector and horizon; None if no level has it."""
    lookahead_s = configuration["lookahead_time"]
    found, known = [], False
    for intruder in intruders:
        numbered = _level_of(intruder.alerter, region)
        if numbered is None:
            continue
        known = True
        number, level = numbered
        detector = Detector(level.volume)
        begin_s = float(detector.span(own.less(intruder.state), 0.0, lookahead_s).begin_s)
        early = number == intruder.early_level
        due_s = level.early_alerting_time_s if early else level.alerting_time_s
        horizon_s = min(level.alerting_time_s, lookahead_s)
        if begin_s == 0.0 or bool(surely_less(begin_s, due_s)):
            found.append((intruder, detector, lookahead_s))
        elif kind.meets_within(intruder.state, detector, horizon_s, lookahead_s):
            found.append((intruder, detector, horizon_s))
    return found if known else None


def _corrective(configuration: Configuration, intruder: GuidedIntruder) -> Detector | None:
    level = configuration.corrective_level(intruder.alerter)
    return None if level is None else Detector(level.volume)


def _inside(configuration: Configuration, own: State, intruders: list[GuidedIntruder]) -> bool:
    """Tell whether the corrective volume of an intruder is violated now."""
    for intruder in intruders:
        detector = _corrective(configuration, intruder)
        lookahead_s = configuration["lookahead_time"]
        relative = own.less(intruder.state)
        if detector is not None and float(detector.span(relative, 0.0, lookahead_s).begin_s) == 0.0:
            return True
    return False


def _recover(
    configuration: Configuration, kind: Kind, own: State, intruders: list[GuidedIntruder]
) -> tuple[Recovery, list[Interval]]:
    """Return the earliest recovery, and the values that lead to it."""
    concerned = _concerned(configuration, kind, own, intruders, configuration["corrective_region"])
    lookahead_s = configuration["lookahead_time"]

    def clear(detectors: list[Required]) -> list[Interval]:
        both = np.ones(len(kind.values), dtype=bool)
        for (intruder, _, _), required in zip(concerned or [], detectors, strict=True):
            both &= kind.clear(intruder.state, required)
        return _intervals(kind, both)

    def with_cylinder(sizes: tuple[float, float]) -> list[Interval]:
        cylinder = Detector(cylinder_m=sizes)
        return clear([Required(cylinder, lookahead_s, lookahead_s)] * len(concerned or []))

    def at(sizes: tuple[float, float], time_s: float) -> list[Interval]:
        before = Detector(cylinder_m=sizes)
        return clear(
            [Required(d, lookahead_s, lookahead_s, time_s, before) for _, d, _ in concerned or []]
        )

    def leads_out(sizes: tuple[float, float], time_s: float) -> bool:
        return bool(at(sizes, time_s))

    nmac = configuration["horizontal_nmac"], configuration["vertical_nmac"]
    sizes = configuration["min_horizontal_recovery"], configuration["min_vertical_recovery"]
    shrinks = 0
    if not with_cylinder(nmac):
        return Recovery(-math.inf, nmac, shrinks), []
    while True:
        if with_cylinder(sizes):
            time_s = _earliest(partial(leads_out, sizes), configuration)
            found = at(sizes, time_s)
            if found:
                return Recovery(time_s, sizes, shrinks), found
        if not configuration["ca_bands"] or sizes == nmac:
            return Recovery(-math.inf, sizes, shrinks), []
        factor = 1.0 - configuration["ca_factor"]
        sizes = max(nmac[0], sizes[0] * factor), max(nmac[1], sizes[1] * factor)
        shrinks += 1


def _earliest(clear_at: Callable[[float], bool], configuration: Configuration) -> float:
    """Return the earliest time from which on the volume is clear, with the time of stability."""
    lookahead_s = configuration["lookahead_time"]
    red, green = 0.0, lookahead_s + 1.0
    probe = lookahead_s
    while green - red > _SEARCHED_S:
        if clear_at(probe):
            green = probe
        else:
            red = probe
        probe = 0.5 * (red + green)
    if green <= lookahead_s:
        return min(lookahead_s, green + configuration["recovery_stability_time"])
    return red


def _named_recovery(bands: list[Band]) -> list[Band]:
    """Return the bands with NONE called RECOVERY, equal neighbours joined."""
    found: list[Band] = []
    for low, high, region in bands:
        name = "RECOVERY" if region == "NONE" else region
        if found and found[-1].region == name:
            found[-1] = Band(found[-1].low, high, name)
        else:
            found.append(Band(low, high, name))
    return found
