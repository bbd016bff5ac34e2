"""One timeline for many replicas, laid end to end.

Replicas of a scene that run in lock step share one run: replica r occupies the ticks from r times
the span. Rows of many replicas are then rows of one long run, in order, and every array expression
over rows is one over replicas and rows. Scan numbers carry the replica in their high bits, so that
a draw is still a function of its own replica's seed and scan.

Some of them run at a time, side by side, and when these have ended the next. A window is a stretch
of time of all that run: it holds that stretch's rows of the first of them, then those of the
second, and so on. Ticks of rows are those of the line; those of windows, and those that clocks are
asked for, are within the replicas.
"""

from dataclasses import dataclass

import numpy as np

from dsa_des.arrays.types import IntArray
from dsa_des.time.clock import MAX_TICK

_SCAN_BITS = 40


@dataclass
class ReplicaTime:
    """How replicas lie on their common timeline; one run by itself is one replica.

    Parameters
    ----------
    replicas : int
    run_ticks : int
        Length of each run: it covers [0, run_ticks) of its own ticks.
    span_ticks : int
        Ticks from one replica's start to the next; 0 for a run by itself.

    Attributes
    ----------
    runs : range
        The replicas that run now; all before them have ended.
    """

    replicas: int
    run_ticks: int
    span_ticks: int = 0

    def __post_init__(self) -> None:
        self.runs = range(self.replicas)

    @classmethod
    def of_replicas(cls, replicas: int, run_ticks: int) -> "ReplicaTime":
        """Return replicas so far apart that nothing of one run reaches the other's."""
        return cls(replicas, run_ticks, 1 << (2 * run_ticks).bit_length())

    def final_before(self, runs: range, tick: int) -> int:
        """Return the instant of the line before which no row comes, when runs are at a tick."""
        if not self.span_ticks:
            return tick
        if tick >= self.run_ticks:
            return runs.stop * self.span_ticks
        return runs.start * self.span_ticks + (tick if len(runs) == 1 else 0)

    @property
    def fits(self) -> bool:
        """Whether the last replica's ticks stay below the largest tick."""
        return self.replicas * self.span_ticks < MAX_TICK


def first_scan(replica: int) -> int:
    """Return what the scan number 0 of a replica is written as."""
    return replica << _SCAN_BITS


def split_scans(scans: IntArray) -> tuple[IntArray, IntArray]:
    """Return the replica and the scan number within it; -1, no scan, stays -1."""
    replica = (scans + 1) >> _SCAN_BITS
    return replica, scans - (replica << _SCAN_BITS)


def own_scans(scans: IntArray) -> IntArray:
    """Return the scan numbers within their replicas."""
    return split_scans(np.asarray(scans, dtype=np.int64))[1]
