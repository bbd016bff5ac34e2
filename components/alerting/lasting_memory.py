"""What an alerting logic remembers of the targets of many runs, each at instants of its own."""

import numpy as np

from components.alerting.memory import AlertMemory, MemoryRule
from dsa_des.arrays.types import BoolArray, FloatArray, IntArray


class LastingMemory:
    """The memories of runs, made when each of them begins.

    Parameters
    ----------
    rule : MemoryRule
    targets : int
        Of each run.
    """

    def __init__(self, rule: MemoryRule, targets: int) -> None:
        self._rule, self._targets = rule, targets
        #: Which runs are remembered, ascending, and what of all their targets.
        self._runs: IntArray = np.empty(0, dtype=np.int64)
        self._memory = AlertMemory(rule, 0)

    def levels(
        self,
        run: IntArray,
        now_s: FloatArray,
        present: BoolArray,
        due: BoolArray,
        early: BoolArray,
    ) -> IntArray:
        """Take in some instants and return the level of each target, (n * targets,).

        Parameters
        ----------
        run : (n,) of int
            Ascending; the instants of a run are in order.
        now_s : (n,)
        present : (n, targets) of bool
        due, early : (n, targets, levels) of bool
            As `AlertMemory.step` has them.
        """
        begins = np.append(True, run[1:] != run[:-1])
        first = np.flatnonzero(begins)
        place = self._places(run[first])
        turn = np.arange(len(run)) - first[np.cumsum(begins) - 1]
        targets = np.arange(self._targets)
        level = np.zeros((len(run), self._targets), dtype=np.int64)
        order = np.argsort(turn, kind="stable")
        for rows in np.split(order, np.cumsum(np.bincount(turn))[:-1]):
            which = place[np.cumsum(begins)[rows] - 1][:, np.newaxis] * self._targets + targets
            part = self._memory.take(which.reshape(-1))
            shape = len(rows) * self._targets, due.shape[2]
            stepped = part.step(
                np.repeat(now_s[rows], self._targets), present[rows].reshape(-1),
                due[rows].reshape(shape), early[rows].reshape(shape),
            )  # fmt: skip
            self._memory.put(which.reshape(-1), part)
            level[rows] = stepped.reshape(len(rows), self._targets)
        return level.reshape(-1)

    def forget_before(self, run: int) -> None:
        """Forget the runs before one."""
        kept = np.flatnonzero(self._runs >= run)
        if len(kept) < len(self._runs):
            self._remembered(kept, self._runs[kept])

    def _places(self, runs: IntArray) -> IntArray:
        """Return the places of runs among those that are remembered, all of them from now on."""
        if not np.isin(runs, self._runs).all():
            every = np.union1d(self._runs, runs)
            before = np.full(len(every), -1, dtype=np.int64)
            before[np.searchsorted(every, self._runs)] = np.arange(len(self._runs))
            self._remembered(before, every)
        return np.searchsorted(self._runs, runs)

    def _remembered(self, before: IntArray, runs: IntArray) -> None:
        """Remember these runs, each as the one that was at a place before; -1 for a new one."""
        memory = AlertMemory(self._rule, len(runs) * self._targets)
        targets = np.arange(self._targets)
        old = np.flatnonzero(before >= 0)
        if len(old):
            there = (old[:, np.newaxis] * self._targets + targets).reshape(-1)
            here = (before[old][:, np.newaxis] * self._targets + targets).reshape(-1)
            memory.put(there, self._memory.take(here))
        self._runs, self._memory = runs, memory
