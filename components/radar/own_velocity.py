"""How the ownship moves when a radar measures range rates, as an effect: the other half of them.

A range rate is of two aircraft. Who estimates the other one's velocity from it must know our own.
"""

from dataclasses import replace
from typing import Any

import numpy as np

from components.geometry.ellipsoid import line_of_sight_ned
from components.messages.columns import OWN_VELOCITY
from components.messages.detections import Detections
from components.messages.targets import RelativeTargets
from dsa_des.arrays.types import FloatArray, IntArray
from dsa_des.block.effect import Effect, Verdict

# Half of the time between two positions; a power of two, so that times differ by it exactly.
_STEP_S = 1.0 / 64.0
_PLACE = ("lat_deg", "lon_deg", "alt_m")


class OwnVelocity(Effect):
    """The ownship's velocity over ground beside every detection; navigation has no error of it."""

    lockstep = True
    name = "own velocity"
    acts_on = "report"
    neutral = False
    outside_the_proof = "it fills columns that are null without it"

    def verdict(self, block: Any) -> Verdict:
        """Ask for ``measures_range_rate``."""
        return Verdict.of_flag(block.p, "measures_range_rate")

    def build(self, block: Any) -> Any:
        """Return what adds the velocity to a report."""
        ticks_per_s = block.context.ticks_per_s

        def with_velocity(
            detections: Detections, targets: RelativeTargets, rows: IntArray
        ) -> Detections:
            counts = np.diff(detections.offsets)
            after, some = detections.ticks_after, counts > 0
            # At instants of their own, or once a scan.
            row = rows[some] if after is None else np.repeat(rows, counts)
            state = (targets.tick if targets.state_tick is None else targets.state_tick)[row]
            if block.span_ticks:
                state = state % block.span_ticks
            time_s = (state if after is None else state + after) / ticks_per_s
            velocity = own_velocity(targets, row, time_s)
            if after is not None:
                own = dict(zip(OWN_VELOCITY, velocity, strict=True))
                return replace(detections, own_velocity_of_entries=own)
            of_scans = np.full((len(OWN_VELOCITY), len(rows)), np.nan)
            of_scans[:, some] = velocity
            return replace(detections, own_velocity=dict(zip(OWN_VELOCITY, of_scans, strict=True)))

        return with_velocity


def own_velocity(targets: RelativeTargets, row: IntArray, time_s: FloatArray) -> FloatArray:
    """Return the ownship's velocity at some times, each as a row of the targets knows its flight.

    Parameters
    ----------
    targets : RelativeTargets
    row : (n,) of int
    time_s : (n,)

    Returns
    -------
    (3, n) array, m/s
        Over ground: north, east, down at its own place. From positions 1/64 s before and after,
        of which one is replaced by the position itself where the flight begins or ends between;
        NaN where no flights are known.
    """
    if targets.revisit is None or not len(targets.roster) or not len(row):
        return np.full((3, len(row)), np.nan)
    flights = targets.revisit.take_rows(row)
    # Where the ownship is does not depend on the target that is asked for with it.
    anyone = np.zeros(1, dtype=np.int64)
    own = [
        {name: values[:, 0] for name, values in flights(anyone, at[:, np.newaxis])["own"].items()}
        for at in (time_s, time_s - _STEP_S, time_s + _STEP_S)
    ]
    here = [own[0][name] for name in _PLACE]
    moved, span_s = [], np.zeros(len(row))
    for there in own[1:]:
        places = [there[name] for name in _PLACE]
        way = np.stack(line_of_sight_ned(*here, *places, validate=False))
        moved.append(np.where(there["present"], way, 0.0))
        span_s = span_s + np.where(there["present"], _STEP_S, 0.0)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray((moved[1] - moved[0]) / span_s)
