"""Bands of direction over a recorded encounter, at so many instants as a figure can show."""

from typing import NamedTuple

import numpy as np

from components.alert_configuration.configuration import Configuration
from components.alerting.encounter import Encounter
from components.alerting.levels import Alerts
from components.guidance.bands import GuidedIntruder, guidance
from components.guidance.intervals import Band
from components.guidance.situation import State
from dsa_des.arrays.types import FloatArray

#: Instants of a figure.
MOST_INSTANTS = 60


class BandsOverTime(NamedTuple):
    """Bands at instants of an encounter.

    Parameters
    ----------
    time_s : (instants,)
        As in the file.
    own_value : (instants,)
        The ownship's direction over ground, rad.
    bands : list of list of Band
        Those of each instant, rad.
    """

    time_s: FloatArray
    own_value: FloatArray
    bands: list[list[Band]]


def direction_bands(
    configuration: Configuration, encounter: Encounter, alerts: Alerts
) -> BandsOverTime:
    """Return the bands of direction at instants spread over an encounter.

    Parameters
    ----------
    configuration : Configuration
    encounter : Encounter
    alerts : Alerts
        Of the encounter: a target whose level is on counts by its early alerting time.

    Returns
    -------
    BandsOverTime
        Each instant by itself, without memory of the bands.
    """
    count = len(encounter.time_s)
    rows = np.unique(np.linspace(0, count - 1, min(count, MOST_INSTANTS)).round().astype(int))
    found, values = [], []
    for row in rows.tolist():
        up, v_east, v_north, climb = encounter.own_state[:, row]
        own = State(np.zeros(()), np.zeros(()), up, v_east, v_north, climb)
        intruders = []
        for number in np.flatnonzero(encounter.present[row]).tolist():
            relative = [part[row, number] for part in encounter.relative]
            state = State(*(mine - part for mine, part in zip(own, relative, strict=True)))
            alerter = configuration.alerters[int(encounter.alerter[row, number])]
            level = int(alerts.level[row, number]) if configuration["hysteresis_time"] > 0 else 0
            intruders.append(GuidedIntruder(state, alerter, level))
        made = guidance("hdir", configuration, own, intruders)
        found.append(made.bands)
        values.append(made.own_value)
    return BandsOverTime(encounter.time_s[rows], np.array(values), found)
