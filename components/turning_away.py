"""An avoidance that turns for the nearest track (``avoidance.turn_away``)."""

import math
from fractions import Fraction
from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from components.messages.detections import joined_names_if_all_rangeless
from components.messages.steering import SLOWEST_TURN_DEG_S, Manoeuvre, Manoeuvres
from components.messages.tracks import Tracks
from dsa_des.arrays.run_ticks import take_runs
from dsa_des.arrays.types import IntArray
from dsa_des.block.component import Component, Input, NonNegativeRational, Output, Parameters
from dsa_des.block.wake import Wake
from dsa_des.record.failure_counts import NO_COUNTS, counts_with_cases_added


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
        """Return False: this block only turns."""
        return False

    def setup(self) -> None:
        """Start free to turn."""
        self._pause_ticks = int(self.p.pause_s * self.context.ticks_per_s)
        #: By run, from when on it may turn again.
        self._free_from: dict[int, int] = {}
        #: How many tracks had no range, of how many.
        self._rangeless = NO_COUNTS

    def warnings(self) -> list[str]:
        """Return a warning if no sensor measures the range that the block needs to act."""
        blind = (
            "" if self.p.without_range else joined_names_if_all_rangeless(self.context.producers)
        )
        if not blind:
            return []
        return [f"without_range is false and {blind} measures no range: it never turns"]

    def failure_counts(self) -> dict[str, IntArray]:
        """Return, by message, the tracks per run not acted on because they had no range."""
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
        self._rangeless = counts_with_cases_added(
            self._rangeless, take_runs(of, rangeless.nonzero()[0]), of
        )
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
            manoeuvres[index] = self._turn_manoeuvre(on_the_left=tracks.azimuth_rad[nearest] <= 0.0)
            self._free_from[run] = tick + self._pause_ticks
        return Manoeuvres.at_rows(wake.instants, manoeuvres)

    def _turn_manoeuvre(self, *, on_the_left: bool) -> Manoeuvre:
        """Return the turn to command, by configuration, for an aircraft on the left or right."""
        to_the_right = {"away": on_the_left, "towards": not on_the_left}
        right = to_the_right.get(self.p.direction, self.p.direction == "right")
        bank_deg = self.p.bank_deg or 0.0
        return Manoeuvre(
            turn_rad=math.radians(self.p.turn_deg) * (1.0 if right else -1.0),
            rate_rad_s=0.0 if bank_deg else math.radians(self.p.rate_deg_s),
            bank_rad=math.radians(bank_deg),
            roll_rate_rad_s=math.radians(self.p.roll_rate_deg_s or 0.0),
        )
