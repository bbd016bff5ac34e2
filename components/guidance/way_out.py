"""How the ownship gets out of the bands around it, of an alerting block's message."""

import math
from collections.abc import Sequence

import numpy as np

from components.alert_configuration.configuration import Alerter, Configuration
from components.alert_configuration.margins import Deviations, margins
from components.guidance.bands import Guidance, guidance_of_many
from components.guidance.intervals import FULL_TURN, same_place
from components.guidance.regions import GuidedIntruders
from components.guidance.resolution import resolution
from components.guidance.situation import State
from components.messages.alerts import AlertLevels
from dsa_des.arrays.types import IntArray

_OWN = ("alt_m", "east_mps", "north_mps", "climb_mps")
_RELATIVE = ("east_m", "north_m", "up_m", "east_mps", "north_mps", "climb_mps")


Changes = tuple[float, float]


def changes_out(
    kind_name: str,
    configuration: Configuration,
    alerter: Alerter,
    alerts: AlertLevels,
    rows: Sequence[int],
) -> list[Changes | None]:
    """Return the smallest changes to either side that lead out of the bands at some instants.

    Parameters
    ----------
    kind_name : {"hdir", "hs", "vs", "alt"}
    configuration : Configuration
    alerter : Alerter
        Of all targets.
    alerts : AlertLevels
    rows : sequence of int
        Of the message; each is looked at by itself.

    Returns
    -------
    list of (float, float) or None
        To the left or down, negative, and to the right or up, positive, rad, m/s or m; infinite
        where nothing there leads out. None where the own value needs no change or is not known yet.
    """
    region, cyclic = configuration["corrective_region"], kind_name == "hdir"
    return [
        None if guided is None else _changes(guided, region, cyclic)
        for guided in bands_around(kind_name, configuration, alerter, alerts, rows)
    ]


def bands_around(
    kind_name: str,
    configuration: Configuration,
    alerter: Alerter,
    alerts: AlertLevels,
    rows: Sequence[int],
) -> list[Guidance | None]:
    """Return the bands at some instants, each by itself; None where nothing is known yet.

    Parameters are those of `changes_out`.
    """
    found: list[Guidance | None] = [None] * len(rows)
    own = np.array([alerts.own_motion[name][rows] for name in _OWN]).reshape(len(_OWN), -1)
    known = np.flatnonzero(np.isfinite(own).all(axis=0))
    first = alerts.offsets[np.asarray(rows, dtype=np.int64)]
    counts = alerts.offsets[np.asarray(rows, dtype=np.int64) + 1] - first
    for count in np.flatnonzero(np.bincount(counts[known])).tolist():
        alike = known[counts[known] == count]
        zero = np.zeros(len(alike))
        state = State(zero, zero, *own[:, alike])
        intruders = [
            _intruder(alerts, first[alike] + i, state, configuration, alerter) for i in range(count)
        ]
        every = guidance_of_many(kind_name, configuration, state, intruders)
        for place, guided in zip(alike.tolist(), every, strict=True):
            found[place] = guided
    return found


def _intruder(
    alerts: AlertLevels,
    entries: IntArray,
    own: State,
    configuration: Configuration,
    alerter: Alerter,
) -> GuidedIntruders:
    """Return one intruder of each of some ownships."""
    parts = [alerts.relative[name][entries] for name in _RELATIVE]
    bounds = None
    if alerts.deviations:
        wrong = Deviations(*(alerts.deviations[name][entries] for name in Deviations._fields))
        bounds = margins(configuration, wrong, np.hypot(parts[0], parts[1]))
    state = State(*(mine - part for mine, part in zip(own, parts, strict=True)))
    early = np.zeros(len(entries), dtype=np.int64)
    return GuidedIntruders(state, alerter, early, bounds=bounds)


def _changes(found: Guidance, region: str, cyclic: bool) -> Changes | None:
    way = resolution(found.bands, found.own_value, region, cyclic)
    if way is None:
        return None
    if not cyclic:
        return way.low - found.own_value, way.high - found.own_value
    low = -((found.own_value - way.low) % FULL_TURN) if math.isfinite(way.low) else -math.inf
    high = (way.high - found.own_value) % FULL_TURN if math.isfinite(way.high) else math.inf
    return low, high


def smaller(changes: tuple[float, float]) -> float | None:
    """Return the smaller of two changes, to the right or up where they are equal.

    None where there is neither.
    """
    low, high = changes
    change = high if high <= -low or same_place(high, -low) else low
    return change if math.isfinite(change) else None
