"""Levels that are due because a manoeuvre near the ownship's own values leads to their volume."""

import numpy as np

from components.alert_configuration.configuration import Configuration, Level
from components.guidance.kinds import kind_of
from components.guidance.situation import Detector, State
from components.well_clear.detection import some_bounds
from components.well_clear.uncertainty import Bounds
from dsa_des.arrays.types import BoolArray

# Pairs taken together: arrays over their manoeuvres stay in the cache.
_MOST_AT_ONCE = 64


def due_by_spread(
    configuration: Configuration,
    levels: tuple[Level, ...],
    own: State,
    intruder: State,
    bounds: Bounds | None,
) -> tuple[BoolArray, BoolArray]:
    """Return whether each level is due by its spreads, by its alerting time and its early one.

    Parameters
    ----------
    configuration : Configuration
    levels : tuple of Level
    own, intruder : State of (n,)
        Pairs, each in its ownship's plane.
    bounds : Bounds of (n,), optional

    Returns
    -------
    (n, levels) of bool, twice
        A level is due if, of some kind with a spread, part of the values nearer than it to the
        own value is not clear of the level's volume, alone and within that time.
    """
    count = len(own.up_m)
    due, early = (np.zeros((count, len(levels)), dtype=bool) for _ in range(2))
    for start in range(0, count, _MOST_AT_ONCE):
        part = slice(start, start + _MOST_AT_ONCE)
        mine, theirs = own.rows(part), intruder.rows(part)
        for number, level in enumerate(levels):
            of_part = some_bounds(bounds, part) if level.uncertain else None
            detector = Detector(
                level.volume, bounds=some_bounds(of_part, (slice(None), np.newaxis))
            )
            for kind_name, spread in level.spreads:
                kind = kind_of(kind_name, mine, configuration)
                conflicts = kind.against(theirs.columns(), detector)
                middle = kind.own_value[:, np.newaxis]
                low, high = kind.values[:, :-1] - middle, kind.values[:, 1:] - middle
                near = (low < spread) & (high > -spread) & kind.there[:, :-1] & kind.there[:, 1:]
                for found, horizon_s in (
                    (due, level.alerting_time_s),
                    (early, level.early_alerting_time_s),
                ):
                    unsafe = conflicts.unsafe(0.0, horizon_s)
                    met = (near & (unsafe[:, :-1] | unsafe[:, 1:])).any(axis=1)
                    found[part, number] |= met
    return due, early
