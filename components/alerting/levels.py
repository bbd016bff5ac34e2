"""Alert levels over time and targets: times to violation, spreads, what is due, memory."""

from typing import Any, NamedTuple

import numpy as np

from components.alert_configuration.configuration import Alerter, Configuration, Level
from components.alerting.memory import AlertMemory, MemoryRule
from components.guidance.manoeuvre_kinds import manoeuvres_of_kind
from components.guidance.situation import Detector, State
from components.well_clear.detection import Bounds, select_bounds, violation_or_advisory_span
from components.well_clear.relative_motion import is_surely_less
from components.well_clear.volume import Relative
from dsa_des.arrays.types import BoolArray, FloatArray, IntArray

# Pairs taken together: arrays over their manoeuvres stay in the cache.
_MOST_SPREAD_AT_ONCE = 64


def levels_due_by_spread(
    configuration: Configuration,
    levels: tuple[Level, ...],
    own: State,
    intruder: State,
    bounds: Bounds | None,
) -> tuple[BoolArray, BoolArray]:
    """Return two masks (n, levels): a conflict lies within a level's spread of own manoeuvres
    before its alerting time, and before its early one.
    """
    count = len(own.up_m)
    due, early = (np.zeros((count, len(levels)), dtype=bool) for _ in range(2))
    for start in range(0, count, _MOST_SPREAD_AT_ONCE):
        part = slice(start, start + _MOST_SPREAD_AT_ONCE)
        mine, theirs = own.rows(part), intruder.rows(part)
        for number, level in enumerate(levels):
            of_part = select_bounds(bounds, part) if level.uncertain else None
            detector = Detector(
                level.volume, bounds=select_bounds(of_part, (slice(None), np.newaxis))
            )
            for kind_name, spread in level.spreads:
                kind = manoeuvres_of_kind(kind_name, mine, configuration)
                conflicts = kind.find_conflicts(theirs.columns(), detector)
                middle = kind.own_value[:, np.newaxis]
                low, high = kind.values[:, :-1] - middle, kind.values[:, 1:] - middle
                near = (low < spread) & (high > -spread) & kind.there[:, :-1] & kind.there[:, 1:]
                for level_due, horizon_s in (
                    (due, level.alerting_time_s),
                    (early, level.early_alerting_time_s),
                ):
                    unsafe = conflicts.is_in_or_behind_conflict(0.0, horizon_s)
                    met = (near & (unsafe[:, :-1] | unsafe[:, 1:])).any(axis=1)
                    level_due[part, number] |= met
    return due, early


# Pairs taken together: their intermediate arrays stay in the cache.
_MOST_AT_ONCE = 8192


class Alerts(NamedTuple):
    """Alert levels of targets over time."""

    level: IntArray  # (times, targets): 0 without an alert, -1 where a target is absent
    # (times, targets, levels): time to violation of each level's volume, 0 inside, infinite if
    # never
    violation_s: FloatArray
    # (times, targets): the level whose early alerting time counts for guidance; 0 for none
    early_level: IntArray


def memory_rule(configuration: Configuration) -> MemoryRule:
    """Return the hysteresis, persistence and m-of-n settings of a configuration."""
    return MemoryRule(
        configuration["hysteresis_time"],
        configuration["persistence_time"],
        configuration["alerting_m"],
        configuration["alerting_n"],
    )


def violation_times_s(
    levels: tuple[Level, ...],
    relative: Relative,
    lookahead_s: float,
    bounds: Bounds | None,
    own_up_mps: tuple[FloatArray, FloatArray] | None = None,
) -> FloatArray:
    """Return the time in s until each level's volume is violated, (n, levels), within lookahead."""
    count = len(relative[0])
    result = np.empty((count, len(levels)))
    for start in range(0, count, _MOST_AT_ONCE):
        part = slice(start, start + _MOST_AT_ONCE)
        states = tuple(value[part] for value in relative)
        known: dict[tuple[object, bool], FloatArray] = {}
        for number, level in enumerate(levels):
            key = level.volume, level.uncertain
            if key not in known:
                vertical = (
                    None if own_up_mps is None else (own_up_mps[0][part], own_up_mps[1][part])
                )
                of_part = select_bounds(bounds, part) if level.uncertain else None
                known[key] = violation_or_advisory_span(
                    level.volume, states, vertical, of_part, 0.0, lookahead_s
                ).begin_s
            result[part, number] = known[key]
    return result


def due_and_early_due_levels(
    levels: tuple[Level, ...], violation_s: FloatArray
) -> tuple[BoolArray, BoolArray]:
    """Return masks (n, levels): violated before the level's alerting time, and its early time."""
    ordinary = np.array([level.alerting_time_s for level in levels])
    early = np.array([level.early_alerting_time_s for level in levels])
    inside = violation_s == 0.0
    return inside | is_surely_less(violation_s, ordinary), inside | is_surely_less(
        violation_s, early
    )


class AlertPairs(NamedTuple):
    """Pairs of ownship and target at one instant each, for their levels without memory."""

    # six of (n,): east, north, up in m and their rates in m/s, ownship less target
    relative: Relative
    # (n,) or None: the ownship in its own plane: its altitude and velocity. Without it
    # no level of TCAS II and no spread can be told
    own: State | None = None
    bounds: Bounds | None = None  # (n,) or None: how far the relative states may be wrong

    def select(self, which: Any) -> "AlertPairs":
        """Return the pairs at an index or where a mask is true."""
        own = None if self.own is None else self.own.rows(which)
        relative = tuple(part[which] for part in self.relative)
        return AlertPairs(relative, own, select_bounds(self.bounds, which))


def times_and_due_without_memory(
    configuration: Configuration, alerter: Alerter, pairs: AlertPairs
) -> tuple[FloatArray, BoolArray, BoolArray]:
    """Return three arrays (n, levels): time to each level's volume in s, whether it is due, and
    whether it is due by its early time.
    """
    own, levels = pairs.own, alerter.levels
    result = violation_times_s(
        levels,
        pairs.relative,
        configuration["lookahead_time"],
        pairs.bounds,
        None if own is None else (own.up_m, own.climb_mps),
    )
    due, early = due_and_early_due_levels(levels, result)
    if own is not None and any(level.spreads for level in levels):
        intruder = State(*(mine - part for mine, part in zip(own, pairs.relative, strict=True)))
        by_spread = levels_due_by_spread(configuration, levels, own, intruder, pairs.bounds)
        due, early = due | by_spread[0], early | by_spread[1]
    return result, due, early


def alert_levels(
    configuration: Configuration,
    time_s: FloatArray,
    present: BoolArray,
    pairs: AlertPairs,
    alerter: IntArray | None = None,
) -> Alerts:
    """Return all targets' alert levels over time, after hysteresis; -1 where one is not present.

    `time_s` (times,) is the ownship's; `pairs` (times, targets) are finite also where a target is
    not `present`. `alerter` (times, targets) is the index of each one's in the configuration, by
    default the first for all.
    """
    shape = present.shape
    most = configuration.most_levels
    relative = tuple(np.asarray(part, dtype=np.float64) for part in pairs.relative)
    pairs = AlertPairs(relative, pairs.own, pairs.bounds)
    which = np.zeros(shape, dtype=np.int64) if alerter is None else alerter
    violation_s = np.full((*shape, most), np.inf)
    due = np.zeros((*shape, most), dtype=bool)
    early = np.zeros((*shape, most), dtype=bool)
    for number, one in enumerate(configuration.alerters):
        cells = np.nonzero((which == number) & present)
        if len(cells[0]) and one.levels:
            result = times_and_due_without_memory(configuration, one, pairs.select(cells))
            count = len(one.levels)
            for whole, part in zip((violation_s, due, early), result, strict=True):
                whole[cells[0], cells[1], :count] = part
    level = np.full(shape, -1, dtype=np.int64)
    early_level = np.zeros(shape, dtype=np.int64)
    rule, targets = memory_rule(configuration), np.arange(shape[1])
    memory = AlertMemory.new(rule, 0 * targets, targets)
    for row, now_s in enumerate(np.asarray(time_s).tolist()):
        memory, now = memory.next_memory_and_levels(rule, now_s, present[row], due[row], early[row])
        level[row] = np.where(present[row], now, -1)
        early_level[row] = memory.early_levels_for_guidance(rule, now_s, present[row])
    return Alerts(level, violation_s, early_level)
