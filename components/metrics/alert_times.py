"""Whether alerts come in time (``alert_times``): before well clear is lost, and only then.

Where the ownship is steered, losses are by default those of what it would have flown: an alert that
was heeded is no nuisance.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from pydantic import Field

from components.metrics.encounter import STEP, SizeParameters, read_flights
from components.metrics.rows import TargetMetric, TargetParameters, is_named, of_target
from components.metrics.separation import traffic_block
from components.metrics.steered import ToldManoeuvres
from dsa_des.arrays.types import AnyArray, BoolArray, FloatArray
from dsa_des.scene.scene import Scene
from dsa_des.studies.metric import EVENT, NUMBER, Group, Result, recorded_by


class AlertTimeParameters(TargetParameters, SizeParameters):
    """Parameters of alert times."""

    level: int = Field(default=2, ge=1, description="Alerts of this level or above count.")
    late_s: float = Field(
        default=15.0, ge=0, description="An alert is late if the loss comes sooner after it, s."
    )
    surprise_s: float = Field(
        default=5.0, ge=0, description="A level is a surprise sooner after the one below it, s."
    )
    step_s: float | None = STEP
    steered: bool = Field(
        default=False,
        description="Take the flights as the ownship was told to fly them, not as planned.",
    )


class AlertTimes(TargetMetric):
    """When alerts come before well clear is lost, and which are late, missed or for nothing.

    Of each block that records alerts, so that one fed by the truth and one fed by tracks stand side
    by side. An alert is *missed* if well clear is lost and none came before, *late* if it came less
    than `late_s` before the loss or is missed, a *nuisance* if well clear is never lost, and a
    *surprise* if the level below had not been on for `surprise_s` when it came.
    """

    Parameters = AlertTimeParameters
    tables = {"alerts": ("block", "target", "time_s", "level")}

    def __init__(self, parameters: Any, scene: Scene) -> None:
        super().__init__(parameters, scene)
        traffic = traffic_block(scene).name
        #: Whether losses are of what was flown, so that a run that ended early has no later ones.
        self._as_flown = parameters.steered or all(w.target != traffic for w in scene.wires)
        self._blocks = recorded_by(scene, "alerts")
        if parameters.steered:
            self._told = ToldManoeuvres(scene)
            self.tables = {**self.tables, **self._told.tables}

    def results(self) -> list[Result]:
        """Return times and events of each alerting block."""
        found = []
        for name in self._blocks:
            found += [
                Result(f"first_alert_time_s.{name}", NUMBER, "first alert of the level, s"),
                Result(f"alert_to_loss_s.{name}", NUMBER, "from it to loss of well clear, s"),
                Result(f"alert_to_nmac_s.{name}", NUMBER, "to a near mid-air collision, s"),
                Result(f"alert_missed.{name}", EVENT, "well clear lost without an alert before"),
                Result(f"alert_late.{name}", EVENT, "alert missed or shortly before the loss"),
                Result(f"alert_nuisance.{name}", EVENT, "alert, and well clear is never lost"),
                Result(f"alert_surprise.{name}", EVENT, "alert hardly after the level below it"),
            ]
        return found

    def measure(self, group: Group) -> Mapping[str, AnyArray]:
        """Return all of it for every replica."""
        told = self._told.of(group) if self.p.steered else None
        read = self.p.losses_s
        lost_s, nmac_s, _ = read_flights(
            group, self.p.step_s, self.p.target, read, told,
            to_the_end=self._as_flown,
        )  # fmt: skip
        columns = group.tables["alerts"]
        counts = of_target(columns, self.p.target)
        found: dict[str, AnyArray] = {}
        for name in self._blocks:
            mine = counts & is_named(columns["block"], name)
            first_s = _first_s(columns, mine & (columns["level"] >= self.p.level), len(group))
            below_s = _first_s(columns, mine & (columns["level"] >= self.p.level - 1), len(group))
            alerted, lost = ~np.isnan(first_s), ~np.isnan(lost_s)
            before = alerted & lost & (np.nan_to_num(first_s) <= np.nan_to_num(lost_s))
            lead_s = np.where(before, lost_s - first_s, np.nan)
            missed = lost & ~before
            found[f"first_alert_time_s.{name}"] = first_s
            found[f"alert_to_loss_s.{name}"] = lead_s
            found[f"alert_to_nmac_s.{name}"] = nmac_s - first_s
            sudden = alerted & (first_s - below_s < self.p.surprise_s) & (self.p.level > 1)
            for what, event in {
                "missed": missed,
                "late": missed | (before & (np.nan_to_num(lead_s) < self.p.late_s)),
                "nuisance": alerted & ~lost,
                "surprise": sudden,
            }.items():
                found[f"alert_{what}.{name}"] = event.astype(float)
        return found


def _first_s(columns: Mapping[str, Any], rows: BoolArray, replicas: int) -> FloatArray:
    """Return the time of each replica's first row of those chosen, NaN without one."""
    first = np.full(replicas, np.inf)
    np.minimum.at(first, columns["replica"][rows], columns["time_s"][rows])
    return np.where(np.isfinite(first), first, np.nan)
