"""An avoidance that flies out of the bands of guidance (``avoidance.daidalus``)."""

import math
from fractions import Fraction
from typing import Literal

import numpy as np
from pydantic import Field

from components.arguments.units import FOOT_M, STANDARD_GRAVITY_M_S2
from components.guidance.daidalus import (
    ConfParameters,
    changes_out_of_bands,
    explain_no_steering,
    smaller_change,
)
from components.messages.alerts import AlertLevels
from components.messages.steering import SLOWEST_TURN_DEG_S, ChosenSides, Manoeuvre, Manoeuvres
from dsa_des.arrays.types import IntArray
from dsa_des.block.component import Component, Input, NonNegativeRational, Output
from dsa_des.block.message import Message
from dsa_des.block.wake import Wake
from dsa_des.record.failure_counts import NO_COUNTS, counts_with_cases_added

_KINDS = {"turn": "hdir", "climb": "alt", "speed": "hs", "vertical_speed": "vs"}
# Where the configuration has manoeuvres take no time, they are flown so fast: 3 deg/s, 500 ft/min,
# 2 m/s² and a quarter of gravity.
_TURN_RATE_RAD_S = math.radians(3.0)
_VERTICAL_RATE_MPS = 500.0 * FOOT_M / 60.0
_ACCELERATION_MPS2, _VERTICAL_ACCELERATION_MPS2 = 2.0, 0.25 * STANDARD_GRAVITY_M_S2
# The address of who does not coordinate.
_NOBODY = -1


class TurnOutParameters(ConfParameters):
    """Parameters of turning out of a band."""

    level: int = Field(default=2, ge=1, description="Turn when an alert is of this level or above.")
    manoeuvre: Literal["turn", "climb", "speed", "vertical_speed"] = Field(
        default="turn",
        description="Whether to change direction, altitude, ground speed or vertical speed.",
    )
    beyond_deg: float = Field(
        default=0.0, ge=0, le=90, description="Turn so much beyond the edge of the band, deg."
    )
    beyond_m: float = Field(
        default=0.0, ge=0, le=3000, description="Climb or descend so much beyond its edge, m."
    )
    beyond_mps: float = Field(
        default=0.0, ge=0, le=50, description="Change speeds so much beyond their edge, m/s."
    )
    pause_s: NonNegativeRational = Field(
        default=Fraction(10), description="Shortest time from one manoeuvre to the next, s."
    )
    address: int | None = Field(
        default=None, ge=0, description="With an address it tells which side it has chosen, at "
        "every instant with an alert, whom that is of, and heeds what it is told: who chooses "
        "takes the side that goes with theirs, and of two that chose what does not, the higher "
        "address changes.",
    )  # fmt: skip
    heeds_s: NonNegativeRational = Field(
        default=Fraction(10), description="What another one has told counts for so long, s."
    )

    def ineffective_key_notes(self) -> list[str]:
        """Return a sentence for each key that is set but has no effect: of a manoeuvre not chosen,
        or heeds_s without an address.
        """
        used = {"turn": "beyond_deg", "climb": "beyond_m"}.get(self.manoeuvre, "beyond_mps")
        keys = {"beyond_deg", "beyond_m", "beyond_mps"} - {used}
        because = f"manoeuvre is '{self.manoeuvre}'"
        said = super().ineffective_key_notes() + self.note_ineffective(
            *sorted(keys), because=because
        )
        alone = self.note_ineffective("heeds_s", because="address is not given")
        return said if self.address is not None else said + alone


class TurnOut(Component):
    """When alerted, steers the ownship by the smallest manoeuvre that leads clear of conflicts.

    The change is one of direction, altitude, ground speed or vertical speed. The bands are those of
    DAIDALUS, each instant by itself, over all targets whose flights the alerting knows. Where no
    value is clear it goes towards the recovery band; without one it leaves the ownship alone. Whom
    an alert is of counts as known by its transponder, also behind a tracker.
    """

    inputs = {
        "alerts": Input(AlertLevels, "trigger", "The alert level of each target."),
        "told": Input(
            ChosenSides, "queued", "Which sides others have chosen.", required=False, many=True,
            between_platforms=True,
        ),
    }  # fmt: skip
    outputs = {
        "manoeuvres": Output(Manoeuvres, "What the ownship is told to fly."),
        "sides": Output(ChosenSides, "Which side it has chosen, where it has an address."),
    }
    Parameters = TurnOutParameters
    remembers = ("_free_from", "_stuck", "_heard", "_chosen")
    windowed = True
    lockstep = True
    rewindable = True

    @classmethod
    def may_climb(cls, parameters: TurnOutParameters) -> bool:
        """Return whether the block ever commands a climb, a descent or another altitude."""
        return parameters.manoeuvre in ("climb", "vertical_speed")

    def setup(self) -> None:
        """Read the configuration; start free to turn."""
        self._configuration, self._alerter = self.p.read_configuration()
        rate_deg_s = math.degrees(self._configuration["turn_rate"])
        if 0.0 < rate_deg_s < SLOWEST_TURN_DEG_S:
            raise ValueError(
                f"turn_rate of its configuration is {rate_deg_s:g} deg/s: it must be at least "
                f"{SLOWEST_TURN_DEG_S:g}, or 0 for 3"
            )
        self._pause_ticks = int(self.p.pause_s * self.context.ticks_per_s)
        #: By run, from when on it may turn again.
        self._free_from: dict[int, int] = {}
        #: How often nothing led out, of how often something had to.
        self._stuck = NO_COUNTS
        #: By run: what others have told (when, address, side), and which side it chose, and when.
        self._heard: dict[int, tuple[tuple[int, int, int], ...]] = {}
        self._chosen: dict[int, tuple[int, int]] = {}
        if self.p.address is None:
            return
        for producer in self.context.producers:
            if producer.port == "told" and producer.offer == self.p.address:
                raise ValueError(
                    f"address is {self.p.address}, and {producer.block} has the same: of two that "
                    "tell each other their sides one goes first; give each one of its own"
                )

    def records(self) -> list[type[Message]]:
        """Return the types to record: manoeuvres, and chosen sides if it has an address."""
        return [Manoeuvres] if self.p.address is None else [*super().records()]

    def offer(self, port: str) -> int | None:
        """Return the address of this aircraft, for coordination with the others."""
        return self.p.address

    def request(self, port: str) -> int | None:
        """Return this aircraft's address on port ``told``, for others' choices; None elsewhere."""
        return self.p.address if port == "told" else None

    def failure_counts(self) -> dict[str, IntArray]:
        """Return by message how often in each run a manoeuvre was needed but none led clear."""
        return {"no change leads clear and the ownship is left alone": self._stuck}

    def warnings(self) -> list[str]:
        """Return a warning where the block can never steer, with the reason."""
        return explain_no_steering(
            self.p.level, self._configuration, self._alerter, self.context.producers
        )

    def run(self, wake: Wake) -> dict[str, Message]:
        """Look at every instant with an alert."""
        alerts: AlertLevels | None = wake["alerts"]
        self._store_choices(wake)
        if alerts is None:
            return {}
        manoeuvres: dict[int, Manoeuvre] = {}
        alerted = np.flatnonzero(alerts.highest_levels() >= self.p.level)
        left = zip(alerted.tolist(), wake.run[alerted].tolist(), strict=True)
        waiting = list(left)
        told: dict[int, int] = {}
        kind = _KINDS[self.p.manoeuvre]
        while waiting:
            # The first row of every run at which it is free, and then on to the next ones.
            now: dict[int, int] = {}
            later = []
            for index, run in waiting:
                tick = int(wake.ticks[index])
                if run in now:
                    later.append((index, run))
                elif self._is_free_to_manoeuvre(run, tick) or self._must_give_way(run, tick):
                    now[run] = index
                elif self.p.address is not None:
                    told[index] = self._renewed_own_side(run, tick)
            rows = list(now.values())
            result = changes_out_of_bands(kind, self._configuration, self._alerter, alerts, rows)
            for (run, index), changes in zip(now.items(), result, strict=True):
                tick = int(wake.ticks[index])
                change = None if changes is None else self._choose_change(run, tick, changes)
                if changes is not None and self._is_free_to_manoeuvre(run, tick):
                    due = np.array([run])
                    self._stuck = counts_with_cases_added(self._stuck, due[: change is None], due)
                if change is not None:
                    manoeuvres[index] = self._manoeuvre_of_change(change)
                    self._free_from[run] = tick + self._pause_ticks
                    self._chosen[run] = tick, 1 if change > 0.0 else -1
                if self.p.address is not None:
                    told[index] = self._renewed_own_side(run, tick)
            waiting = later
        messages = {
            "manoeuvres": Manoeuvres.at_rows(wake.instants, manoeuvres),
            "sides": self._sides_for_others(wake, alerts, told) if any(told.values()) else None,
        }
        return {port: message for port, message in messages.items() if message is not None}

    def _sides_for_others(
        self, wake: Wake, alerts: AlertLevels, told: dict[int, int]
    ) -> ChosenSides | None:
        """Return the sides chosen at some rows, addressed to each aircraft an alert concerns."""
        address = {
            one.platform: one.request for one in self.context.consumers if one.port == "told"
        }
        of = np.array([address.get(name, _NOBODY) for name in (*alerts.roster.names, "")])
        meant_for = of[alerts.target]
        entries = np.flatnonzero((meant_for != _NOBODY) & (alerts.level >= self.p.level))
        side = np.zeros(len(alerts), dtype=np.int64)
        side[list(told)] = list(told.values())
        return ChosenSides.at_rows(
            wake.instants, self.p.address or 0, side, alerts.row_of_entries[entries],
            meant_for[entries],
        )  # fmt: skip

    def _store_choices(self, wake: Wake) -> None:
        """Store choices received from other aircraft and forget those no longer valid."""
        since = int(wake.ticks.min()) - int(self.p.heeds_s * self.context.ticks_per_s)
        for new in wake.arrivals("told") if self.p.address is not None else ():
            sides = new.message
            row = sides.row_of_entries
            columns = sides.run[row], new.tick[row], sides.address, sides.side, sides.meant_for
            for run, *one, meant_for in zip(*(of.tolist() for of in columns), strict=True):
                if meant_for != self.p.address:
                    continue
                known = [old for old in self._heard.get(run, ()) if old[0] > since]
                self._heard[run] = (*known, (one[0], one[1], one[2]))

    def _find_valid_choices(self, run: int, tick: int) -> list[tuple[int, int]]:
        """Return (address, side) of others whose choice is recent enough to be valid.

        The lowest address first; windows may know more than has come by then.
        """
        since = tick - int(self.p.heeds_s * self.context.ticks_per_s)
        last = {a: side for at, a, side in self._heard.get(run, ()) if since < at <= tick}
        return sorted(last.items())

    def _compatible_side(self, side: int) -> int:
        """Return the side compatible with another's choice: the same for turns, else opposite."""
        return side if self.p.manoeuvre == "turn" else -side

    def _renewed_own_side(self, run: int, tick: int) -> int:
        """Return the side chosen in this conflict, or 0, and note that it holds on from now."""
        at, side = self._chosen.get(run, (-1, 0))
        if not side or tick - at > int(self.p.heeds_s * self.context.ticks_per_s):
            return 0
        self._chosen[run] = tick, side
        return side

    def _is_free_to_manoeuvre(self, run: int, tick: int) -> bool:
        """Return whether the last manoeuvre is long enough ago for a new one to begin."""
        return tick >= self._free_from.get(run, 0)

    def _must_give_way(self, run: int, tick: int) -> bool:
        """Return whether an aircraft of lower address has chosen an incompatible side."""
        mine = self._renewed_own_side(run, tick) if self.p.address is not None else 0
        first = [
            side for a, side in self._find_valid_choices(run, tick) if a < (self.p.address or 0)
        ]
        return bool(mine and first and self._compatible_side(first[0]) != mine)

    def _choose_change(self, run: int, tick: int, changes: tuple[float, float]) -> float | None:
        """Return the change to fly: one compatible with others' choices, else the smaller, or None.

        Without a way there it is free, but not before its time.
        """
        others = self._find_valid_choices(run, tick) if self.p.address is not None else []
        if others:
            (address, side), mine = others[0], self._renewed_own_side(run, tick)
            # Only a lower address changes what was chosen in this conflict.
            keeps = mine and address > (self.p.address or 0)
            there = (
                changes[1] if (mine if keeps else self._compatible_side(side)) > 0 else changes[0]
            )
            if math.isfinite(there):
                return there
        return smaller_change(changes) if self._is_free_to_manoeuvre(run, tick) else None

    def _manoeuvre_of_change(self, change: float) -> Manoeuvre:
        """Return the manoeuvre (turn, climb or speed change) that carries out a change."""
        conf = self._configuration
        if self.p.manoeuvre == "climb":
            beyond_m = math.copysign(self.p.beyond_m, change)
            rate_mps = conf["vertical_rate"] or _VERTICAL_RATE_MPS
            return Manoeuvre(climb_m=change + beyond_m, climb_rate_mps=rate_mps)
        if self.p.manoeuvre in ("speed", "vertical_speed"):
            beyond = change + math.copysign(self.p.beyond_mps, change)
            if self.p.manoeuvre == "speed":
                acceleration = conf["horizontal_accel"] or _ACCELERATION_MPS2
                return Manoeuvre(speed_mps=beyond, acceleration_mps2=acceleration)
            acceleration = conf["vertical_accel"] or _VERTICAL_ACCELERATION_MPS2
            return Manoeuvre(vertical_speed_mps=beyond, vertical_acceleration_mps2=acceleration)
        away = min(abs(change) + math.radians(self.p.beyond_deg), math.pi)
        rate_rad_s = conf["turn_rate"] or _TURN_RATE_RAD_S
        return Manoeuvre(turn_rad=math.copysign(away, change), rate_rad_s=rate_rad_s)
