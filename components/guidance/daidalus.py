"""Bands of guidance in a scene (``guidance.daidalus``), and the ways out of them."""

import math
from collections.abc import Sequence
from typing import Any, Literal

import numpy as np
from pydantic import Field, field_validator

from components.alert_configuration.conf_file import read_conf
from components.alert_configuration.configuration import (
    Alerter,
    Configuration,
    Deviations,
    uncertainty_bounds,
)
from components.guidance.bands import Guidance, guidance_of_many, nearest_values_outside_red
from components.guidance.intervals import FULL_TURN, is_same_value
from components.guidance.regions import GuidedIntruders
from components.guidance.situation import State
from components.messages.alerts import (
    BAND_KINDS,
    BAND_REGIONS,
    AlertLevels,
    GuidanceBands,
    unreached_level_notes,
)
from dsa_des.arrays.types import IntArray
from dsa_des.block.component import Component, Input, Output, Parameters, Producer, ScenePath
from dsa_des.block.message import offsets_from_entry_rows
from dsa_des.block.wake import Wake


class ConfParameters(Parameters):
    """A configuration and the alerter of all targets."""

    conf: ScenePath = Field(
        description="Volumes, times and rate of turn: a .conf file of DAIDALUS."
    )
    alerter: int = Field(
        default=1, ge=1, description="Which alerter of the file all targets belong to, from 1."
    )

    @field_validator("conf", mode="after")
    @classmethod
    def _check_conf_readable(cls, value: Any) -> Any:
        read_conf(value)
        return value

    def read_configuration(self) -> tuple[Configuration, Alerter]:
        """Read the configuration's file; return the configuration and its chosen alerter."""
        configuration = read_conf(self.conf)
        count = len(configuration.alerters)
        if self.alerter > count:
            raise ValueError(
                f"alerter is {self.alerter}: it must be at most {count}, the number of alerters "
                f"of {self.conf}"
            )
        return configuration, configuration.alerters[self.alerter - 1]


_OWN = ("alt_m", "east_mps", "north_mps", "climb_mps")
_RELATIVE = ("east_m", "north_m", "up_m", "east_mps", "north_mps", "climb_mps")


Changes = tuple[float, float]


def changes_out_of_bands(
    kind_name: str,
    configuration: Configuration,
    alerter: Alerter,
    alerts: AlertLevels,
    rows: Sequence[int],
) -> list[Changes | None]:
    """Return each row's smallest changes left or down, and right or up, that leave the bands.

    They are to the left or down, negative, and to the right or up, positive, in rad, m/s or m;
    infinite where nothing there leads out, and None where the own value needs no change or is not
    known yet. `rows` are of the message, each looked at by itself; the alerter is that of all
    targets.
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
    """Return the bands at given rows of alerts, without memory; None if own motion is unknown.

    Parameters are those of `changes_out_of_bands`.
    """
    result: list[Guidance | None] = [None] * len(rows)
    own = np.array([alerts.own_motion[name][rows] for name in _OWN]).reshape(len(_OWN), -1)
    known = np.flatnonzero(np.isfinite(own).all(axis=0))
    first = alerts.offsets[np.asarray(rows, dtype=np.int64)]
    counts = alerts.offsets[np.asarray(rows, dtype=np.int64) + 1] - first
    for count in np.flatnonzero(np.bincount(counts[known])).tolist():
        alike = known[counts[known] == count]
        zero = np.zeros(len(alike))
        state = State(zero, zero, *own[:, alike])
        intruders = [
            _intruders_of_entries(alerts, first[alike] + i, state, configuration, alerter)
            for i in range(count)
        ]
        every = guidance_of_many(kind_name, configuration, state, intruders)
        for index, guided in zip(alike.tolist(), every, strict=True):
            result[index] = guided
    return result


def _intruders_of_entries(
    alerts: AlertLevels,
    entries: IntArray,
    own: State,
    configuration: Configuration,
    alerter: Alerter,
) -> GuidedIntruders:
    """Return the intruders of some alert entries, one per ownship, with bounds on their errors."""
    parts = [alerts.relative[name][entries] for name in _RELATIVE]
    bounds = None
    if alerts.deviations:
        wrong = Deviations(*(alerts.deviations[name][entries] for name in Deviations._fields))
        bounds = uncertainty_bounds(configuration, wrong, np.hypot(parts[0], parts[1]))
    state = State(*(mine - part for mine, part in zip(own, parts, strict=True)))
    early = np.zeros(len(entries), dtype=np.int64)
    return GuidedIntruders(state, alerter, early, bounds=bounds)


def _changes(guided: Guidance, region: str, cyclic: bool) -> Changes | None:
    way = nearest_values_outside_red(guided.bands, guided.own_value, region, cyclic)
    if way is None:
        return None
    if not cyclic:
        return way.low - guided.own_value, way.high - guided.own_value
    low = -((guided.own_value - way.low) % FULL_TURN) if math.isfinite(way.low) else -math.inf
    high = (way.high - guided.own_value) % FULL_TURN if math.isfinite(way.high) else math.inf
    return low, high


def smaller_change(changes: tuple[float, float]) -> float | None:
    """Return the change of smaller size, that to the right or up if both are equal.

    None where there is neither.
    """
    low, high = changes
    change = high if high <= -low or is_same_value(high, -low) else low
    return change if math.isfinite(change) else None


def explain_no_steering(
    level: int, configuration: Configuration, alerter: Alerter, producers: Sequence[Producer]
) -> list[str]:
    """Return notes if no alert can reach a block's steering level, or no band can be red."""
    said = unreached_level_notes("level", level, producers)
    if configuration.first_corrective_level(alerter) is None:
        said.append(
            f"no level of the alerter {alerter.name} has the region "
            f"{configuration['corrective_region']} (corrective_region) or a worse one: no band is "
            "red, so it never steers"
        )
    return said


_NAMES = {"direction": "hdir", "altitude": "alt", "speed": "hs"}


class GuidanceParameters(ConfParameters):
    """Parameters of guidance."""

    level: int = Field(
        default=1, ge=0, description="Bands are given where an alert is of this level or above."
    )
    kinds: tuple[Literal["direction", "altitude", "speed"], ...] = Field(
        default=("direction", "altitude"),
        min_length=1,
        description="What bands are given of: direction, altitude, speed over the ground.",
    )


class DaidalusGuidance(Component):
    """Which directions, altitudes and speeds lose separation, by DAIDALUS (RTCA DO-365).

    Over all targets whose flights the alerting knows, at each of its scans by itself. It steers
    nobody; `avoidance.daidalus` flies out of the same bands.
    """

    inputs = {"alerts": Input(AlertLevels, "trigger", "The alert level of each target.")}
    outputs = {
        "bands": Output(GuidanceBands, "Directions, altitudes and speeds that lose separation.")
    }
    Parameters = GuidanceParameters
    remembers = ()
    windowed = True
    lockstep = True
    rewindable = True

    def setup(self) -> None:
        """Read the configuration."""
        self._configuration, self._alerter = self.p.read_configuration()

    def warnings(self) -> list[str]:
        """Return a warning where no alert reaches its level, or no level has bands."""
        said = unreached_level_notes("level", self.p.level, self.context.producers)
        if all(level.region == "NONE" for level in self._alerter.levels):
            said.append(f"no level of the alerter {self._alerter.name} has a region: no bands")
        return said

    def run(self, wake: Wake) -> GuidanceBands | None:
        """Return the bands of every instant with an alert."""
        alerts: AlertLevels | None = wake["alerts"]
        if alerts is None:
            return None
        rows = np.flatnonzero(alerts.highest_levels() >= self.p.level).tolist()
        result: list[tuple[int, int, int, float, float]] = []
        for number, kind in enumerate(BAND_KINDS):
            if kind not in self.p.kinds:
                continue
            every = bands_around(_NAMES[kind], self._configuration, self._alerter, alerts, rows)
            for index, guided in enumerate(every):
                result += [
                    (index, number, BAND_REGIONS.index(band.region), band.low, band.high)
                    for band in (() if guided is None else guided.bands)
                    if band.region != "NONE"
                ]
        if not result:
            return None
        result.sort(key=lambda one: one[0])
        table = np.array(result)
        line, code = table[:, 0].astype(np.int64), table[:, 1].astype(np.int64)
        ends = [
            np.where(code == number, table[:, k], math.nan)
            for number in range(len(BAND_KINDS))
            for k in (3, 4)
        ]
        region = table[:, 2].astype(np.int64)
        ran = wake.instants.take(np.array(rows, dtype=np.int64))
        offsets = offsets_from_entry_rows(line, len(rows))
        return GuidanceBands(ran.tick, offsets, code, region, *ends, run=ran.run)
