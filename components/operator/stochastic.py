"""A pilot as a random process (``operator.stochastic``): delays and steering of a published model.

Numbers are those of release 6 of MIT Lincoln Laboratory's pilot model of its encounter simulation
(DEGAS), of which R. Guendel, M. Kuffner and D. Maki, "A model of unmanned aircraft pilot detect and
avoid maneuver decisions", MIT Lincoln Laboratory, ATC-434, 2017, tells how they were measured.
"""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from pydantic import Field

from components.guidance.daidalus import ConfParameters, changes_out
from components.messages.alerts import AlertLevels
from components.messages.steering import SLOWEST_TURN_DEG_S, Manoeuvre, Manoeuvres
from dsa_des.arrays.types import FloatArray
from dsa_des.block.component import Component, Input, Output
from dsa_des.block.ladder import Verified
from dsa_des.block.wake import Wake
from dsa_des.time.timeline import first_scan

#: Shape of the time that coordination with air traffic control takes, a gamma distribution.
COORDINATION_SHAPE = 5.5
#: With two ways out that differ by more, rad, the smaller change is always taken.
CLEARLY_SMALLER_RAD = math.radians(40.0)
#: Otherwise it is taken with this probability, and where not: left, and down, with these.
FOLLOWS_SMALLER, LEFT, DESCENDS = 0.8, 0.6, 0.5
_FOOT_M = 0.3048
_DEGREE = math.pi / 180.0


class Excess(NamedTuple):
    """How far beyond the least change a pilot steers: a gamma distribution, shifted."""

    shape: float
    scale: float  # What is drawn is multiplied by the one, and lessened by the other
    less: float
    fixed: float  # Of the deterministic pilot


TURN = Excess(6.21, 9.67 * _DEGREE, 30.0 * _DEGREE, 30.0 * _DEGREE)
TURN_OTHER_SIDE = Excess(5.47, 8.25 * _DEGREE, 30.0 * _DEGREE, 15.0 * _DEGREE)
CLIMB = Excess(9.73, 207.98 * _FOOT_M, 1500.0 * _FOOT_M, 500.0 * _FOOT_M)

# Least time to the next decision and the mean of what comes on top, s: without an alert, then by
# level 1 (preventive), 2 (corrective), 3 (warning).
_PAUSES = ((12.0, 12.0), (9.0, 6.0), (6.0, 3.0), (6.0, 3.0))


def exponential(uniform: float, mean: float) -> float:
    """Return a draw of the exponential distribution from one in [0, 1)."""
    return -mean * math.log1p(-uniform)


def gamma(uniform: float, shape: float, scale: float) -> float:
    """Return a draw of the gamma distribution from one in [0, 1)."""
    from scipy.special import gammaincinv  # only who draws pays for its import

    return float(scale * gammaincinv(shape, uniform))


def pause_s(level: int, uniform: float) -> float:
    """Return how long a pilot waits before deciding again."""
    least, mean = _PAUSES[min(max(level, 0), len(_PAUSES) - 1)]
    return least + exponential(uniform, mean)


def mean_pause_s(level: int) -> float:
    """Return the mean of `pause_s`."""
    least, mean = _PAUSES[min(max(level, 0), len(_PAUSES) - 1)]
    return least + mean


class Draws(NamedTuple):
    """What is drawn for one steering decision, each in [0, 1)."""

    follows: float
    side: float
    size: float


def steering(changes: tuple[float, float], turns: bool, draws: Draws | None) -> float:
    """Return the change that a pilot makes, of the sign of its side."""
    low, high = changes
    if math.isinf(low) and math.isinf(high):
        return 0.0
    smaller_is_high = high <= -low
    to_high = smaller_is_high
    if draws is not None and math.isfinite(low) and math.isfinite(high):
        clear = turns and abs(high + low) > CLEARLY_SMALLER_RAD
        if not clear and draws.follows >= FOLLOWS_SMALLER:
            to_high = draws.side >= (LEFT if turns else DESCENDS)
    excess = CLIMB
    if turns:
        excess = TURN if to_high == smaller_is_high else TURN_OTHER_SIDE
    beyond = excess.fixed
    if draws is not None:
        beyond = gamma(draws.size, excess.shape, excess.scale) - excess.less
    size = max((high if to_high else -low) + beyond, 0.0)
    if turns:
        size = min(size, math.pi)
    return size if to_high else -size


def response_s(
    uniforms: FloatArray | None, initial_s: float, coordination_s: float, execution_s: float
) -> float:
    """Return how long a pilot takes from the decision to act until the manoeuvre begins."""
    if uniforms is None:
        return initial_s + coordination_s + execution_s
    first, second, third = np.asarray(uniforms, dtype=np.float64).tolist()
    found = exponential(first, initial_s) + exponential(third, execution_s)
    if coordination_s > 0.0:
        found += gamma(second, COORDINATION_SHAPE, coordination_s / COORDINATION_SHAPE)
    return found


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
    turn_rate_deg_s: float = Field(
        default=3.0, ge=SLOWEST_TURN_DEG_S, description="Rate of turns, deg/s."
    )
    vertical_rate_mps: float = Field(
        default=2.54, gt=0, description="Vertical speed of climbs and descents, m/s."
    )

    def without_effect(self) -> list[str]:
        """Say which rate belongs to manoeuvres that are never made."""
        said = super().without_effect()
        if self.turn_share == 0.0:
            said += self.idle("turn_rate_deg_s", because="turn_share is 0")
        if self.turn_share == 1.0:
            said += self.idle("vertical_rate_mps", because="turn_share is 1")
        return said


class Mind(NamedTuple):
    """What an operator has in mind, in one replica."""

    replica: int
    decisions: int = 0  # How many there were
    since: int | None = None  # Tick from which on there was an alert
    acts_at: float | None = None  # Tick from which on the latest decision is acted on
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

    def setup(self) -> None:
        """Read the configuration; start without an alert."""
        self._configuration, self._alerter = self.p.read()
        self._response, self._steering, self._pause = map(
            self.stream, ("response", "steering", "pause")
        )
        #: By replica.
        self._minds: dict[int, Mind] = {}

    def run(self, wake: Wake) -> Manoeuvres | None:
        """Follow the alerts, instant by instant."""
        alerts: AlertLevels | None = wake["alerts"]
        if alerts is None:
            return None
        highest, replica = alerts.highest(), wake.replica
        own_ticks = wake.own_ticks(wake.ticks)
        # Without an alert, now or before, there is nothing to do.
        alerted = highest >= self.p.level
        busy = [run for run, mind in self._minds.items() if mind.since is not None]
        followed = np.isin(replica, np.union1d(replica[alerted], np.array(busy, dtype=np.int64)))
        acting: list[tuple[int, Mind]] = []
        for place in np.flatnonzero(followed).tolist():
            run = int(replica[place])
            mind = self._minds.get(run, Mind(run))
            mind, acts = self._followed(mind, int(own_ticks[place]), int(highest[place]))
            self._minds[run] = mind
            if acts:
                acting.append((place, mind))
        manoeuvres = self._manoeuvres_at(alerts, acting)
        return Manoeuvres.at_rows(wake.ticks, manoeuvres)

    def _followed(self, mind: Mind, tick: int, highest: int) -> tuple[Mind, bool]:
        """Take in the highest level of an instant; return also whether the operator acts at it."""
        per_s = self.context.ticks_per_s
        if highest < self.p.level:
            return mind._replace(since=None, acts_at=None, has_acted=False), False
        since = tick if mind.since is None else mind.since
        mind = mind._replace(since=since)
        held = tick - since >= self.p.held_s * per_s
        if mind.acts_at is None and held and tick >= mind.free_from:
            mind = mind._replace(decisions=mind.decisions + 1)
            mind = mind._replace(acts_at=tick + self._response_s(mind, highest) * per_s)
        if mind.acts_at is None or tick < mind.acts_at:
            return mind, False
        wait_s = mean_pause_s(highest)
        if not self.p.deterministic:
            wait_s = pause_s(highest, self._draw(mind, self._pause, 0))
        return mind._replace(acts_at=None, has_acted=True, free_from=tick + wait_s * per_s), True

    def _draw(self, mind: Mind, stream: Any, number: int) -> float:
        """Return the draw of a number, of the latest decision."""
        decision = np.int64(first_scan(mind.replica) + mind.decisions)
        return float(stream.uniform(np.uint64(0), decision, number))

    def _response_s(self, mind: Mind, highest: int) -> float:
        initial_s, coordination_s = self.p.initial_delay_s, self.p.coordination_s
        if mind.has_acted:
            initial_s = coordination_s = 0.0
        elif highest >= self.p.warning_level:
            coordination_s = 0.0
        draws = None
        if not self.p.deterministic:
            draws = np.array([self._draw(mind, self._response, k) for k in range(3)])
        return response_s(draws, initial_s, coordination_s, self.p.execution_delay_s)

    def _manoeuvres_at(
        self, alerts: AlertLevels, acting: Sequence[tuple[int, Mind]]
    ) -> dict[int, Manoeuvre]:
        """Return what operators who act at some rows of the alerts steer, by row."""
        by_turn: dict[int, bool] = {}
        draws: dict[int, Draws | None] = {}
        for place, mind in acting:
            by_turn[place], draws[place] = self.p.turn_share >= 0.5, None
            if not self.p.deterministic:
                by_turn[place] = self._draw(mind, self._steering, 0) < self.p.turn_share
                draws[place] = Draws(*(self._draw(mind, self._steering, k) for k in (1, 2, 3)))
        found: dict[int, Manoeuvre] = {}
        # Who finds no way out by one kind tries the other.
        for first in (True, False) if 0.0 < self.p.turn_share < 1.0 else (True,):
            for turns in (True, False):
                rows = [n for n, it in by_turn.items() if n not in found and (it == turns) == first]
                if not rows:
                    continue
                kind = "hdir" if turns else "alt"
                every = changes_out(kind, self._configuration, self._alerter, alerts, rows)
                for row, changes in zip(rows, every, strict=True):
                    change = 0.0 if changes is None else steering(changes, turns, draws[row])
                    if change != 0.0:
                        found[row] = self._told(change, turns)
        return found

    def _told(self, change: float, by_turn: bool) -> Manoeuvre:
        if by_turn:
            return Manoeuvre(turn_rad=change, rate_rad_s=math.radians(self.p.turn_rate_deg_s))
        return Manoeuvre(climb_m=change, climb_rate_mps=self.p.vertical_rate_mps)
