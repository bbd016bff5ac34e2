"""Consoles of operators, and a person at one (``operator.human``) under ``dsa-des cdti``."""

import math
import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, ClassVar, Literal, NamedTuple

import numpy as np
from pydantic import Field

from components.messages.alerts import AlertLevels, contact_name
from components.messages.decisions import CLIMB, TURN, Decisions, OperatorDecision
from components.messages.steering import SLOWEST_TURN_DEG_S, Manoeuvre, Manoeuvres
from dsa_des.block.component import ClockedParameters, Component, Input, Output, PositiveRational
from dsa_des.block.message import Message
from dsa_des.block.wake import Arrivals, Wake

#: Largest commands, and those below which there is nothing to fly.
MOST_TURN_RAD, MOST_CLIMB_M = math.pi, 3000.0
_LEAST_TURN_RAD, _LEAST_CLIMB_M = 1e-4, 0.01


class ConsoleParameters(ClockedParameters):
    """Parameters of a console."""

    scan_rate_hz: PositiveRational = Field(
        default=Fraction(50), description="How often decisions are taken in, 1/s."
    )
    turn_rate_deg_s: float = Field(
        default=3.0, ge=SLOWEST_TURN_DEG_S, description="Rate of turns, deg/s."
    )
    vertical_rate_mps: float = Field(
        default=2.54, gt=0, description="Vertical speed of climbs and descents, m/s."
    )


class _Alert(NamedTuple):
    """An active alert: its level, and the tick at which it began."""

    level: int
    tick: int


class Taken(NamedTuple):
    """When a decision was accepted, its turn or climb ends, and a replaced one was accepted, s."""

    time_s: float
    ends_s: float = math.nan  # When a turn or a climb is flown; NaN for others
    # When a command of the same kind was taken in that is still being flown; NaN without one
    replaces_s: float = math.nan


class Console(Component):
    """Turns decisions into messages; subclasses say which decisions there are."""

    inputs = {"alerts": Input(AlertLevels, "queued", "The alert level of each target.")}
    outputs = {
        "decisions": Output(Decisions, "What the operator decided."),
        "manoeuvres": Output(Manoeuvres, "What the ownship is told to fly."),
    }
    Parameters: ClassVar[Any] = ConsoleParameters

    def setup(self) -> None:
        """Start without an alert."""
        self._alerts: dict[str, _Alert] = {}
        self._targets: tuple[str, ...] = ()
        #: The last turn and the last climb, by kind.
        self._told: dict[int, Taken] = {}

    def due_decisions(self, wake: Wake) -> Sequence[tuple[int, OperatorDecision]]:
        """Return the decisions due at the scans of this call, as (tick, decision) in order."""
        raise NotImplementedError

    def run(self, wake: Wake) -> Mapping[str, Message] | None:
        """Send what was decided."""
        came = list(wake.arrivals("alerts"))
        index = 0
        made = []
        for tick, decision in self.due_decisions(wake):
            index = self._apply_alerts_until_tick(came, index, tick)
            taken = self._schedule_command(tick / self.context.ticks_per_s, decision)
            made.append((tick, decision, self._alerts.get(decision.target), taken))
        self._apply_alerts_until_tick(came, index, None)
        if not made:
            return None
        sent = self._messages(made)
        self.acknowledge([taken for *_, taken in made])
        return sent

    def acknowledge(self, taken: Sequence[Taken]) -> None:
        """Tell the senders of the due decisions, in the same order, how each was accepted."""

    def _schedule_command(self, time_s: float, decision: OperatorDecision) -> Taken:
        """Return when a decision was accepted, its manoeuvre's end, and which one it replaces.

        A turn replaces a turn and a climb a climb; one of each is flown at the same time.
        """
        if not _is_manoeuvre(decision):
            return Taken(time_s)
        flown = self._manoeuvre(decision)
        if decision.kind == TURN:
            lasts_s = abs(flown.turn_rad) / flown.rate_rad_s
        else:
            lasts_s = abs(flown.climb_m) / flown.climb_rate_mps
        before = self._told.get(decision.kind)
        replaces = before is not None and time_s < before.ends_s
        taken = Taken(time_s, time_s + lasts_s, before.time_s if before and replaces else math.nan)
        self._told[decision.kind] = taken
        return taken

    def _apply_alerts_until_tick(self, came: list[Arrivals], row: int, until: int | None) -> int:
        """Update active alerts from row `row` to tick `until` (None: end); return the next row."""
        for arrived in came:  # one wire
            alerts: AlertLevels = arrived.message
            rows = len(alerts)
            if until is not None:
                rows = int(np.searchsorted(arrived.tick, until, side="right"))
            for index in range(row, rows):
                entries = slice(int(alerts.offsets[index]), int(alerts.offsets[index + 1]))
                self._alerts = self._active_alerts(alerts, entries, int(arrived.tick[index]))
            row = max(row, rows)
        return row

    def _active_alerts(self, alerts: AlertLevels, entries: slice, tick: int) -> dict[str, _Alert]:
        """Return active alerts by contact name after one row, each with its beginning tick."""
        now = {}
        level, contacts = alerts.level[entries], alerts.contact_numbers()[entries]
        for index in np.flatnonzero(level > 0).tolist():
            name = contact_name(alerts.roster.names, int(contacts[index])) or ""
            began = self._alerts.get(name)
            now[name] = _Alert(int(level[index]), tick if began is None else began.tick)
        return now

    def _messages(
        self, made: list[tuple[int, OperatorDecision, _Alert | None, Taken]]
    ) -> dict[str, Message]:
        per_s = self.context.ticks_per_s
        known = dict.fromkeys([*self._targets, *(d.target for _, d, *_ in made if d.target)])
        self._targets = tuple(known)
        code = {name: index for index, name in enumerate(self._targets)}
        ticks = np.array([tick for tick, *_ in made], dtype=np.int64)
        began = np.array([math.nan if a is None else a.tick / per_s for _, _, a, _ in made])
        decisions = Decisions(
            ticks,
            np.array([d.kind for _, d, *_ in made], dtype=np.int64),
            np.array([code.get(d.target, -1) for _, d, *_ in made], dtype=np.int64),
            np.array([d.turn_rad for _, d, *_ in made]),
            np.array([d.climb_m for _, d, *_ in made]),
            np.array([0 if a is None else a.level for _, _, a, _ in made], dtype=np.int64),
            began,
            ticks / per_s - began,
            np.array([d.wall_time_s for _, d, *_ in made]),
            np.array([taken.replaces_s for *_, taken in made]),
            self._targets,
        )
        flown = [(tick, self._manoeuvre(d)) for tick, d, *_ in made if _is_manoeuvre(d)]
        if not flown:
            return {"decisions": decisions}
        manoeuvres = Manoeuvres.of([tick for tick, _ in flown], [one for _, one in flown])
        return {"decisions": decisions, "manoeuvres": manoeuvres}

    def _manoeuvre(self, decision: OperatorDecision) -> Manoeuvre:
        if decision.kind == TURN:
            rate_rad_s = math.radians(self.p.turn_rate_deg_s)
            return Manoeuvre(turn_rad=decision.turn_rad, rate_rad_s=rate_rad_s)
        return Manoeuvre(climb_m=decision.climb_m, climb_rate_mps=self.p.vertical_rate_mps)


def _is_manoeuvre(decision: OperatorDecision) -> bool:
    if decision.kind == TURN:
        return abs(decision.turn_rad) >= _LEAST_TURN_RAD
    return decision.kind == CLIMB and abs(decision.climb_m) >= _LEAST_CLIMB_M


#: A person does not decide so often between two scans; who floods the desk is refused.
MOST_WAITING = 32


@dataclass(frozen=True)
class PendingDecision:
    """A decision that waits on the desk, and the function to call when it is accepted."""

    decision: OperatorDecision
    taken: Callable[[Taken], None]  # From the thread of the simulation


class Desk:
    """Queue of decisions; one thread adds them, the thread of the simulation removes them."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._waiting: list[PendingDecision] = []
        self._open = True

    def submit(self, pending: PendingDecision) -> bool:
        """Queue a decision; return True if added, False if the run is over or too many wait."""
        with self._lock:
            if not self._open or len(self._waiting) >= MOST_WAITING:
                return False
            self._waiting.append(pending)
            return True

    def take(self, time_s: float) -> list[PendingDecision]:
        """Return and remove all waiting decisions, at an instant of the simulation."""
        with self._lock:
            result, self._waiting = self._waiting, []
        return result

    def close(self) -> list[PendingDecision]:
        """Close the queue and return the decisions that were never accepted."""
        with self._lock:
            self._open = False
            result, self._waiting = self._waiting, []
        return result


class HumanParameters(ConsoleParameters):
    """Parameters of a console with a person at it."""

    unattended: Literal["goes on", "pauses"] = Field(
        default="goes on",
        description="What the run does while no operator's page is connected.",
    )


class Human(Console):
    """Takes in what a person decides, at the instant at which the decision comes.

    Decisions come from a `Desk`, which ``dsa-des cdti`` puts there; without one, in
    ``dsa-des run`` and in studies, nobody sits at the console and nothing is decided.
    """

    Parameters = HumanParameters
    #: Set by the program that has a person at hand.
    desk: Desk | None = None
    _taken: Sequence[PendingDecision] = ()

    def due_decisions(self, wake: Wake) -> Sequence[tuple[int, OperatorDecision]]:
        """Remove and return the desk's waiting decisions, each with this call's latest tick."""
        if self.desk is None:
            return []
        tick = int(wake.ticks[-1])
        self._taken = self.desk.take(tick / self.context.ticks_per_s)
        return [(tick, pending.decision) for pending in self._taken]

    def acknowledge(self, taken: Sequence[Taken]) -> None:
        """Report to the sender of each decision when it was accepted and what it replaces."""
        for pending, one in zip(self._taken, taken, strict=True):
            pending.taken(one)

    def warnings(self) -> list[str]:
        """Warn that no operator is connected."""
        if self.desk is not None:
            return []
        return ["nobody is at the console and nothing is decided: dsa-des cdti puts a person there"]
