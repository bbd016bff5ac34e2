"""Alert levels that count when enough of the last ones agree, and hold (``alerting.m_of_n``)."""

from dataclasses import replace

import numpy as np
from pydantic import Field, model_validator

from components.alerting.memory import LevelMemory, MemoryRule
from components.messages.alerts import MOST_LEVELS, AlertLevels, AlertsOffered
from dsa_des.block.component import Component, Input, Output, Parameters
from dsa_des.block.wake import Wake


class MOfNParameters(Parameters):
    """Parameters of a filter of alert levels."""

    m: int = Field(default=2, ge=1, description="So many of the last n levels raise an alert.")
    n: int = Field(default=4, ge=1, le=1000, description="Last levels that count.")
    hold_s: float = Field(
        default=4.0, ge=0, description="A level that rose less than this ago does not fall, s."
    )
    forget_s: float = Field(
        default=5.0, gt=0, description="Who was gone for longer than this is new, s."
    )

    @model_validator(mode="after")
    def _check_m_within_n(self) -> "MOfNParameters":
        if self.m > self.n:
            raise ValueError(f"m is {self.m}: it must be at most n, {self.n}")
        return self


class MOfNAlerts(Component):
    """Filters alert levels behind an alerting that remembers nothing.

    The m-th largest of the last n levels of a target counts, and one that rose does not fall for a
    while: the rule by which DAIDALUS remembers levels (RTCA DO-365), but outside it, so that no
    level takes an early alerting time because it is on. All else passes as it is.
    """

    inputs = {
        "alerts": Input(AlertLevels, "trigger", "The alert level of each target, unfiltered.")
    }
    outputs = {"alerts": Output(AlertLevels, "The same with filtered levels.")}
    Parameters = MOfNParameters
    remembers = ("_memory",)
    windowed = True
    lockstep = True

    def setup(self) -> None:
        """Start without memory."""
        self._memory = LevelMemory(MemoryRule(self.p.forget_s, self.p.hold_s, self.p.m, self.p.n))

    def offer(self, port: str) -> AlertsOffered | None:
        """Return the offer of the block whose alerts are filtered; None without one."""
        return next((p.offer for p in self.context.producers), None)

    def warnings(self) -> list[str]:
        """Return a warning where the m-of-n memory is too short to hold any level."""
        offered = self.offer("alerts")
        if offered is None or self.p.forget_s >= offered.period_s:
            return []
        return [
            f"forget_s is {self.p.forget_s:g} and the alerts come {offered.period_s:g} s apart: "
            "every one is new, and passes as it is"
        ]

    def run(self, wake: Wake) -> AlertLevels | None:
        """Filter every instant."""
        alerts: AlertLevels | None = wake["alerts"]
        if alerts is None:
            return None
        row = alerts.row_of_entries
        time_s, run = wake.time_s, wake.run
        due = alerts.level[:, np.newaxis] >= np.arange(1, MOST_LEVELS + 1)
        level = self._memory.update_levels(
            run[row], alerts.contact_numbers(), time_s[row], due, due
        )
        ends = wake.instants.last_position_of_runs
        self._memory.forget_absent(run[ends], time_s[ends])
        self._memory.forget_runs_before(wake.first_run)
        return replace(alerts, tick=wake.ticks, level=level)
