"""An avoidance that flies out of the bands of guidance (``avoidance.daidalus``)."""

import math
from fractions import Fraction
from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from components.arguments.units import FOOT_M, STANDARD_GRAVITY_M_S2
from components.guidance.daidalus import (
    ConfParameters,
    changes_out_of_bands,
    explain_no_steering,
    smaller,
)
from components.messages.alerts import AlertLevels
from components.messages.detections import describe_rangeless
from components.messages.steering import (
    SLOWEST_TURN_DEG_S,
    ChosenSides,
    Manoeuvre,
    Manoeuvres,
)
from components.messages.tracks import Tracks
from dsa_des.arrays.run_ticks import take_runs
from dsa_des.arrays.types import IntArray
from dsa_des.block.component import Component, Input, NonNegativeRational, Output, Parameters
from dsa_des.block.message import Message
from dsa_des.block.wake import Wake
from dsa_des.record.failure_counts import NO_COUNTS, count_cases

_KINDS = {"turn": "hdir", "climb": "alt", "speed": "hs", "vertical_speed": "vs"}
# Where the configuration has manoeuvres take no time, they are flown so fast: 3 deg/s, 500 ft/min,
# 2 m/s² and a quarter of gravity.
_TURN_RATE_RAD_S = math.radians(3.0)
_VERTICAL_RATE_MPS = 500.0 * FOOT_M / 60.0
_ACCELERATION_MPS2, _VERTICAL_ACCELERATION_MPS2 = 2.0, 0.25 * STANDARD_GRAVITY_M_S2


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
        "every instant with an alert, and heeds what others tell: who chooses takes the side that "
        "goes with theirs, and of two that chose what does not, the higher address changes.",
    )  # fmt: skip
    heeds_s: NonNegativeRational = Field(
        default=Fraction(10), description="What another one has told counts for so long, s."
    )

    def ineffective_key_notes(self) -> list[str]:
        """Return a sentence for each key of a manoeuvre that is not chosen."""
        used = {"turn": "beyond_deg", "climb": "beyond_m"}.get(self.manoeuvre, "beyond_mps")
        keys = {"beyond_deg", "beyond_m", "beyond_mps"} - {used}
        because = f"manoeuvre is '{self.manoeuvre}'"
        said = super().ineffective_key_notes() + self.note_ineffective(
            *sorted(keys), because=because
        )
        alone = self.note_ineffective("heeds_s", because="address is not given")
        return said if self.address is not None else said + alone


class TurnOut(Component):
    """Steers the ownship by the smallest change that leads clear, when an alert is due.

    The change is one of direction, altitude, ground speed or vertical speed. The bands are those of
    DAIDALUS, each instant by itself, over all targets whose flights the alerting knows. Where no
    value is clear it goes towards the recovery band; without one it leaves the ownship alone.
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
        """Return whether it ever commands another altitude."""
        return parameters.manoeuvre in ("climb", "vertical_speed")

    def setup(self) -> None:
        """Read the configuration; start free to turn."""
        self._configuration, self._alerter = self.p.read()
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
        """Return the recorded message types: chosen sides only where they are sent."""
        return [Manoeuvres] if self.p.address is None else [*super().records()]

    def offer(self, port: str) -> int | None:
        """Return the address of this aircraft, for coordination with the others."""
        return self.p.address

    def failure_counts(self) -> dict[str, IntArray]:
        """Return how often it was to steer, and no change led clear."""
        return {"no change leads clear and the ownship is left alone": self._stuck}

    def warnings(self) -> list[str]:
        """Return a warning where the block can never steer, with the reason."""
        return explain_no_steering(
            self.p.level, self._configuration, self._alerter, self.context.producers
        )

    def run(self, wake: Wake) -> dict[str, Message]:
        """Look at every instant with an alert."""
        alerts: AlertLevels | None = wake["alerts"]
        self._take_choices(wake)
        if alerts is None:
            return {}
        manoeuvres: dict[int, Manoeuvre] = {}
        alerted = np.flatnonzero(alerts.highest() >= self.p.level)
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
                elif self._is_free(run, tick) or self._must_give_way(run, tick):
                    now[run] = index
                elif self.p.address is not None:
                    told[index] = self._repeated_side(run, tick)
            rows = list(now.values())
            result = changes_out_of_bands(kind, self._configuration, self._alerter, alerts, rows)
            for (run, index), changes in zip(now.items(), result, strict=True):
                tick = int(wake.ticks[index])
                change = None if changes is None else self._choose(run, tick, changes)
                if changes is not None and self._is_free(run, tick):
                    due = np.array([run])
                    self._stuck = count_cases(self._stuck, due[: change is None], due)
                if change is not None:
                    manoeuvres[index] = self._manoeuvre(change)
                    self._free_from[run] = tick + self._pause_ticks
                    self._chosen[run] = tick, 1 if change > 0.0 else -1
                if self.p.address is not None:
                    told[index] = self._repeated_side(run, tick)
            waiting = later
        messages = {
            "manoeuvres": Manoeuvres.at_rows(wake.instants, manoeuvres),
            "sides": ChosenSides.at_rows(wake.instants, self.p.address or 0, told),
        }
        return {port: message for port, message in messages.items() if message is not None}

    def _take_choices(self, wake: Wake) -> None:
        """Store the latest manoeuvre choice of each other aircraft."""
        since = int(wake.ticks.min()) - int(self.p.heeds_s * self.context.ticks_per_s)
        for new in wake.arrivals("told") if self.p.address is not None else ():
            sides = new.message
            columns = sides.run, new.tick, sides.address, sides.side
            for run, *one in zip(*(of.tolist() for of in columns), strict=True):
                known = [old for old in self._heard.get(run, ()) if old[0] > since]
                self._heard[run] = (*known, (one[0], one[1], one[2]))

    def _find_valid_choices(self, run: int, tick: int) -> list[tuple[int, int]]:
        """Return address and side of every other aircraft whose choice is valid at an instant.

        The lowest address first; windows may know more than has come by then.
        """
        since = tick - int(self.p.heeds_s * self.context.ticks_per_s)
        last = {a: side for at, a, side in self._heard.get(run, ()) if since < at <= tick}
        return sorted(last.items())

    def _matching_side(self, side: int) -> int:
        """Return the side that goes with another one's: both to the right, one up and one down."""
        return side if self.p.manoeuvre == "turn" else -side

    def _repeated_side(self, run: int, tick: int) -> int:
        """Return the side that was chosen in this conflict, which an alert prolongs; 0: none."""
        at, side = self._chosen.get(run, (-1, 0))
        if not side or tick - at > int(self.p.heeds_s * self.context.ticks_per_s):
            return 0
        self._chosen[run] = tick, side
        return side

    def _is_free(self, run: int, tick: int) -> bool:
        """Return whether the last manoeuvre is long enough ago to begin another."""
        return tick >= self._free_from.get(run, 0)

    def _must_give_way(self, run: int, tick: int) -> bool:
        """Return whether an aircraft of lower address has chosen a manoeuvre that conflicts."""
        mine = self._repeated_side(run, tick) if self.p.address is not None else 0
        first = [
            side for a, side in self._find_valid_choices(run, tick) if a < (self.p.address or 0)
        ]
        return bool(mine and first and self._matching_side(first[0]) != mine)

    def _choose(self, run: int, tick: int, changes: tuple[float, float]) -> float | None:
        """Return the change to fly: the smaller one, or the one compatible with the others'
        choices.

        Without a way there it is free, but not before its time.
        """
        others = self._find_valid_choices(run, tick) if self.p.address is not None else []
        if others:
            (address, side), mine = others[0], self._repeated_side(run, tick)
            # Only a lower address changes what was chosen in this conflict.
            keeps = mine and address > (self.p.address or 0)
            there = changes[1] if (mine if keeps else self._matching_side(side)) > 0 else changes[0]
            if math.isfinite(there):
                return there
        return smaller(changes) if self._is_free(run, tick) else None

    def _manoeuvre(self, change: float) -> Manoeuvre:
        """Return the manoeuvre that makes a change."""
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


class TurnAwayParameters(Parameters):
    """Parameters of turning away."""

    may_change: ClassVar[tuple[str, ...]] = ("range_km", "turn_deg", "pause_s")

    range_km: float = Field(default=5.0, gt=0, description="Turn for tracks nearer than this, km.")
    without_range: bool = Field(
        default=False,
        description="Turn for tracks without a range too, as those of cameras and eyes are, after "
        "any that are in range.",
    )
    turn_deg: float = Field(
        default=30.0, gt=0, le=180, description="Change of heading, away from the nearest, deg."
    )
    rate_deg_s: float = Field(
        default=3.0, ge=SLOWEST_TURN_DEG_S, description="Rate of turn, deg/s."
    )
    bank_deg: float | None = Field(
        default=None,
        gt=0,
        le=75,
        description="Bank in place of a rate, deg: the turn is as fast as the speed lets it be.",
    )
    roll_rate_deg_s: float | None = Field(
        default=None,
        ge=0.5,
        le=360,
        description="Rate at which the bank is built up, deg/s; by default it is there at once. "
        "The turn ends at once in either case.",
    )
    direction: Literal["away", "towards", "left", "right"] = Field(
        default="away",
        description="Away from the side of the nearest, towards it (behind a crossing one), "
        "or always the same way.",
    )
    pause_s: NonNegativeRational = Field(
        default=Fraction(60), description="Shortest time from one manoeuvre to the next, s."
    )

    def ineffective_key_notes(self) -> list[str]:
        """Return a sentence if a turn rate is given beside a bank, which determines it."""
        said = super().ineffective_key_notes()
        if self.bank_deg is None:
            return said
        return said + self.note_ineffective("rate_deg_s", because="bank_deg is given")


class TurnAway(Component):
    """Turns for the nearest track in range, and then leaves the ownship alone for a while.

    It closes the loop from what is sensed to where the ownship flies; the rule itself is as simple
    as can be. Tracks without a range are acted on only where the scene says so.
    """

    inputs = {"tracks": Input(Tracks, "trigger", "What is held of every target.")}
    outputs = {"manoeuvres": Output(Manoeuvres, "Turns that the ownship is told to fly.")}
    Parameters = TurnAwayParameters
    remembers = ("_free_from", "_rangeless")
    windowed = True
    lockstep = True
    rewindable = True

    @classmethod
    def may_climb(cls, parameters: TurnAwayParameters) -> bool:
        """Return that it never commands another altitude."""
        return False

    def setup(self) -> None:
        """Start free to turn."""
        self._pause_ticks = int(self.p.pause_s * self.context.ticks_per_s)
        #: By run, from when on it may turn again.
        self._free_from: dict[int, int] = {}
        #: How many tracks had no range, of how many.
        self._rangeless = NO_COUNTS

    def warnings(self) -> list[str]:
        """Warn that no sensor measures the range that it needs."""
        blind = "" if self.p.without_range else describe_rangeless(self.context.producers)
        if not blind:
            return []
        return [f"without_range is false and {blind} measures no range: it never turns"]

    def failure_counts(self) -> dict[str, IntArray]:
        """Return how many tracks had no range and were not acted on."""
        return (
            {}
            if self.p.without_range
            else {"a track has no range and is not acted on": self._rangeless}
        )

    def run(self, wake: Wake) -> Manoeuvres | None:
        """Look for the nearest track at every instant."""
        tracks = wake["tracks"]
        if tracks is None:
            return None
        near = tracks.range_m <= 1000.0 * self.p.range_km
        row = tracks.row_of_entries
        rangeless = np.isnan(tracks.range_m)
        of = take_runs(tracks.run, row)
        self._rangeless = count_cases(self._rangeless, take_runs(of, rangeless.nonzero()[0]), of)
        if self.p.without_range:
            near |= rangeless
        manoeuvres: dict[int, Manoeuvre] = {}
        rows = np.flatnonzero(np.bincount(row[near]))
        instants = wake.ticks[rows].tolist(), wake.run[rows].tolist()
        for index, tick, run in zip(rows.tolist(), *instants, strict=True):
            if tick < self._free_from.get(run, 0):
                continue
            entries = np.flatnonzero(near & (row == index))
            ranges_m = np.nan_to_num(tracks.range_m[entries], nan=np.inf)
            nearest = entries[np.argmin(ranges_m)]
            manoeuvres[index] = self._turn(on_the_left=tracks.azimuth_rad[nearest] <= 0.0)
            self._free_from[run] = tick + self._pause_ticks
        return Manoeuvres.at_rows(wake.instants, manoeuvres)

    def _turn(self, *, on_the_left: bool) -> Manoeuvre:
        """Return the turn away from an aircraft on one side."""
        to_the_right = {"away": on_the_left, "towards": not on_the_left}
        right = to_the_right.get(self.p.direction, self.p.direction == "right")
        bank_deg = self.p.bank_deg or 0.0
        return Manoeuvre(
            turn_rad=math.radians(self.p.turn_deg) * (1.0 if right else -1.0),
            rate_rad_s=0.0 if bank_deg else math.radians(self.p.rate_deg_s),
            bank_rad=math.radians(bank_deg),
            roll_rate_rad_s=math.radians(self.p.roll_rate_deg_s or 0.0),
        )
