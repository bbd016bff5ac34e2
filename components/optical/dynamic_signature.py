"""The signature that a target's motion across the picture adds (thesis eq. 16-18)."""

from collections.abc import Callable
from typing import Any

import numpy as np

from components.optical.line_of_sight_rate import line_of_sight_rate
from components.sensor.look import Cells
from dsa_des.arrays.types import FloatArray, IntArray
from dsa_des.block.effect import Effect, Verdict


class DynamicSignature(Effect):
    """The rate of the line of sight adds b·V to the signature."""

    name = "dynamic signature"
    acts_on = "signature"
    lockstep = True

    def verdict(self, block: Any) -> Verdict:
        """Ask for the weight b."""
        weight = block.p.dynamic_weight
        return Verdict(weight > 0, f"dynamic_weight is {weight:g}")

    def build(self, block: Any) -> Callable[[Cells], FloatArray]:
        """Return what is added to every cell's signature."""
        return MovingTargets(block.p.dynamic_weight, block.p.rate, block.context.ticks_per_s)


class MovingTargets:
    """Remembers where each target was at the last scan, and weighs how fast it moves.

    Parameters
    ----------
    weight_s : float
        b of eq. 18, s/rad.
    model : {"exact", "thesis"}
    ticks_per_s : int
    """

    def __init__(self, weight_s: float, model: str, ticks_per_s: int) -> None:
        self.weight_s = weight_s
        self.model = model
        self._ticks_per_s = ticks_per_s
        # Of each replica, tick and NED angles of its last scan, one column per target; NaN where
        # it saw none.
        self._tick: IntArray = np.empty(0, dtype=np.int64)
        self._angles: FloatArray = np.empty((2, 0, 0))

    def __call__(self, cells: Cells) -> FloatArray:
        """Return b·V of every cell."""
        return self.weight_s * self.rate(cells)

    def rate(self, cells: Cells) -> FloatArray:
        """Return each cell's rate of the line of sight since the scan before, rad/s.

        A target's first look has none, nor has the first after a scan that did not see it.
        """
        replica, targets = cells.replica_of_scan, len(cells.roster)
        self._remember(int(replica.max(initial=0)) + 1, targets)
        begins = np.append(True, replica[1:] != replica[:-1])
        # Before the scans of each replica stands its last one.
        place = np.arange(len(replica)) + np.cumsum(begins)
        of, earlier = replica[begins], place[begins] - 1
        angles = np.full((2, len(replica) + len(of), targets), np.nan)
        tick = np.zeros(len(replica) + len(of), dtype=np.int64)
        angles[:, earlier], tick[earlier] = self._angles[:, of], self._tick[of]
        here = place[cells.row]
        angles[:, here, cells.target] = cells.azimuth_rad, cells.elevation_rad
        tick[place] = cells.scan_ticks
        last = np.append(earlier[1:], len(tick)) - 1
        self._tick[of], self._angles[:, of] = tick[last], angles[:, last]
        azimuth, elevation = angles[:, here - 1, cells.target]
        interval = (tick[here] - tick[here - 1]) / self._ticks_per_s
        return np.asarray(
            line_of_sight_rate(
                cells.azimuth_rad,
                cells.elevation_rad,
                azimuth,
                elevation,
                np.where(np.isnan(azimuth), 1.0, interval),
                seen_before=~np.isnan(azimuth),
                model=self.model,
            )
        )

    def _remember(self, replicas: int, targets: int) -> None:
        """Remember so many replicas at least."""
        known = len(self._tick)
        if known < replicas:
            angles = np.full((2, replicas, targets), np.nan)
            angles[:, :known] = self._angles.reshape(2, known, targets)
            self._angles = angles
            self._tick = np.append(self._tick, np.zeros(replicas - known, dtype=np.int64))
