"""The end of an encounter: all aircraft have passed, and the run need not go on."""

from fractions import Fraction
from typing import Literal

import numpy as np
from pydantic import Field

from components.geometry import POSITION_FIELDS, slant_range_m
from components.messages.reach import FarthestLook
from components.messages.targets import TrafficStates
from dsa_des.arrays.keyed_table import KeyedTable
from dsa_des.arrays.types import BoolArray, FloatArray
from dsa_des.block.component import (
    ClockedParameters,
    Component,
    Input,
    NonNegativeRational,
    Output,
    RunEnd,
)
from dsa_des.block.parameters import PositiveRational
from dsa_des.block.wake import Wake


class ClosestApproachPassedParameters(ClockedParameters):
    """Parameters of the rule by which a run ends."""

    scan_rate_hz: PositiveRational = Field(
        default=Fraction(1), description="How often distances are taken, Hz."
    )
    after_s: NonNegativeRational = Field(
        default=Fraction(20),
        description="Time for which the distances must have grown without a break, s; 0 ends the "
        "run as soon as each has grown once.",
    )
    beyond_m: float = Field(
        default=0.0, ge=0, description="Distances from which on an aircraft counts as passed, m."
    )
    between: Literal["ownship and others", "any two"] = Field(
        default="ownship and others", description="Whose distances are taken."
    )


class ClosestApproachPassed(Component):
    """Ends a run when the closest approach to every aircraft is passed.

    At every look the slant range from the ownship to each aircraft, where they truly are, is
    compared with that of the look before. An aircraft has passed when it is at least `beyond_m`
    away and its range has grown from look to look for `after_s`. One that has been there and is
    gone counts as one that moves away; one that has not come yet has not passed. The run ends at
    the first look at which all have passed: that instant is no longer part of it. Between any two,
    each has to have passed all others.
    """

    inputs = {"states": Input(TrafficStates, "sampled", "Where all aircraft are.")}
    outputs = {"end": Output(RunEnd, "That the run is over; it need not be wired.")}
    Parameters = ClosestApproachPassedParameters
    remembers = ("_known",)
    windowed = True
    lockstep = True
    rewindable = True

    def request(self, port: str) -> FarthestLook:
        """Return a request for all targets, however far they are."""
        return FarthestLook(np.inf)

    def setup(self) -> None:
        """Start without having seen anybody."""
        self._after_ticks = int(self.p.after_s * self.context.ticks_per_s)
        #: By target and run: the last range, infinite while it is away; since when it has grown;
        #: and whether the target has been there.
        types = {"replica": int, "range_m": float, "since": int, "seen": bool}
        self._known = KeyedTable.empty(types)

    def run(self, wake: Wake) -> RunEnd | None:
        """Compare the distances of every look with those of the one before."""
        states = wake["states"]
        if states is None or len(states.columns) == 0:
            return None
        range_m, present = self._ranges_m_and_presence(states)
        starts = wake.instants.first_position_of_runs
        numbers = wake.run[starts]
        shape = range_m.shape[1], len(numbers)
        known = self._known.kept_rows_or_new(
            KeyedTable(
                replica=numbers,
                range_m=np.full(shape, np.inf),
                since=np.full(shape, -1),
                seen=np.zeros(shape, dtype=bool),
            )
        )
        ticks, row = wake.ticks[:, np.newaxis], np.arange(len(wake))[:, np.newaxis]
        # The first row of each one's run: a running maximum of rows that is less is of another.
        counts = np.diff(np.append(starts, len(wake)))
        first = np.repeat(starts, counts)[:, np.newaxis]

        there = np.where(present, row, -1)
        before = np.where(known.seen.T, row[starts], -1)
        there[starts] = np.maximum(there[starts], before)
        seen = np.maximum.accumulate(there, axis=0) >= first

        last_m = np.empty_like(range_m)
        now_m = np.where(present, range_m, np.inf)
        last_m[1:] = now_m[:-1]
        last_m[starts] = known.range_m.T
        growing = (now_m > last_m) | (~present & seen)
        shrank = np.maximum.accumulate(np.where(growing, -1, row), axis=0)
        remembered = np.repeat(known.since.T, counts, axis=0)
        since = np.where(shrank >= first, ticks[np.maximum(shrank, 0), 0], remembered)

        passed = (ticks - since >= self._after_ticks) & growing & (now_m >= self.p.beyond_m)
        over = passed.all(axis=1)
        ends = np.append(starts[1:], len(wake)) - 1
        now = {"range_m": now_m[ends].T, "since": since[ends].T, "seen": seen[ends].T}
        newer = KeyedTable(replica=numbers, **now)
        self._known = self._known.replace_and_drop_earlier_runs(numbers, newer, wake.first_run)
        return RunEnd(wake.ticks[over], run=wake.run[over]) if over.any() else None

    def _ranges_m_and_presence(self, states: TrafficStates) -> tuple[FloatArray, BoolArray]:
        """Return distances (rows, pairs), m, of all or to the ownship, and if both are present."""
        own = [getattr(states, f"own_{name}")[:, np.newaxis] for name in POSITION_FIELDS]
        others = [getattr(states, name) for name in POSITION_FIELDS]
        if self.p.between != "any two":
            return slant_range_m(*own, *others), states.present
        every = [np.concatenate(pair, axis=1) for pair in zip(own, others, strict=True)]
        one, two = np.triu_indices(every[0].shape[1], 1)
        there = np.insert(states.present, 0, True, axis=1)
        ends = (part[:, which] for which in (one, two) for part in every)
        return slant_range_m(*ends), there[:, one] & there[:, two]
