"""An avoidance that turns out of the bands of guidance (``avoidance.daidalus``)."""

import math
from fractions import Fraction
from typing import Any

import numpy as np
from pydantic import Field, field_validator

from components.alert_configuration.conf_file import read_conf
from components.guidance.bands import GuidedIntruder, guidance
from components.guidance.resolution import Resolution, resolution
from components.guidance.situation import State
from components.messages.alerts import AlertLevels
from components.messages.steering import Manoeuvres
from dsa_des.block.component import Component, NonNegativeRational, Parameters, ScenePath
from dsa_des.block.ports import Input, Output
from dsa_des.block.wake import Wake

_OWN = ("alt_m", "east_mps", "north_mps", "climb_mps")
_RELATIVE = ("east_m", "north_m", "up_m", "east_mps", "north_mps", "climb_mps")


class TurnOutParameters(Parameters):
    """Parameters of turning out of a band."""

    conf: ScenePath = Field(
        description="Volumes, times and rate of turn: a .conf file of DAIDALUS."
    )
    alerter: int = Field(
        default=1, ge=1, description="Which alerter of the file all targets belong to, from 1."
    )
    level: int = Field(default=2, ge=1, description="Turn when an alert is of this level or above.")
    beyond_deg: float = Field(
        default=0.0, ge=0, le=90, description="Turn so much beyond the edge of the band, deg."
    )
    pause_s: NonNegativeRational = Field(
        default=Fraction(10), description="Shortest time from one manoeuvre to the next, s."
    )

    @field_validator("conf", mode="after")
    @classmethod
    def _readable(cls, value: Any) -> Any:
        read_conf(value)
        return value


class TurnOut(Component):
    """Turns the ownship to the nearest direction that leads clear, when an alert is due.

    The bands of direction are those of DAIDALUS, each instant by itself, over all targets whose
    flights the alerting knows. Where no direction is clear it turns towards the recovery band;
    without one it leaves the ownship alone.
    """

    inputs = {"alerts": Input(AlertLevels, "trigger", "The alert level of each target.")}
    outputs = {"manoeuvres": Output(Manoeuvres, "Turns that the ownship is told to fly.")}
    Parameters = TurnOutParameters
    windowed = True
    rewindable = True

    def setup(self) -> None:
        """Read the configuration; start free to turn."""
        self._configuration = read_conf(self.p.conf)
        count = len(self._configuration.alerters)
        if self.p.alerter > count:
            raise ValueError(
                f"alerter is {self.p.alerter}: it must be at most {count}, the number of alerters "
                f"of {self.p.conf}"
            )
        self._alerter = self._configuration.alerters[self.p.alerter - 1]
        self._pause_ticks = int(self.p.pause_s * self.context.ticks_per_s)
        self._free_from = 0

    def run(self, wake: Wake) -> Manoeuvres | None:
        """Look at every instant with an alert."""
        alerts: AlertLevels | None = wake["alerts"]
        if alerts is None:
            return None
        ticks, turns = [], []
        for place, tick in enumerate(wake.ticks.tolist()):
            entries = slice(int(alerts.offsets[place]), int(alerts.offsets[place + 1]))
            highest = int(np.max(alerts.level[entries], initial=0))
            if highest < self.p.level or tick < self._free_from:
                continue
            turn = self._turn(alerts, place, entries)
            if turn is not None:
                ticks.append(tick)
                turns.append(turn)
                self._free_from = tick + self._pause_ticks
        if not ticks:
            return None
        rate = self._configuration["turn_rate"] or math.radians(3.0)
        rates = np.full(len(ticks), rate)
        return Manoeuvres(np.array(ticks, dtype=np.int64), np.array(turns), rates)

    def _turn(self, alerts: AlertLevels, place: int, entries: slice) -> float | None:
        """Return the change of direction that leads out of the band, or None."""
        own_values = {name: float(values[place]) for name, values in alerts.own_motion.items()}
        if not all(map(math.isfinite, own_values.values())):
            return None
        alt, *velocity = (np.asarray(own_values[name]) for name in _OWN)
        own = State(np.zeros(()), np.zeros(()), alt, *velocity)
        parts = [alerts.relative[name][entries] for name in _RELATIVE]
        intruders = [
            GuidedIntruder(
                State(*(mine - part[i] for mine, part in zip(own, parts, strict=True))),
                self._alerter,
            )
            for i in range(len(parts[0]))
        ]
        found = guidance("hdir", self._configuration, own, intruders)
        region = self._configuration["corrective_region"]
        way = resolution(found.bands, found.own_value, region, cyclic=True)
        return None if way is None else self._smallest(way, found.own_value)

    def _smallest(self, way: Resolution, own_value: float) -> float | None:
        target = way.high if way.prefers_high else way.low
        if not math.isfinite(target):
            return None
        side = 1.0 if way.prefers_high else -1.0
        away = (side * (target - own_value)) % (2.0 * math.pi)
        return side * min(away + math.radians(self.p.beyond_deg), math.pi)
