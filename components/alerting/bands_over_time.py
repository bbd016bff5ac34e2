"""Bands of guidance over a recorded encounter, and the table of them."""

from typing import NamedTuple

import numpy as np

from components.alert_configuration.configuration import Configuration
from components.alerting.alert_table import number_texts
from components.alerting.encounter import Encounter
from components.alerting.levels import Alerts
from components.formats.text_rows import LENGTH_M, SPEED_MPS
from components.guidance.bands import guidance_of_many
from components.guidance.intervals import Band
from components.guidance.kinds import KINDS
from components.guidance.regions import GuidedIntruders
from components.guidance.remembered import GuidanceMemory
from components.guidance.situation import State
from components.well_clear.detection import some_bounds
from dsa_des.arrays.types import FloatArray

#: Factor to SI units and radians of each kind's values in a table: deg, knot, ft/min, ft.
TABLE_UNITS = {
    "hdir": np.pi / 180.0,
    "hs": SPEED_MPS["knot"],
    "vs": SPEED_MPS["fpm"],
    "alt": LENGTH_M["ft"],
}


class BandsOverTime(NamedTuple):
    """Bands of one kind at the instants of an encounter.

    Parameters
    ----------
    time_s : (instants,)
        As in the file.
    own_value : (instants,)
        Of the ownship, in SI units and radians.
    bands : list of list of Band
        Those of each instant, as remembered.
    """

    time_s: FloatArray
    own_value: FloatArray
    bands: list[list[Band]]


def bands_over_time(
    kind_name: str, configuration: Configuration, encounter: Encounter, alerts: Alerts
) -> BandsOverTime:
    """Return the bands of a kind at all instants of an encounter, memory included.

    Parameters
    ----------
    kind_name : {"hdir", "hs", "vs", "alt"}
    configuration : Configuration
    encounter : Encounter
    alerts : Alerts
        Of the encounter: a target whose level is on counts by its early alerting time.
    """
    pairs = encounter.pairs
    assert pairs.own is not None
    count = len(encounter.time_s)
    zero = np.zeros(count)
    own = State(zero, zero, *encounter.own_state)
    intruders = []
    for target in range(len(encounter.targets)):
        state = State(
            *(mine - part[:, target] for mine, part in zip(own, pairs.relative, strict=True))
        )
        for number, alerter in enumerate(configuration.alerters):
            there = encounter.present[:, target] & (encounter.alerter[:, target] == number)
            if there.any():
                early = alerts.early_level[:, target]
                bounds = some_bounds(pairs.bounds, (slice(None), target))
                intruders.append(GuidedIntruders(state, alerter, early, there, bounds))
    memory = GuidanceMemory(configuration, kind_name)
    found = guidance_of_many(kind_name, configuration, own, intruders)
    bands = [
        memory.step(now_s, one).bands
        for now_s, one in zip(encounter.time_s.tolist(), found, strict=True)
    ]
    return BandsOverTime(encounter.time_s, np.array([one.own_value for one in found]), bands)


def bands_table(
    configuration: Configuration, encounter: Encounter, alerts: Alerts, decimals: int
) -> str:
    """Return the bands of all four kinds as comma-separated text, a row per band.

    Columns are ``time_s,kind,low,up,region``, from the least to the largest value of each kind, in
    deg, knot, ft/min and ft.
    """
    kinds = {kind: bands_over_time(kind, configuration, encounter, alerts) for kind in KINDS}
    lines = ["time_s,kind,low,up,region"]
    for row, now_s in enumerate(number_texts(encounter.time_s, decimals)):
        for kind, over_time in kinds.items():
            bands = over_time.bands[row]
            edges = np.array([(band.low, band.high) for band in bands]) / TABLE_UNITS[kind]
            low, high = (number_texts(edge, decimals) for edge in edges.T)
            for place, band in enumerate(bands):
                lines.append(f"{now_s},{kind},{low[place]},{high[place]},{band.region}")
    return "\n".join(lines) + "\n"
