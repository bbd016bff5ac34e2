"""TCAS II: the volumes of traffic and resolution advisories by sensitivity level."""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from components.arguments.units import FOOT_M, NAUTICAL_MILE_M
from components.well_clear.relative_motion import (
    Span,
    discriminant,
    exit_of_circle_s,
    horizontal_products,
    is_surely_less,
    nearly_zero,
    vertical_span,
)
from components.well_clear.volume import Relative
from dsa_des.arrays.types import FloatArray, IntArray


class Thresholds(NamedTuple):
    """Time, distance and height thresholds of a TCAS advisory at one sensitivity level."""

    tau_s: float
    distance_m: float
    height_m: float
    miss_m: float


@dataclass(frozen=True)
class TcasAdvisory:
    """An advisory of TCAS II as the volume of an alert level; its sizes follow the altitude."""

    resolution: bool  # Resolution advisory; otherwise traffic advisory


def _thresholds_in_si(
    tau_s: float, nmi: float, height_ft: float, miss_ft: float = np.inf
) -> Thresholds:
    return Thresholds(tau_s, nmi * NAUTICAL_MILE_M, height_ft * FOOT_M, miss_ft * FOOT_M)


#: Highest altitude of each level below the last, m.
LEVEL_TOPS_M = np.array([1000.0, 2350.0, 5000.0, 10_000.0, 20_000.0, 42_000.0]) * FOOT_M
FIRST_LEVEL = 2
#: By level from `FIRST_LEVEL`; TCAS II version 7.1, FAA booklet HQ-111358 (2011), table 2.
TRAFFIC_ADVISORY = (
    _thresholds_in_si(20, 0.30, 850),
    _thresholds_in_si(25, 0.33, 850),
    _thresholds_in_si(30, 0.48, 850),
    _thresholds_in_si(40, 0.75, 850),
    _thresholds_in_si(45, 1.00, 850),
    _thresholds_in_si(48, 1.30, 850),
    _thresholds_in_si(48, 1.30, 1200),
)
RESOLUTION_ADVISORY = (
    None,
    _thresholds_in_si(15, 0.20, 600, 1215),
    _thresholds_in_si(20, 0.35, 600, 2126),
    _thresholds_in_si(25, 0.55, 600, 3342),
    _thresholds_in_si(30, 0.80, 600, 4861),
    _thresholds_in_si(35, 1.10, 700, 6683),
    _thresholds_in_si(35, 1.10, 800, 6683),
)


def sensitivity_level(altitude_m: FloatArray) -> IntArray:
    """Return the sensitivity level at the ownship's altitude; a bound belongs to the level below.

    Parameters
    ----------
    altitude_m : (n,)

    Returns
    -------
    (n,) of int
        2 to 8.
    """
    return FIRST_LEVEL + np.searchsorted(LEVEL_TOPS_M, np.asarray(altitude_m), side="left")


def recovery_cylinder_sizes_m(altitude_m: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return radius and half height (m) of the cylinder to keep clear in recovery, from the TCAS
    sensitivity level at the ownship's altitude.

    They are the miss distance and the height of resolution advisories, of level 3 at least, at the
    ownship's altitude.
    """
    sizes = [one for one in RESOLUTION_ADVISORY if one is not None]
    index = np.maximum(sensitivity_level(altitude_m) - FIRST_LEVEL - 1, 0)
    return (
        np.array([one.miss_m for one in sizes])[index],
        np.array([one.height_m for one in sizes])[index],
    )


def tcas_advisory_span(
    relative: Relative,
    altitude_m: Any,
    climb_mps: Any,
    *,
    resolution: bool,
    begin_s: Any = 0.0,
    end_s: Any = np.inf,
) -> Span:
    """Return when (s) a TCAS traffic or resolution advisory is due for pairs flying straight.

    Parameters
    ----------
    relative : six of (n,)
        East, north, up in m and their rates in m/s, ownship less intruder, at time 0.
    altitude_m, climb_mps : (n,)
        Of the ownship: its climb changes the sensitivity level on the way.
    resolution : bool
        Resolution advisory; otherwise traffic advisory.
    begin_s, end_s : float or (n,)
        The times looked at.

    Returns
    -------
    Span
        Earliest entry and latest exit, s.
    """
    table = RESOLUTION_ADVISORY if resolution else TRAFFIC_ADVISORY
    altitude_m, climb_mps = np.asarray(altitude_m), np.asarray(climb_mps)
    entry = np.full(np.broadcast(altitude_m, begin_s, end_s, *relative).shape, np.inf)
    leave = -entry
    bottoms = np.concatenate([[-np.inf], LEVEL_TOPS_M])
    tops = np.concatenate([LEVEL_TOPS_M, [np.inf]])
    for sizes, bottom_m, top_m in zip(table, bottoms, tops, strict=True):
        if sizes is None:
            continue
        first_s, till_s = _interval_between_altitudes(
            altitude_m, climb_mps, bottom_m, top_m, begin_s, end_s
        )
        span = _advisory_span(relative, sizes, first_s, np.maximum(till_s, first_s))
        there = is_surely_less(first_s, till_s)
        entry = np.where(there, np.minimum(entry, span.begin_s), entry)
        leave = np.where(there, np.maximum(leave, span.end_s), leave)
    return Span(entry, leave)


def _interval_between_altitudes(
    altitude_m: FloatArray,
    climb_mps: FloatArray,
    bottom_m: float,
    top_m: float,
    begin_s: Any,
    end_s: Any,
) -> tuple[FloatArray, FloatArray]:
    """Return begin and end (s) in [begin_s, end_s] of the ownship being between two altitudes."""
    level = climb_mps == 0.0
    rate = np.where(level, 1.0, climb_mps)
    one, other = (bottom_m - altitude_m) / rate, (top_m - altitude_m) / rate
    inside = (altitude_m > bottom_m) & (altitude_m <= top_m)
    begin = np.where(level, np.where(inside, begin_s, end_s), np.minimum(one, other))
    till = np.where(level, np.where(inside, end_s, begin_s), np.maximum(one, other))
    # Not np.clip, whose bounds may be the wrong way round where nothing is looked at.
    within = [np.minimum(np.maximum(time_s, begin_s), end_s) for time_s in (begin, till)]
    return within[0], within[1]


def _advisory_span(
    relative: Relative, sizes: Thresholds, begin_s: FloatArray, end_s: FloatArray
) -> Span:
    """Return when in [begin_s, end_s] the advisory of one sensitivity level is due."""
    east, north, up, v_east, v_north, climb = (np.asarray(x, dtype=np.float64) for x in relative)
    vertical = vertical_span(up, climb, sizes.height_m, sizes.tau_s, begin_s, end_s)
    some = is_surely_less(vertical.begin_s, vertical.end_s)
    start = np.where(some, vertical.begin_s, 0.0)
    length = np.where(some, vertical.end_s - start, 0.0)
    motion = horizontal_products(east + start * v_east, north + start * v_north, v_east, v_north)
    q, p, a, _ = motion
    delta = discriminant(motion, sizes.distance_m)
    root = np.sqrt(np.maximum(delta, 0.0))
    inside = q <= sizes.distance_m**2
    under = 4.0 * delta + (sizes.tau_s * a) ** 2
    linear = 2.0 * p + sizes.tau_s * a
    constant = np.maximum(q + sizes.tau_s * p - sizes.distance_m**2, 0.0)
    wide = np.sqrt(np.maximum(under, 0.0))
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        first = np.where(constant > 0.0, 2.0 * constant / (wide - linear), 0.0)
        after_tau = (wide - linear) / (2.0 * a)
    last = np.where(delta >= 0.0, exit_of_circle_s(motion, sizes.distance_m, root), after_tau)
    still = nearly_zero(a)
    entry = np.where(inside, 0.0, np.maximum(first, 0.0))
    leave = np.where(inside & still, length, np.minimum(last, length))
    some &= inside | (
        (p < 0.0) & (under >= 0.0) & ((delta >= 0.0) | (linear < 0.0) | (constant == 0.0))
    )
    if np.isfinite(sizes.miss_m):
        miss = discriminant(motion, sizes.miss_m)
        filtered = np.where(still, q <= sizes.miss_m**2, miss >= 0.0)
        past = exit_of_circle_s(motion, sizes.miss_m, np.sqrt(np.maximum(miss, 0.0)))
        leave = np.where(still, leave, np.minimum(leave, past))
        some &= filtered
    some &= is_surely_less(start + entry, start + leave)
    return Span(np.where(some, start + entry, np.inf), np.where(some, start + leave, -np.inf))
