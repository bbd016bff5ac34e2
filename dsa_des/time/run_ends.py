"""When the runs of a timeline end: when they are meant to, or earlier where a block says so."""

import numpy as np

from dsa_des.arrays.run_ticks import RunTicks
from dsa_des.arrays.types import BoolArray, IntArray
from dsa_des.time.timeline import ReplicaTime


class RunEnds:
    """Up to when each run of a timeline lasts, as far as that is known.

    Parameters
    ----------
    time : ReplicaTime

    Attributes
    ----------
    ticks : (replicas,) of int64
        First tick that is no longer part of each run, counted from its start.
    early : bool
        Whether any run ends before its time.
    by : dict of str
        Which block ended a replica's run.
    """

    def __init__(self, time: ReplicaTime) -> None:
        self._time = time
        self.ticks: IntArray = np.full(time.replicas, time.run_ticks, dtype=np.int64)
        self.early = False
        self.by: dict[int, str] = {}

    def note(self, ends: RunTicks, block: str) -> None:
        """Take note that a block ends runs at some instants; the first counts."""
        for replica, tick in zip(ends.run.tolist(), ends.tick.tolist(), strict=True):
            if tick < self.ticks[replica]:
                self.ticks[replica] = tick
                self.by[replica] = block
                self.early = True

    def before(self, instants: RunTicks) -> BoolArray:
        """Return which instants lie before the ends of their runs."""
        return np.less(instants.tick, self.ticks[instants.run])

    def running(self, replicas: IntArray) -> int:
        """Return how many of some replicas are not known to end early."""
        return int(np.count_nonzero(self.ticks[replicas] == self._time.run_ticks))

    def passed(self, tick: int) -> bool:
        """Return whether all runs whose time it is are over before a tick of theirs."""
        runs = self._time.runs
        return self.early and bool((self.ticks[runs.start : runs.stop] <= tick).all())

    def cut(self, end: int) -> int:
        """Return the end of a window, or that of the run that goes alone if it comes first."""
        runs = self._time.runs
        return min(end, int(self.ticks[runs.start])) if self.early and len(runs) == 1 else end
