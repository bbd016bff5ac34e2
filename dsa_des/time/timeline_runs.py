"""The runs of a scene that share a timeline: which of them go now, and when each ends.

Rows say of which run they are (`Wake.run`, `Message.run`), and their ticks count from its start:
every array expression over rows is one over runs and rows. Some runs go at a time, side by side,
and when these have ended the next. A window is a stretch of time of all that go: it holds that
stretch's rows of the first of them, then those of the second, and so on.
"""

import numpy as np

from dsa_des.arrays.run_ticks import RunTicks
from dsa_des.arrays.types import BoolArray, IntArray
from dsa_des.time.clock import MAX_TICK


class Runs:
    """How many runs there are, how long they last, and which of them are being simulated now.

    Parameters
    ----------
    count : int
    run_ticks : int
        Length of each run, unless it ends early: it covers [0, run_ticks).

    Attributes
    ----------
    going : range
        The runs that go now; all before them have ended.
    ends : (count,) of int64
        First tick that is no longer part of each run, counted from its start, as far as known.
    early : bool
        Whether any run ends before its time.
    ended_by : dict of str
        Which block ended a run.
    """

    def __init__(self, count: int = 1, run_ticks: int = MAX_TICK) -> None:
        self.count, self.run_ticks = count, run_ticks
        self.going = range(count)
        self.ends: IntArray = np.full(count, run_ticks, dtype=np.int64)
        self.early = False
        self.ended_by: dict[int, str] = {}

    def rows_complete_before(self, tick: int, going: range) -> tuple[int, int]:
        """Return (run, tick) before which no row can come, once the runs `going` reached `tick`."""
        if tick >= self.run_ticks:
            return going.stop, 0
        return going.start, tick if len(going) == 1 else 0

    def note_ends(self, instants: RunTicks, block: str) -> None:
        """Record that a block ends runs at these instants; the earliest end of a run counts."""
        for run, tick in zip(instants.run.tolist(), instants.tick.tolist(), strict=True):
            if tick < self.ends[run]:
                self.ends[run] = tick
                self.ended_by[run] = block
                self.early = True

    def is_before_ends(self, instants: RunTicks) -> BoolArray:
        """Return a mask of the instants, True for those before the end of their run."""
        return np.less(instants.tick, self.ends[instants.run])

    def count_full_length(self, runs: IntArray) -> int:
        """Return how many of the given runs are not known to end early."""
        return int(np.count_nonzero(self.ends[runs] == self.run_ticks))

    def have_all_ended(self, tick: int) -> bool:
        """Return whether all runs being simulated have ended early, at `tick` or before."""
        return self.early and bool((self.ends[self.going.start : self.going.stop] <= tick).all())
