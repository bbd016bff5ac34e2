"""An avoidance that turns away from what comes near (``avoidance.turn_away``)."""

import math
from fractions import Fraction

import numpy as np
from pydantic import Field

from components.messages.steering import SLOWEST_TURN_DEG_S, Manoeuvres
from components.messages.tracks import Tracks
from dsa_des.block.component import Component, NonNegativeRational, Parameters
from dsa_des.block.ports import Input, Output
from dsa_des.block.wake import Wake


class TurnAwayParameters(Parameters):
    """Parameters of turning away."""

    range_km: float = Field(default=5.0, gt=0, description="Turn for tracks nearer than this, km.")
    turn_deg: float = Field(
        default=30.0, gt=0, le=180, description="Change of heading, away from the nearest, deg."
    )
    rate_deg_s: float = Field(
        default=3.0, ge=SLOWEST_TURN_DEG_S, description="Rate of turn, deg/s."
    )
    pause_s: NonNegativeRational = Field(
        default=Fraction(60), description="Shortest time from one manoeuvre to the next, s."
    )


class TurnAway(Component):
    """Turns away from the nearest track in range, and then leaves the ownship alone for a while.

    It closes the loop from what is sensed to where the ownship flies; the rule itself is as simple
    as can be. Tracks without a range are not acted on.
    """

    inputs = {"tracks": Input(Tracks, "trigger", "What is held of every target.")}
    outputs = {"manoeuvres": Output(Manoeuvres, "Turns that the ownship is told to fly.")}
    Parameters = TurnAwayParameters
    windowed = True
    lockstep = True
    rewindable = True

    def setup(self) -> None:
        """Start free to turn."""
        self._pause_ticks = int(self.p.pause_s * self.context.ticks_per_s)
        #: By replica, from when on it may turn again.
        self._free_from: dict[int, int] = {}

    def run(self, wake: Wake) -> Manoeuvres | None:
        """Look for the nearest track at every instant."""
        tracks = wake["tracks"]
        if tracks is None:
            return None
        near = tracks.range_m <= 1000.0 * self.p.range_km
        row = np.repeat(np.arange(len(tracks)), np.diff(tracks.offsets))
        ticks, turns = [], []
        replica = wake.replica
        for place in np.unique(row[near]).tolist():
            tick = int(wake.ticks[place])
            run = int(replica[place])
            if tick < self._free_from.get(run, 0):
                continue
            entries = np.flatnonzero(near & (row == place))
            nearest = entries[np.argmin(tracks.range_m[entries])]
            to_the_right = tracks.azimuth_rad[nearest] <= 0.0
            ticks.append(tick)
            turns.append(math.radians(self.p.turn_deg) * (1.0 if to_the_right else -1.0))
            self._free_from[run] = tick + self._pause_ticks
        if not ticks:
            return None
        rate = np.full(len(ticks), math.radians(self.p.rate_deg_s))
        return Manoeuvres(np.array(ticks, dtype=np.int64), np.array(turns), rate)
