"""The end of an encounter: all aircraft have passed, and the run need not go on."""

from fractions import Fraction

import numpy as np
from pydantic import Field

from components.geometry import line_of_sight
from components.messages.reach import FarthestLook
from components.messages.targets import TrafficStates
from dsa_des.arrays.types import BoolArray, FloatArray, IntArray
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


class ClosestApproachPassed(Component):
    """Ends a run when the closest approach to every aircraft is passed.

    At every look the slant range from the ownship to each aircraft, where they truly are, is
    compared with that of the look before. An aircraft has passed when it is at least `beyond_m`
    away and its range has grown from look to look for `after_s`. One that has been there and is
    gone counts as one that moves away; one that has not come yet has not passed. The run ends at
    the first look at which all have passed: that instant is no longer part of it.
    """

    inputs = {"states": Input(TrafficStates, "sampled", "Where all aircraft are.")}
    outputs = {"end": Output(RunEnd, "That the run is over; it need not be wired.")}
    Parameters = ClosestApproachPassedParameters
    windowed = True
    lockstep = True
    rewindable = True

    def request(self, port: str) -> FarthestLook:
        """Ask for all targets, however far they are."""
        return FarthestLook(np.inf)

    def setup(self) -> None:
        """Start without having seen anybody."""
        self._after_ticks = int(self.p.after_s * self.context.ticks_per_s)
        #: By run and target: the last range, infinite while it is away; since when it has grown;
        #: and whether the target has been there.
        self._range_m: FloatArray = np.empty((0, 0))
        self._since: IntArray = np.empty((0, 0), dtype=np.int64)
        self._seen: BoolArray = np.empty((0, 0), dtype=bool)

    def run(self, wake: Wake) -> RunEnd | None:
        """Compare the distances of every look with those of the one before."""
        states = wake["states"]
        if states is None or len(states.columns) == 0:
            return None
        own = states.own_lat_deg, states.own_lon_deg, states.own_alt_m
        lat_deg, lon_deg, alt_m = (values[:, np.newaxis] for values in own)
        _, _, range_m = line_of_sight(
            lat_deg, lon_deg, alt_m, states.lat_deg, states.lon_deg, states.alt_m, validate=False
        )
        starts = wake.instants.first_of_each
        numbers = wake.run[starts]
        self._make_room(int(numbers[-1]) + 1, range_m.shape[1])
        ticks, row = wake.ticks[:, np.newaxis], np.arange(len(wake))[:, np.newaxis]
        # The first row of each one's run: a running maximum of rows that is less is of another.
        first = np.repeat(starts, np.diff(np.append(starts, len(wake))))[:, np.newaxis]

        there = np.where(states.present, row, -1)
        before = np.where(self._seen[numbers], row[starts], -1)
        there[starts] = np.maximum(there[starts], before)
        seen = np.maximum.accumulate(there, axis=0) >= first

        last_m = np.empty_like(range_m)
        now_m = np.where(states.present, range_m, np.inf)
        last_m[1:] = now_m[:-1]
        last_m[starts] = self._range_m[numbers]
        growing = (now_m > last_m) | (~states.present & seen)
        shrank = np.maximum.accumulate(np.where(growing, -1, row), axis=0)
        remembered = self._since[wake.run]
        since = np.where(shrank >= first, ticks[np.maximum(shrank, 0), 0], remembered)

        passed = (ticks - since >= self._after_ticks) & growing & (now_m >= self.p.beyond_m)
        over = passed.all(axis=1)
        ends = np.append(starts[1:], len(wake)) - 1
        self._range_m[numbers], self._since[numbers] = now_m[ends], since[ends]
        self._seen[numbers] = seen[ends]
        return RunEnd(wake.ticks[over], run=wake.run[over]) if over.any() else None

    def _make_room(self, runs: int, targets: int) -> None:
        """Have a row for so many runs."""
        more = runs - len(self._range_m)
        if more > 0:
            shape = more, targets
            old = (self._range_m, self._since, self._seen) if len(self._range_m) else ()
            new = np.full(shape, np.inf), np.full(shape, -1), np.zeros(shape, dtype=bool)
            if old:
                new = tuple(np.concatenate(pair) for pair in zip(old, new, strict=True))  # type: ignore[assignment]
            self._range_m, self._since, self._seen = new
