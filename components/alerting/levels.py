"""Alert levels over time and targets: times to violation, what is due, and the memory's pass."""

from typing import NamedTuple

import numpy as np

from components.alert_configuration.configuration import Alerter, Configuration, Level
from components.alerting.memory import AlertMemory, MemoryRule
from components.well_clear.nearly import surely_less
from components.well_clear.uncertainty import Bounds, uncertain_violation_span
from components.well_clear.violation import Relative, violation_span
from dsa_des.arrays.types import BoolArray, FloatArray, IntArray

# Pairs taken together: their intermediate arrays stay in the cache.
_MOST_AT_ONCE = 8192


class Alerts(NamedTuple):
    """Alert levels of targets over time.

    Parameters
    ----------
    level : (times, targets)
        0 without an alert, -1 where a target is absent.
    violation_s : (times, targets, levels)
        Time to violation of each level's volume, 0 inside, infinite if never.
    """

    level: IntArray
    violation_s: FloatArray


def memory_rule(configuration: Configuration) -> MemoryRule:
    """Return how a configuration has alert levels remembered."""
    return MemoryRule(
        configuration["hysteresis_time"],
        configuration["persistence_time"],
        configuration["alerting_m"],
        configuration["alerting_n"],
    )


def violation_times_s(
    levels: tuple[Level, ...], relative: Relative, lookahead_s: float, bounds: Bounds | None
) -> FloatArray:
    """Return the time to violation of each level, (n, levels).

    Parameters
    ----------
    levels : tuple of Level
    relative : six of (n,)
        East, north, up in m and their rates in m/s, ownship less intruder.
    lookahead_s : float
    bounds : Bounds or None
        How far the states may be wrong, for levels that heed it.
    """
    count = len(relative[0])
    found = np.empty((count, len(levels)))
    for start in range(0, count, _MOST_AT_ONCE):
        part = slice(start, start + _MOST_AT_ONCE)
        states = tuple(value[part] for value in relative)
        known: dict[tuple[object, bool], FloatArray] = {}
        for number, level in enumerate(levels):
            key = level.volume, level.uncertain
            if key not in known:
                if level.uncertain and bounds is not None:
                    of_part = Bounds(*(bound[part] for bound in bounds))
                    span = uncertain_violation_span(level.volume, states, of_part, 0.0, lookahead_s)
                else:
                    span = violation_span(level.volume, states, 0.0, lookahead_s)
                known[key] = span.begin_s
            found[part, number] = known[key]
    return found


def due_levels(levels: tuple[Level, ...], violation_s: FloatArray) -> tuple[BoolArray, BoolArray]:
    """Return whether each level is due, by its alerting time and by its early one, (n, levels)."""
    ordinary = np.array([level.alerting_time_s for level in levels])
    early = np.array([level.early_alerting_time_s for level in levels])
    inside = violation_s == 0.0
    return inside | surely_less(violation_s, ordinary), inside | surely_less(violation_s, early)


def alert_levels(
    configuration: Configuration,
    time_s: FloatArray,
    present: BoolArray,
    relative: Relative,
    alerter: IntArray | None = None,
    bounds: Bounds | None = None,
) -> Alerts:
    """Return the alert levels of targets over time, memory included.

    Parameters
    ----------
    configuration : Configuration
    time_s : (times,)
        The ownship's.
    present : (times, targets) of bool
    relative : six of (times, targets)
        East, north, up in m and their rates in m/s, ownship less intruder; finite also where a
        target is absent.
    alerter : (times, targets) of int, optional
        Place of each one's alerter in the configuration, from 0; the first for all by default.
    bounds : Bounds of (times, targets), optional

    Returns
    -------
    Alerts
    """
    shape = present.shape
    most = configuration.most_levels
    flat = tuple(np.ravel(np.asarray(part, dtype=np.float64)) for part in relative)
    flat_bounds = None if bounds is None else Bounds(*(np.ravel(bound) for bound in bounds))
    which = np.zeros(shape, dtype=np.int64) if alerter is None else alerter
    violation_s = np.full((present.size, most), np.inf)
    due = np.zeros((present.size, most), dtype=bool)
    early = np.zeros((present.size, most), dtype=bool)
    for number, one in enumerate(configuration.alerters):
        cells = np.flatnonzero((which == number) & present)
        if len(cells) and one.levels:
            _fill(configuration, one, cells, flat, flat_bounds, violation_s, due, early)
    level = np.full(shape, -1, dtype=np.int64)
    memory = AlertMemory(memory_rule(configuration), shape[1])
    due, early = due.reshape(*shape, most), early.reshape(*shape, most)
    for row, now_s in enumerate(np.asarray(time_s).tolist()):
        level[row] = np.where(
            present[row], memory.step(now_s, present[row], due[row], early[row]), -1
        )
    return Alerts(level, violation_s.reshape(*shape, most))


def _fill(
    configuration: Configuration,
    alerter: Alerter,
    cells: IntArray,
    relative: tuple[FloatArray, ...],
    bounds: Bounds | None,
    violation_s: FloatArray,
    due: BoolArray,
    early: BoolArray,
) -> None:
    """Fill in times and what is due for the cells of one alerter."""
    states = tuple(part[cells] for part in relative)
    of_cells = None if bounds is None else Bounds(*(bound[cells] for bound in bounds))
    found = violation_times_s(
        alerter.levels,
        states,
        configuration["lookahead_time"],
        of_cells,
    )
    count = len(alerter.levels)
    violation_s[cells, :count] = found
    due[cells, :count], early[cells, :count] = due_levels(alerter.levels, found)
