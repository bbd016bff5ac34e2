"""Which runs of a scene go through time together, and when each ends.

Rows say of which run they are (`Wake.run`, `Message.run`), and their ticks count from its start:
every array expression over rows is one over runs and rows. Some runs go at a time, side by side,
and when these have ended the next. A window is a stretch of time of all that go: it holds that
stretch's rows of the first of them, then those of the second, and so on.
"""

from dataclasses import dataclass

import numpy as np

from dsa_des.arrays.run_ticks import RunTicks
from dsa_des.arrays.types import BoolArray, IntArray


@dataclass
class ReplicaTime:
    """How many runs there are, how long they are, and which of them go now.

    Parameters
    ----------
    replicas : int
    run_ticks : int
        Length of each run: it covers [0, run_ticks).

    Attributes
    ----------
    runs : range
        The runs that go now; all before them have ended.
    """

    replicas: int
    run_ticks: int

    def __post_init__(self) -> None:
        self.runs = range(self.replicas)

    def final_before(self, runs: range, tick: int) -> tuple[int, int]:
        """Return the run, and its tick, before which no row comes, when runs are at a tick."""
        if tick >= self.run_ticks:
            return runs.stop, 0
        return runs.start, tick if len(runs) == 1 else 0


class RunEnds:
    """Up to when each run of a timeline lasts, as far as that is known.

    Parameters
    ----------
    time : ReplicaTime

    Attributes
    ----------
    ticks : (runs,) of int64
        First tick that is no longer part of each run, counted from its start.
    early : bool
        Whether any run ends before its time.
    by : dict of str
        Which block ended a run.
    """

    def __init__(self, time: ReplicaTime) -> None:
        self._time = time
        self.ticks: IntArray = np.full(time.replicas, time.run_ticks, dtype=np.int64)
        self.early = False
        self.by: dict[int, str] = {}

    def note(self, ends: RunTicks, block: str) -> None:
        """Take note that a block ends runs at some instants; the first counts."""
        for run, tick in zip(ends.run.tolist(), ends.tick.tolist(), strict=True):
            if tick < self.ticks[run]:
                self.ticks[run] = tick
                self.by[run] = block
                self.early = True

    def before(self, instants: RunTicks) -> BoolArray:
        """Return which instants lie before the ends of their runs."""
        return np.less(instants.tick, self.ticks[instants.run])

    def running(self, runs: IntArray) -> int:
        """Return how many of some runs are not known to end early."""
        return int(np.count_nonzero(self.ticks[runs] == self._time.run_ticks))

    def passed(self, tick: int) -> bool:
        """Return whether all runs whose time it is are over before a tick of theirs."""
        runs = self._time.runs
        return self.early and bool((self.ticks[runs.start : runs.stop] <= tick).all())
