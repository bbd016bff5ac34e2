"""What an alerting logic remembers of its targets: hysteresis, m of n, persistence."""

from dataclasses import dataclass

import numpy as np

from dsa_des.arrays.types import BoolArray, IntArray

_NONE = -1
# The time of what has not been yet.
_LONG_AGO_S = -np.inf


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
    """The remembered state of targets 0 ... count - 1 of one ownship.

    Parameters
    ----------
    rule : MemoryRule
    count : int
    """

    def __init__(self, rule: MemoryRule, count: int) -> None:
        self._rule = rule
        self._count = count
        self._clear()
        self._own_time_s = np.nan

    def _clear(self) -> None:
        count, rule = self._count, self._rule
        self._last_s = np.full(count, _LONG_AGO_S)
        self._output = np.full(count, _NONE, dtype=np.int64)
        self._risen_s = np.full(count, _LONG_AGO_S)
        self._queue = np.full((count, max(rule.n, 1)), _NONE, dtype=np.int64)

    def step(self, now_s: float, present: BoolArray, due: BoolArray, early: BoolArray) -> IntArray:
        """Take in one instant and return the level of each target.

        Parameters
        ----------
        now_s : float
            The ownship's time.
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
        if step_s < 0.0 or step_s > rule.hysteresis_s:
            self._clear()
        self._own_time_s = now_s
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
        self._risen_s[rises] = now_s
        level = np.where(held, self._output, np.maximum(counted, 0))
        self._output = np.where(present, level, self._output)
        self._last_s = np.where(present, now_s, self._last_s)
        return level

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

    def _raw(self, now_s: float, due: BoolArray, early: BoolArray) -> IntArray:
        """Return the highest level that is due; the one that is on may be so early."""
        levels = np.arange(1, due.shape[1] + 1)
        before = self._last_s < now_s
        on = (self._output[:, np.newaxis] == levels) & before[:, np.newaxis]
        is_due = np.where(on, early, due)
        return np.asarray((is_due * levels).max(axis=1, initial=0))
