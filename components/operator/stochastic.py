"""A pilot as a random process (``operator.stochastic``), by the published `pilot_model`."""

import math
from collections.abc import Sequence
from typing import Any, Literal, NamedTuple, Self

import numpy as np
from pydantic import Field, model_validator

from components.flights.point_mass import LEAST_EASING_S
from components.guidance.daidalus import ConfParameters, changes_out_of_bands, explain_no_steering
from components.messages.alerts import AlertLevels
from components.messages.steering import SLOWEST_TURN_DEG_S, Manoeuvre, Manoeuvres
from components.operator.pilot_model import (
    Draws,
    commanded_change_out_of_band,
    decision_pause_s,
    mean_decision_pause_s,
    reaction_and_execution_delays_s,
)
from dsa_des.arrays.keyed_table import indices_by_occurrence
from dsa_des.arrays.types import BoolArray, FloatArray, IntArray
from dsa_des.block.component import Component, Input, Output
from dsa_des.block.ladder import Verified
from dsa_des.block.wake import Wake
from dsa_des.record.failure_counts import NO_COUNTS, counts_with_cases_added
from dsa_des.time.clock import ticks_to_nanoseconds


class StochasticParameters(ConfParameters):
    """Parameters of a stochastic pilot."""

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
    turn_rate_deg_s: float = Field(
        default=3.0, ge=SLOWEST_TURN_DEG_S, description="Rate of turns, deg/s."
    )
    vertical_rate_mps: float = Field(
        default=2.54, gt=0, description="Vertical speed of climbs and descents, m/s."
    )
    chooses: Literal["acting", "before_executing"] = Field(
        default="acting",
        description="By which bands: those of the instant of the manoeuvre, or those of when the "
        "time to execute begins; pauses then count from there.",
    )
    goes_beyond: bool = Field(
        default=True,
        description="Whether changes are larger than need be, by the model's sizes, or the least.",
    )
    track_step_deg: float = Field(
        default=0.0,
        ge=0,
        le=90,
        description="Turns lead to the nearest multiple of this as a track, deg; 0: to any.",
    )
    eases_deg: float = Field(
        default=0.0,
        ge=0,
        le=180,
        description="Within so much of the new track the rate of a turn falls in proportion, and "
        "the bank takes its time, deg; by default turns begin and end at once.",
    )

    @model_validator(mode="after")
    def _check_easing(self) -> Self:
        least_deg = LEAST_EASING_S * self.turn_rate_deg_s
        if 0.0 < self.eases_deg < least_deg:
            raise ValueError(
                f"eases_deg is {self.eases_deg:g}: it must be 0, or at least {least_deg:g}, "
                f"{LEAST_EASING_S:g} s at turn_rate_deg_s, or turns would not settle"
            )
        return self

    def ineffective_key_notes(self) -> list[str]:
        """Return a sentence where a rate belongs to manoeuvres that are never made."""
        said = super().ineffective_key_notes()
        if self.turn_share == 0.0:
            of_turns = "turn_rate_deg_s", "track_step_deg", "eases_deg"
            said += self.note_ineffective(*of_turns, because="turn_share is 0")
        if self.turn_share == 1.0:
            said += self.note_ineffective("vertical_rate_mps", because="turn_share is 1")
        return said


class Mind(NamedTuple):
    """State of one run's pilot: when alerts began, and when the pilot decides, chooses and acts."""

    run: int
    decisions: int = 0  # How many there were
    since: int | None = None  # Tick from which on there was an alert
    chooses_at: float | None = None  # Tick from which on it chooses the manoeuvre
    acts_at: float | None = None  # Tick from which on the latest decision is acted on
    chosen: Manoeuvre | None = None  # Before it is acted on
    free_from: float = 0.0  # Tick from which on there may be a next decision
    has_acted: bool = False  # Whether this alert was acted on already


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
    remembers = ("_minds", "_next", "_stuck")
    windowed = True
    lockstep = True
    verified = (
        Verified("delays, sides and sizes of manoeuvres", "the published distributions (R6)",
                 "2 % of the mean", "tests/alerting/test_pilot_model.py"),
        Verified("bands that are flown out of", "recorded output of DAIDALUS 2.0.4",
                 "regions equal, edges to 1e-8 of the unit",
                 "tests/guidance/test_bands_against_reference.py"),
    )  # fmt: skip
    rewindable = True

    @classmethod
    def may_climb(cls, parameters: StochasticParameters) -> bool:
        """Return whether the pilot can change the altitude: not if all manoeuvres are turns."""
        return parameters.turn_share < 1.0

    def setup(self) -> None:
        """Read the configuration; start without an alert."""
        self._configuration, self._alerter = self.p.read_configuration()
        self._response, self._steering, self._pause = map(
            self.stream, ("response", "steering", "pause")
        )
        #: By run.
        self._minds: dict[int, Mind] = {}
        #: From which tick on each has something to do while an alert lasts; infinity without one.
        self._next: FloatArray = np.empty(0)
        #: How often nothing led out, of how often it was to steer, by run.
        self._stuck = NO_COUNTS

    def failure_counts(self) -> dict[str, IntArray]:
        """Return by run how often the pilot had to steer but found no change leading clear."""
        return {"no change leads clear and the ownship is left alone": self._stuck}

    def warnings(self) -> list[str]:
        """Return a warning where the operator never steers, with the reason."""
        return explain_no_steering(
            self.p.level, self._configuration, self._alerter, self.context.producers
        )

    def run(self, wake: Wake) -> Manoeuvres | None:
        """Follow the alerts, instant by instant."""
        alerts: AlertLevels | None = wake["alerts"]
        if alerts is None:
            return None
        highest, runs = alerts.highest_levels(), wake.run
        choosing: list[tuple[int, Mind]] = []
        acting: list[tuple[int, int]] = []
        has_to_do = np.flatnonzero(self._may_change_state(wake, highest))
        for turn in indices_by_occurrence(
            runs[has_to_do]
        ):  # the first row of every run, then the next
            rows = has_to_do[turn]
            minds = [self._minds.get(run, Mind(run)) for run in runs[rows].tolist()]
            chooses, acts = self._update_minds(minds, wake.ticks[rows], highest[rows].tolist())
            for mind in minds:
                self._minds[mind.run], self._next[mind.run] = mind, self._earliest_change_tick(mind)
            choosing += [(int(rows[k]), minds[k]) for k in chooses]
            acting += [(int(rows[k]), minds[k].run) for k in acts]
        return Manoeuvres.at_rows(wake.instants, self._begin_manoeuvres(alerts, choosing, acting))

    def _may_change_state(self, wake: Wake, highest: IntArray) -> BoolArray:
        """Return a mask of the rows (True) at which the pilot's state may change."""
        missing = int(wake.run.max(initial=-1)) + 1 - len(self._next)
        self._next = np.concatenate([self._next, np.full(max(0, missing), np.inf)])
        alerted, due = highest >= self.p.level, self._next[wake.run]
        has_alert = due < np.inf
        if len(wake.instants.last_position_of_runs) < len(
            wake
        ):  # who is followed at one row is so later
            return np.isin(wake.run, wake.run[alerted | has_alert])
        return (alerted != has_alert) | (alerted & (wake.ticks >= due))

    def _earliest_change_tick(self, mind: Mind) -> float:
        """Return the first tick at which an alert may change the pilot's state; else infinite."""
        if mind.since is None:
            return math.inf
        if mind.acts_at is None:
            held = mind.since + self.p.held_s * self.context.ticks_per_s
            return math.floor(max(held, mind.free_from))
        return math.floor(mind.acts_at if mind.chooses_at is None else mind.chooses_at)

    def _begin_manoeuvres(
        self,
        alerts: AlertLevels,
        choosing: Sequence[tuple[int, Mind]],
        acting: Sequence[tuple[int, int]],
    ) -> dict[int, Manoeuvre]:
        """Return the manoeuvres that begin, by row; what is chosen and not begun is kept."""
        chosen = self._chosen_manoeuvres(alerts, choosing)
        latest: dict[int, Manoeuvre | None] = {}
        begins = sorted([(index, 0, mind.run) for index, mind in choosing]
                        + [(index, 1, run) for index, run in acting])  # fmt: skip
        sent = {}
        for index, acts, run in begins:
            if not acts:
                latest[run] = chosen.get(index)
            elif (told := latest.get(run, self._minds[run].chosen)) is not None:
                sent[index] = told
        for run, told in latest.items():
            self._minds[run] = self._minds[run]._replace(chosen=told)
        return sent

    def _update_minds(
        self, minds: list[Mind], ticks: IntArray, highest: Sequence[int]
    ) -> tuple[list[int], list[int]]:
        """Update one pilot per run in place by its highest alert level; return the indices of those
        who choose and of those who act now.
        """
        per_s, at = self.context.ticks_per_s, ticks.tolist()
        early = self.p.chooses == "before_executing"
        for k, mind in enumerate(minds):
            if highest[k] < self.p.level:
                minds[k] = mind._replace(since=None, chooses_at=None, acts_at=None, has_acted=False)
            elif mind.since is None:
                minds[k] = mind._replace(since=at[k])
        deciding = [k for k, mind in enumerate(minds) if self._decides(mind, at[k])]
        for k in deciding:
            minds[k] = minds[k]._replace(decisions=minds[k].decisions + 1)
        drawn = self._draw_uniforms(
            self._response, 3, [minds[k] for k in deciding], ticks[deciding]
        )
        for k, draws in zip(deciding, drawn, strict=True):
            waits_s, executes_s = self._response_s(minds[k], highest[k], draws)
            acts_at = at[k] + (waits_s + executes_s) * per_s
            chooses_at = at[k] + waits_s * per_s if early else acts_at
            minds[k] = minds[k]._replace(chooses_at=chooses_at, acts_at=acts_at)
        choosing = [
            k for k, mind in enumerate(minds)
            if mind.chooses_at is not None and at[k] >= mind.chooses_at
        ]  # fmt: skip
        drawn = self._draw_uniforms(self._pause, 1, [minds[k] for k in choosing], ticks[choosing])
        for k, draws in zip(choosing, drawn, strict=True):
            wait_s = (
                mean_decision_pause_s(highest[k])
                if draws is None
                else decision_pause_s(highest[k], draws[0])
            )
            minds[k] = minds[k]._replace(chooses_at=None, free_from=at[k] + wait_s * per_s)
        acting = [
            k for k, mind in enumerate(minds)
            if mind.chooses_at is None and mind.acts_at is not None and at[k] >= mind.acts_at
        ]  # fmt: skip
        for k in acting:
            minds[k] = minds[k]._replace(acts_at=None, has_acted=True)
        return choosing, acting

    def _decides(self, mind: Mind, tick: int) -> bool:
        """Return whether the pilot decides now: alert long enough, no pause or action pending."""
        if mind.since is None or mind.acts_at is not None:
            return False
        early = self.p.chooses == "before_executing"
        # A pause after a choice is over when it has passed, one after an act when it ends.
        free = tick > mind.free_from if early and mind.has_acted else tick >= mind.free_from
        return free and tick - mind.since >= self.p.held_s * self.context.ticks_per_s

    def _draw_uniforms(
        self, stream: Any, count: int, minds: Sequence[Mind], ticks: IntArray
    ) -> list[list[float]] | list[None]:
        """Return each pilot's `count` uniform numbers for the decision; None if deterministic."""
        if self.p.deterministic or not minds:
            return [None] * len(minds)
        decisions = np.array([mind.decisions for mind in minds], dtype=np.int64)
        runs = np.array([mind.run for mind in minds], dtype=np.int64)
        drawn = stream.of_runs(runs, ticks_to_nanoseconds(ticks, self.context.ticks_per_s))
        zero = np.zeros(len(minds), dtype=np.uint64)
        draws: list[list[float]] = np.stack(
            [drawn.uniform(zero, decisions, number) for number in range(count)], axis=-1
        ).tolist()
        return draws

    def _response_s(
        self, mind: Mind, highest: int, draws: Sequence[float] | None
    ) -> tuple[float, float]:
        initial_s, coordination_s = self.p.initial_delay_s, self.p.coordination_s
        if mind.has_acted:
            initial_s = coordination_s = 0.0
        elif highest >= self.p.warning_level:
            coordination_s = 0.0
        return reaction_and_execution_delays_s(
            draws, initial_s, coordination_s, self.p.execution_delay_s
        )

    def _chosen_manoeuvres(
        self, alerts: AlertLevels, acting: Sequence[tuple[int, Mind]]
    ) -> dict[int, Manoeuvre]:
        """Return the manoeuvres that pilots choose at given alert rows, by row; others omitted."""
        if not acting:
            return {}
        by_turn: dict[int, bool] = {}
        draws: dict[int, Draws | None] = {}
        minds, ticks = [mind for _, mind in acting], alerts.tick[[index for index, _ in acting]]
        drawn = self._draw_uniforms(self._steering, 4, minds, ticks)
        for (index, _), four in zip(acting, drawn, strict=True):
            by_turn[index], draws[index] = self.p.turn_share >= 0.5, None
            if four is not None:
                by_turn[index], draws[index] = four[0] < self.p.turn_share, Draws(*four[1:])
        result: dict[int, Manoeuvre] = {}
        needed: set[int] = set()
        # Who finds no way out by one kind tries the other.
        for first in (True, False) if 0.0 < self.p.turn_share < 1.0 else (True,):
            for is_turn in (True, False):
                rows = [
                    n for n, it in by_turn.items() if n not in result and (it == is_turn) == first
                ]
                if not rows:
                    continue
                kind = "hdir" if is_turn else "alt"
                every = changes_out_of_bands(kind, self._configuration, self._alerter, alerts, rows)
                for row, changes in zip(rows, every, strict=True):
                    change = 0.0
                    if changes is not None:
                        needed.add(row)
                        change = commanded_change_out_of_band(
                            changes, is_turn, draws[row], self.p.goes_beyond
                        )
                    if change != 0.0 and is_turn:
                        result[row] = self._turn(change, alerts, row)
                    elif change != 0.0:
                        result[row] = Manoeuvre(
                            climb_m=change, climb_rate_mps=self.p.vertical_rate_mps
                        )
        due = np.array(sorted(needed), dtype=np.int64)
        stuck = np.array([row not in result for row in due.tolist()], dtype=bool)
        self._stuck = counts_with_cases_added(self._stuck, alerts.run[due[stuck]], alerts.run[due])
        return result

    def _turn(self, change: float, alerts: AlertLevels, row: int) -> Manoeuvre:
        """Return the turn by a change (rad, positive right) from the track in an alert row."""
        own = alerts.own_motion
        track = math.atan2(float(own["east_mps"][row]), float(own["north_mps"][row]))
        track %= 2.0 * math.pi
        if step := math.radians(self.p.track_step_deg):
            change = step * round((track + change) / step) - track
        rate_rad_s = math.radians(self.p.turn_rate_deg_s)
        if not self.p.eases_deg:
            return Manoeuvre(turn_rad=change, rate_rad_s=rate_rad_s)
        return Manoeuvre(
            rate_rad_s=rate_rad_s,
            heading_rad=(track + change) % (2.0 * math.pi),
            eases_rad=math.radians(self.p.eases_deg),
        )
