"""What an alerting logic remembers of its targets: hysteresis, m of n, persistence."""

from dataclasses import dataclass

import numpy as np

from dsa_des.arrays.types import BoolArray, FloatArray, IntArray

_NONE = -1
# The time of what has not been yet.
_LONG_AGO_S = -np.inf
_COLUMNS = ("_last_s", "_output", "_risen_s", "_queue", "_own_time_s")


@dataclass(frozen=True)
class MemoryRule:
    """How long and how an alert level is remembered.

    Parameters
    ----------
    hysteresis_s : float
        A gap in time longer than this forgets everything; 0 remembers nothing.
    persistence_s : float
        A level that rose less than this ago does not fall.
    m, n : int
        The m-th largest of the last n levels counts; m = 0 takes each one as it is.
    """

    hysteresis_s: float
    persistence_s: float
    m: int
    n: int


class AlertMemory:
    """The remembered state of targets 0 ... count - 1, of one ownship or of several.

    Parameters
    ----------
    rule : MemoryRule
    count : int
    """

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
        """Take in one instant and return the level of each target.

        Parameters
        ----------
        now_s : float or (targets,)
            The time of the ownship, or of each target's ownship.
        present : (targets,) of bool
            Who has a state now.
        due : (targets, levels) of bool
            Whether each level is due by its alerting time.
        early : (targets, levels) of bool
            Whether it is by its early alerting time.

        Returns
        -------
        (targets,) of int
            0 without an alert; meaningless for those who are absent.
        """
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

    def levels(
        self, times_s: FloatArray, present: BoolArray, due: BoolArray, early: BoolArray
    ) -> IntArray:
        """Take in some instants in order and return all levels, (instants * targets,)."""
        rows = enumerate(times_s.tolist())
        found = [self.step(now_s, present[i], due[i], early[i]) for i, now_s in rows]
        return np.concatenate(found)

    def early_levels(self, now_s: float, present: BoolArray) -> IntArray:
        """Return whose early alerting time counts for guidance: levels that rose before now.

        Parameters
        ----------
        now_s : float
            As in the last `step`.
        present : (targets,) of bool

        Returns
        -------
        (targets,) of int
            The level; 0 for none.
        """
        counts = present & (self._rule.hysteresis_s > 0.0) & (self._risen_s < now_s)
        return np.where(counts, np.maximum(self._output, 0), 0)

    def _raw(self, now_s: float | FloatArray, due: BoolArray, early: BoolArray) -> IntArray:
        """Return the highest level that is due; the one that is on may be so early."""
        levels = np.arange(1, due.shape[1] + 1)
        before = self._last_s < now_s
        on = (self._output[:, np.newaxis] == levels) & before[:, np.newaxis]
        is_due = np.where(on, early, due)
        return np.asarray((is_due * levels).max(axis=1, initial=0))
