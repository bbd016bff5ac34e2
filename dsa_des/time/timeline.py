"""Which runs of a scene go through time together.

Rows say of which run they are (`Wake.run`, `Message.run`), and their ticks count from its start:
every array expression over rows is one over runs and rows. Some runs go at a time, side by side,
and when these have ended the next. A window is a stretch of time of all that go: it holds that
stretch's rows of the first of them, then those of the second, and so on.
"""

from dataclasses import dataclass


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
