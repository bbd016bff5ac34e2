"""An operator who answers alerts as pilots were measured to (``operator.stochastic``)."""

import math
from typing import Any

import numpy as np
from pydantic import Field

from components.alert_configuration.conf_parameters import ConfParameters
from components.guidance.way_out import changes_out
from components.messages.alerts import AlertLevels
from components.messages.steering import Manoeuvre, Manoeuvres
from components.operator.pilot_model import Draws, mean_pause_s, pause_s, response_s, steering
from dsa_des.block.component import Component
from dsa_des.block.ports import Input, Output
from dsa_des.block.wake import Wake


class StochasticParameters(ConfParameters):
    """Parameters of the operator."""

    level: int = Field(default=2, ge=1, description="Act when an alert is of this level or above.")
    held_s: float = Field(default=4.0, ge=0, description="How long it must have been so, s.")
    deterministic: bool = Field(
        default=False, description="Take the mean times and fixed sizes; draw nothing."
    )
    initial_delay_s: float = Field(
        default=5.0, ge=0, description="Mean time to react, exponential, s."
    )
    coordination_s: float = Field(
        default=11.0, ge=0, description="Mean time to coordinate with air traffic control, s."
    )
    execution_delay_s: float = Field(
        default=3.0, ge=0, description="Mean time to enter the manoeuvre, exponential, s."
    )
    warning_level: int = Field(
        default=3, ge=1, description="From this level on nobody coordinates (assumption)."
    )
    turn_share: float = Field(
        default=0.65, ge=0, le=1, description="Probability of a turn instead of a climb or descent."
    )
    turn_rate_deg_s: float = Field(default=3.0, gt=0, description="Rate of turns, deg/s.")
    vertical_rate_mps: float = Field(
        default=2.54, gt=0, description="Vertical speed of climbs and descents, m/s."
    )


class Stochastic(Component):
    """Answers alerts after a pilot's delays, by turns and climbs of a pilot's size.

    An alert that has held leads to a decision; after the time to react, to coordinate and to
    execute, the bands of that instant are flown out of. An alert that ends before calls it off. As
    long as it lasts the next decisions follow after a pause, and need the time to execute only. It
    acts at the instants at which the alerting speaks.
    """

    inputs = {"alerts": Input(AlertLevels, "trigger", "The alert level of each target.")}
    outputs = {"manoeuvres": Output(Manoeuvres, "What the ownship is told to fly.")}
    Parameters = StochasticParameters
    windowed = True
    rewindable = True

    def setup(self) -> None:
        """Read the configuration; start without an alert."""
        self._configuration, self._alerter = self.p.read()
        self._response, self._steering, self._pause = map(
            self.stream, ("response", "steering", "pause")
        )
        self._decisions = 0
        self._since: int | None = None
        self._acts_at: float | None = None
        self._free_from = 0.0
        self._has_acted = False

    def run(self, wake: Wake) -> Manoeuvres | None:
        """Follow the alerts, instant by instant."""
        alerts: AlertLevels | None = wake["alerts"]
        if alerts is None:
            return None
        ticks, told = [], []
        for place, tick in enumerate(wake.ticks.tolist()):
            entries = slice(int(alerts.offsets[place]), int(alerts.offsets[place + 1]))
            highest = int(np.max(alerts.level[entries], initial=0))
            if not self._acts_now(tick, highest):
                continue
            manoeuvre = self._manoeuvre(alerts, place, entries)
            if manoeuvre is not None:
                ticks.append(tick)
                told.append(manoeuvre)
        return Manoeuvres.of(ticks, told) if ticks else None

    def _acts_now(self, tick: int, highest: int) -> bool:
        """Take in the highest level of an instant, and tell whether the operator acts at it."""
        per_s = self.context.ticks_per_s
        if highest < self.p.level:
            self._since, self._acts_at, self._has_acted = None, None, False
            return False
        if self._since is None:
            self._since = tick
        held = tick - self._since >= self.p.held_s * per_s
        if self._acts_at is None and held and tick >= self._free_from:
            self._decisions += 1
            self._acts_at = tick + self._response_s(highest) * per_s
        if self._acts_at is None or tick < self._acts_at:
            return False
        self._acts_at, self._has_acted = None, True
        wait_s = mean_pause_s(highest)
        if not self.p.deterministic:
            wait_s = pause_s(highest, self._draw(self._pause, 0))
        self._free_from = tick + wait_s * per_s
        return True

    def _draw(self, stream: Any, number: int) -> float:
        """Return the draw of a number, of the latest decision."""
        return float(stream.uniform(np.uint64(0), np.int64(self._decisions), number))

    def _response_s(self, highest: int) -> float:
        initial_s, coordination_s = self.p.initial_delay_s, self.p.coordination_s
        if self._has_acted:
            initial_s = coordination_s = 0.0
        elif highest >= self.p.warning_level:
            coordination_s = 0.0
        draws = None
        if not self.p.deterministic:
            draws = np.array([self._draw(self._response, k) for k in range(3)])
        return response_s(draws, initial_s, coordination_s, self.p.execution_delay_s)

    def _manoeuvre(self, alerts: AlertLevels, place: int, entries: slice) -> Manoeuvre | None:
        draws, turns = None, self.p.turn_share >= 0.5
        if not self.p.deterministic:
            turns = self._draw(self._steering, 0) < self.p.turn_share
            draws = Draws(*(self._draw(self._steering, k) for k in (1, 2, 3)))
        # Who finds no way out by one kind tries the other.
        for by_turn in (turns, not turns):
            if 0.0 < self.p.turn_share < 1.0 or by_turn == turns:
                changes = changes_out(
                    "hdir" if by_turn else "alt", self._configuration, self._alerter,
                    alerts.own_motion, alerts.relative, place, entries, alerts.deviations,
                )  # fmt: skip
                change = 0.0 if changes is None else steering(changes, by_turn, draws)
                if change != 0.0:
                    return self._told(change, by_turn)
        return None

    def _told(self, change: float, by_turn: bool) -> Manoeuvre:
        if by_turn:
            return Manoeuvre(turn_rad=change, rate_rad_s=math.radians(self.p.turn_rate_deg_s))
        return Manoeuvre(climb_m=change, climb_rate_mps=self.p.vertical_rate_mps)
