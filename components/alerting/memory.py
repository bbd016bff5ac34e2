"""Memory of alert levels: hysteresis, M-of-N, persistence, of one run or of many."""

from dataclasses import dataclass
from typing import Self

import numpy as np

from dsa_des.arrays.keyed_table import KeyedTable, indices_by_occurrence
from dsa_des.arrays.run_ticks import RunTicks, last_position_at_or_before, union_of_instants
from dsa_des.arrays.types import BoolArray, FloatArray, IntArray

_NONE = -1
# The time of what has not been yet.
_LONG_AGO_S = -np.inf


@dataclass(frozen=True)
class MemoryRule:
    """For how long and by which m-of-n rule an alert level is remembered."""

    hysteresis_s: float  # A gap in time longer than this forgets everything; 0 remembers nothing
    persistence_s: float  # A level that rose less than this ago does not fall
    m: int  # The m-th largest of the last n levels counts; m = 0 takes each one as it is
    n: int


class AlertMemory(KeyedTable):
    """Remembered alert levels, a row for each run (``replica``) and target or track ``number``.

    ``output`` is the level that is on, -1 for none, and ``risen_s`` when it rose; ``queue`` (n of
    the rule, targets) has the last levels, ``last_s`` is when the target was last present, and
    ``asked_s`` when it was last asked for.
    """

    @classmethod
    def new(cls, rule: MemoryRule, replica: IntArray, number: IntArray) -> Self:
        """Return the initial memory of the given targets: no level so far."""
        count = len(number)
        return cls(
            replica=replica,
            number=number,
            last_s=np.full(count, _LONG_AGO_S),
            output=np.full(count, _NONE, dtype=np.int64),
            risen_s=np.full(count, _LONG_AGO_S),
            queue=np.full((max(rule.n, 1), count), _NONE, dtype=np.int64),
            asked_s=np.full(count, np.nan),
        )

    def next_memory_and_levels(
        self,
        rule: MemoryRule,
        now_s: float | FloatArray,
        present: BoolArray,
        due: BoolArray,
        early: BoolArray,
    ) -> tuple[Self, IntArray]:
        """Return the memory after one more instant, and the alert level of each target then.

        `due` and `early` (targets, levels) say which levels are due by their times, and which if
        they are on already.
        """
        step_s = now_s - self.asked_s
        gap = (step_s < 0.0) | (step_s > rule.hysteresis_s)
        last_s = np.where(gap, _LONG_AGO_S, self.last_s)
        output = np.where(gap, _NONE, self.output)
        levels = np.arange(1, due.shape[1] + 1)
        on = (output[:, np.newaxis] == levels) & (last_s < now_s)[:, np.newaxis]
        raw = np.asarray((np.where(on, early, due) * levels).max(axis=1, initial=0))
        gap_s = now_s - last_s
        fresh = present & ~((gap_s > 0.0) & (gap_s <= rule.hysteresis_s))
        output = np.where(fresh, _NONE, output)
        risen_s = np.where(gap | fresh, _LONG_AGO_S, self.risen_s)
        queue, counted = self.queue, raw
        if rule.m > 0:
            queue = np.where(gap | fresh, _NONE, queue)
            queue[: rule.m, fresh] = raw[fresh]
            queue = np.where(present, np.concatenate([queue[1:], raw[np.newaxis]]), queue)
            counted = np.sort(queue, axis=0)[-rule.m]
        since_s = now_s - risen_s
        young = (since_s >= 0.0) & (since_s < rule.persistence_s)
        held = (output > 0) & (counted < output) & young
        rises = ~held & (counted > 0) & (counted > output) & present
        level = np.where(held, output, np.maximum(counted, 0))
        after = self.with_columns(
            last_s=np.where(present, now_s, last_s),
            output=np.where(present, level, output),
            risen_s=np.where(rises, now_s, risen_s),
            queue=queue,
            asked_s=np.full(len(self), now_s),
        )
        return after, level

    def early_levels_for_guidance(
        self, rule: MemoryRule, now_s: float, present: BoolArray
    ) -> IntArray:
        """Return the level of each present target whose level rose before now, else 0: only then
        may its early alerting time count for guidance.
        """
        counts = present & (rule.hysteresis_s > 0.0) & (self.risen_s < now_s)
        return np.where(counts, np.maximum(self.output, 0), 0)

    @property
    def keys(self) -> RunTicks:
        """Run and target number of each row."""
        return RunTicks(self.replica, self.number)


class LevelMemory:
    """Remembers alert levels by run and target or track number, anew after a long absence."""

    def __init__(self, rule: MemoryRule) -> None:
        self._rule = rule
        none = np.empty(0, dtype=np.int64)
        #: Ascending by run and number.
        self._known = AlertMemory.new(rule, none, none)

    def __len__(self) -> int:
        """Return how many targets are remembered."""
        return len(self._known)

    def update_levels(
        self,
        run: IntArray,
        number: IntArray,
        now_s: FloatArray,
        due: BoolArray,
        early: BoolArray,
        present: BoolArray | None = None,
    ) -> IntArray:
        """Update the memory with targets (n,) in order of time, and return their alert levels.

        `due` and `early` (n, levels) are as for `AlertMemory.step`; all are present by default.
        """
        level = np.zeros(len(number), dtype=np.int64)
        if len(number) == 0:
            return level
        present = np.ones(len(number), dtype=bool) if present is None else present
        index = self._find_or_add_target_rows(RunTicks(run, number))
        for rows in indices_by_occurrence(index):
            part, level[rows] = self._known.take(index[rows]).next_memory_and_levels(
                self._rule, now_s[rows], present[rows], due[rows], early[rows]
            )
            self._write_rows(index[rows], part)
        return level

    def forget_absent(self, runs: IntArray, times_s: FloatArray) -> None:
        """Drop targets not updated within the hysteresis time at each run's present (ascending)."""
        of = self._known.replica
        last = np.minimum(np.searchsorted(runs, of), len(runs) - 1)
        away_s = np.where(runs[last] == of, times_s[last] - self._known.asked_s, 0.0)
        self._known = self._known.take(away_s <= self._rule.hysteresis_s)

    def forget_runs_before(self, run: int) -> None:
        """Drop the targets of all runs with smaller numbers than this one."""
        self._known = self._known.take(self._known.replica >= run)

    def _write_rows(self, which: IntArray, part: AlertMemory) -> None:
        for name, values in part.columns.items():
            self._known.columns[name][..., which] = values

    def _find_or_add_target_rows(self, those: RunTicks) -> IntArray:
        """Return each target's row in the memory, by run and number, adding unknown ones first."""
        known = self._known.keys
        index = last_position_at_or_before(known, those)
        if len(known) and bool(((index >= 0) & (known.tick[index] == those.tick)).all()):
            return index
        order = those.sort_indices()
        every = union_of_instants([known, those if order is None else those.take(order)])
        old, before = last_position_at_or_before(every, known), self._known
        self._known = AlertMemory.new(self._rule, every.run.copy(), every.tick.copy())
        self._write_rows(old, before)
        return last_position_at_or_before(every, those)
