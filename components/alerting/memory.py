"""Memory of alert levels: hysteresis, M-of-N, persistence, of one run or of many."""

from dataclasses import dataclass

import numpy as np

from dsa_des.arrays.keyed_table import turns
from dsa_des.arrays.run_ticks import RunTicks, last_of_run, union
from dsa_des.arrays.types import BoolArray, FloatArray, IntArray

_NONE = -1
# The time of what has not been yet.
_LONG_AGO_S = -np.inf
_COLUMNS = ("_last_s", "_output", "_risen_s", "_queue", "_own_time_s")


@dataclass(frozen=True)
class MemoryRule:
    """How long and how an alert level is remembered."""

    hysteresis_s: float  # A gap in time longer than this forgets everything; 0 remembers nothing
    persistence_s: float  # A level that rose less than this ago does not fall
    m: int  # The m-th largest of the last n levels counts; m = 0 takes each one as it is
    n: int


class AlertMemory:
    """The remembered state of targets 0 ... count - 1, of one ownship or of several."""

    def __init__(self, rule: MemoryRule, count: int) -> None:
        self._rule = rule
        self._last_s = np.full(count, _LONG_AGO_S)
        self._output = np.full(count, _NONE, dtype=np.int64)
        self._risen_s = np.full(count, _LONG_AGO_S)
        self._queue = np.full((count, max(rule.n, 1)), _NONE, dtype=np.int64)
        self._own_time_s = np.full(count, np.nan)

    def _forget(self, which: BoolArray) -> None:
        self._last_s[which] = self._risen_s[which] = _LONG_AGO_S
        self._output[which] = _NONE
        self._queue[which] = _NONE

    def take(self, which: IntArray) -> "AlertMemory":
        """Return the memory of some targets, to be put back with `put`."""
        part = AlertMemory(self._rule, len(which))
        for name in _COLUMNS:
            setattr(part, name, getattr(self, name)[which])
        return part

    def put(self, which: IntArray, part: "AlertMemory") -> None:
        """Take over what `part` remembers as that of some targets."""
        for name in _COLUMNS:
            getattr(self, name)[which] = getattr(part, name)

    def step(
        self, now_s: float | FloatArray, present: BoolArray, due: BoolArray, early: BoolArray
    ) -> IntArray:
        """Take in one instant and return the level of each target."""
        rule = self._rule
        step_s = now_s - self._own_time_s
        gap = (step_s < 0.0) | (step_s > rule.hysteresis_s)
        if gap.any():
            self._forget(gap)
        self._own_time_s[:] = now_s
        raw = self._raw(now_s, due, early)
        gap_s = now_s - self._last_s
        known = (gap_s > 0.0) & (gap_s <= rule.hysteresis_s)
        fresh = present & ~known
        self._output[fresh] = _NONE
        self._risen_s[fresh] = _LONG_AGO_S
        counted = raw
        if rule.m > 0:
            self._queue[fresh] = _NONE
            self._queue[fresh, : rule.m] = raw[fresh, np.newaxis]
            pushed = np.concatenate([self._queue[:, 1:], raw[:, np.newaxis]], axis=1)
            self._queue = np.where(present[:, np.newaxis], pushed, self._queue)
            counted = np.sort(self._queue, axis=1)[:, -rule.m]
        since_s = now_s - self._risen_s
        young = (since_s >= 0.0) & (since_s < rule.persistence_s)
        held = (self._output > 0) & (counted < self._output) & young
        rises = ~held & (counted > 0) & (counted > self._output) & present
        self._risen_s = np.where(rises, now_s, self._risen_s)
        level = np.where(held, self._output, np.maximum(counted, 0))
        self._output = np.where(present, level, self._output)
        self._last_s = np.where(present, now_s, self._last_s)
        return level

    def early_levels(self, now_s: float, present: BoolArray) -> IntArray:
        """Return whose early alerting time counts for guidance: levels that rose before now."""
        counts = present & (self._rule.hysteresis_s > 0.0) & (self._risen_s < now_s)
        return np.where(counts, np.maximum(self._output, 0), 0)

    def _raw(self, now_s: float | FloatArray, due: BoolArray, early: BoolArray) -> IntArray:
        """Return the highest level that is due; the one that is on may be so early."""
        levels = np.arange(1, due.shape[1] + 1)
        before = self._last_s < now_s
        on = (self._output[:, np.newaxis] == levels) & before[:, np.newaxis]
        is_due = np.where(on, early, due)
        return np.asarray((is_due * levels).max(axis=1, initial=0))


class LevelMemory:
    """Memories of targets or tracks by run and number; who was gone for too long is new."""

    def __init__(self, rule: MemoryRule) -> None:
        self._rule = rule
        #: Run and number of each one that is remembered, ascending, and when it was last seen.
        self._known = RunTicks.none()
        self._seen_s: FloatArray = np.empty(0)
        self._memory = AlertMemory(rule, 0)

    def __len__(self) -> int:
        """Return how many targets are remembered."""
        return len(self._known)

    def levels(
        self,
        run: IntArray,
        number: IntArray,
        now_s: FloatArray,
        due: BoolArray,
        early: BoolArray,
        present: BoolArray | None = None,
    ) -> IntArray:
        """Take in targets (n,) at some instants, in order within a run, and return their levels.

        `due` and `early` (n, levels) are as for `AlertMemory.step`; all are present by default.
        """
        level = np.zeros(len(number), dtype=np.int64)
        if len(number) == 0:
            return level
        present = np.ones(len(number), dtype=bool) if present is None else present
        place = self._places(RunTicks(run, number))
        for rows in turns(place):
            part = self._memory.take(place[rows])
            level[rows] = part.step(now_s[rows], present[rows], due[rows], early[rows])
            self._memory.put(place[rows], part)
        self._seen_s[place] = now_s  # the last of each counts
        return level

    def forget(self, runs: IntArray, times_s: FloatArray) -> None:
        """Forget who was gone for too long, given the time in some runs (ascending)."""
        of = self._known.run
        last = np.minimum(np.searchsorted(runs, of), len(runs) - 1)
        away_s = np.where(runs[last] == of, times_s[last] - self._seen_s, 0.0)
        self._remember(np.flatnonzero(away_s <= self._rule.hysteresis_s))

    def forget_before(self, run: int) -> None:
        """Forget the runs before one."""
        self._remember(np.flatnonzero(self._known.run >= run))

    def _remember(self, which: IntArray) -> None:
        if len(which) < len(self._known):
            self._known, self._seen_s = self._known.take(which), self._seen_s[which]
            self._memory = self._memory.take(which)

    def _places(self, those: RunTicks) -> IntArray:
        """Return the rows of targets, by run and number, all of them remembered from now on."""
        place = last_of_run(self._known, those)
        if len(self._known) and bool(
            ((place >= 0) & (self._known.tick[place] == those.tick)).all()
        ):
            return place
        order = those.order()
        every = union([self._known, those if order is None else those.take(order)])
        old = last_of_run(every, self._known)
        memory, seen_s = AlertMemory(self._rule, len(every)), np.full(len(every), -np.inf)
        memory.put(old, self._memory)
        seen_s[old] = self._seen_s
        self._known, self._seen_s, self._memory = every, seen_s, memory
        return last_of_run(every, those)
