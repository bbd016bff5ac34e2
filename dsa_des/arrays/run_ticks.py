"""Instants of several runs, each run's together and in order: where one lies among others.

Ticks count from the start of their own run, so an instant is a run and a tick. What searches among
instants comes here: how two numbers are compared as one is nobody else's business.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from dsa_des.arrays.sorted_union import last_at_or_before, sorted_union
from dsa_des.arrays.types import BoolArray, IntArray

_ZERO = np.zeros((), dtype=np.int64)
_ZERO.flags.writeable = False
#: One number, seen as often as a run may have rows: a slice of it is made in no time.
_ZEROS: IntArray = np.ndarray((1 << 40,), np.int64, buffer=_ZERO, strides=(0,))
# Keys stay below this.
_MOST = 1 << 62


def no_runs(rows: int) -> IntArray:
    """Return the runs of rows of a single run: 0, seen `rows` times."""
    return _ZEROS[:rows]


def says_no_runs(run: IntArray) -> bool:
    """Return whether runs come from `no_runs`."""
    return run.base is _ZERO


def joined_runs(parts: Sequence[IntArray]) -> IntArray:
    """Return the runs of the rows of all parts, one after the other."""
    if all(part.base is _ZERO for part in parts):
        return no_runs(sum(map(len, parts)))
    return np.concatenate(parts)


@dataclass(frozen=True, eq=False, slots=True)
class RunTicks:
    """Instants, in order of run and then of tick unless it is said otherwise.

    Parameters
    ----------
    run, tick : (n,) of int64
        A single run is run 0.
    """

    run: IntArray
    tick: IntArray

    def __len__(self) -> int:
        return len(self.tick)

    @classmethod
    def none(cls) -> "RunTicks":
        """Return no instants."""
        return cls(no_runs(0), np.empty(0, dtype=np.int64))

    @classmethod
    def of_run(cls, run: int, tick: IntArray) -> "RunTicks":
        """Return instants of one run."""
        runs = no_runs(len(tick)) if run == 0 else np.full(len(tick), run, dtype=np.int64)
        return cls(runs, tick)

    @classmethod
    def joined(cls, parts: Sequence["RunTicks"]) -> "RunTicks":
        """Return the instants of all parts, one after the other, in whatever order that is."""
        if len(parts) == 1:
            return parts[0]
        ticks = np.concatenate([part.tick for part in parts])
        return cls(joined_runs([part.run for part in parts]), ticks)

    def take(self, rows: slice | IntArray | BoolArray) -> "RunTicks":
        """Return some of them."""
        tick = self.tick[rows]
        return RunTicks(no_runs(len(tick)) if says_no_runs(self.run) else self.run[rows], tick)

    def later(self, ticks: int | IntArray) -> "RunTicks":
        """Return instants of the same runs so much later."""
        return RunTicks(self.run, self.tick + ticks)

    def at_most(self, end: int) -> int:
        """Return how many there are before a tick, where all are of one run."""
        return len(self) if self.tick[-1] < end else int(np.searchsorted(self.tick, end))

    @property
    def one_run(self) -> bool:
        """Whether all, which are in order, are of one run."""
        return says_no_runs(self.run) or len(self) == 0 or bool(self.run[0] == self.run[-1])

    @property
    def last_of_each(self) -> IntArray:
        """The place of the last instant of each run."""
        if len(self) == 0 or self.one_run:
            return np.arange(len(self))[-1:]
        return np.flatnonzero(np.append(self.run[1:] != self.run[:-1], True))

    @property
    def first_of_each(self) -> IntArray:
        """The place of the first instant of each run."""
        if len(self) == 0 or self.one_run:
            return np.arange(len(self))[:1]
        return np.flatnonzero(np.append(True, self.run[1:] != self.run[:-1]))

    def order(self) -> IntArray | None:
        """Return what puts them in order, those of one instant as they stand; None if they are."""
        if len(self) < 2:
            return None
        (key,) = _keys(self)
        if bool((key[1:] >= key[:-1]).all()):
            return None
        return np.argsort(key, kind="stable")

    def newest(self) -> "RunTicks":
        """Return for each the latest instant so far of its run; ticks need be in no order."""
        if self.one_run:
            return RunTicks(self.run, np.maximum.accumulate(self.tick))
        firsts = self.first_of_each
        parts = np.split(self.tick, firsts[1:])
        return RunTicks(self.run, np.concatenate([np.maximum.accumulate(p) for p in parts]))

    def before(self, run: int, tick: int) -> int:
        """Return how many lie before a tick of a run."""
        if says_no_runs(self.run):
            return len(self) if run > 0 else int(np.searchsorted(self.tick, tick))
        first, last = np.searchsorted(self.run, [run, run + 1]).tolist()
        return int(first + np.searchsorted(self.tick[first:last], tick))


def _one_run(parts: Sequence[RunTicks]) -> bool:
    """Whether all parts, which are in order, are of the same run."""
    if all(says_no_runs(part.run) for part in parts):
        return True
    filled = [part.run for part in parts if len(part)]
    return not filled or all(run[0] == filled[0][0] == run[-1] for run in filled)


def _keys(*parts: RunTicks) -> list[IntArray]:
    """Return numbers that lie as the instants do, also where these are in no order."""
    if all(says_no_runs(part.run) for part in parts):
        return [part.tick for part in parts]
    return _coded(parts)[0]


def _coded(parts: Sequence[RunTicks]) -> tuple[list[IntArray], int, int]:
    """Return a number for each instant, how many bits of it are the tick's, and the tick of 0.

    Where runs and ticks do not go into one number, ranks of the ticks do, and there are -1 bits.
    """
    filled = [part for part in parts if len(part)]
    runs = max((int(part.run.max()) for part in filled), default=0) + 1
    earliest = min((int(part.tick.min()) for part in filled), default=0)
    earliest = min(earliest, 0)
    bits = (max((int(part.tick.max()) for part in filled), default=0) - earliest).bit_length()
    if runs << bits < _MOST:
        keys = [part.run << bits for part in parts]
        for key, part in zip(keys, parts, strict=True):
            key += part.tick
            if earliest:
                key -= earliest
        return keys, bits, earliest
    ticks, rank = np.unique(np.concatenate([part.tick for part in parts]), return_inverse=True)
    ends = np.cumsum([len(part) for part in parts])[:-1]
    ranks: Any = np.split(rank.reshape(-1), ends)
    keys = [part.run * len(ticks) + rank for part, rank in zip(parts, ranks, strict=True)]
    return keys, -1, 0


def union(parts: Sequence[RunTicks]) -> RunTicks:
    """Return every instant once, in order; each part is in order."""
    if _one_run(parts):
        ticks = sorted_union([part.tick for part in parts])
        run = next((int(part.run[0]) for part in parts if len(part)), 0)
        return RunTicks.of_run(run, ticks)
    keys, bits, earliest = _coded(parts)
    if bits < 0:
        _, first = np.unique(np.concatenate(keys), return_index=True)
        return RunTicks.joined(parts).take(first)
    every = sorted_union(keys)
    runs = every >> bits
    every -= runs << bits
    return RunTicks(runs, every + earliest if earliest else every)


def last_of_run(instants: RunTicks, asked: RunTicks) -> IntArray:
    """Return the place of the last instant at or before each that is asked for, of its run.

    Parameters
    ----------
    instants : RunTicks
        In order.
    asked : RunTicks
        Each run's together, its ticks in any order.

    Returns
    -------
    (n,) of int64
        -1 where the run has none.
    """
    if len(instants) == 0:
        return np.full(len(asked), -1, dtype=np.int64)
    if instants.tick is asked.tick and instants.run is asked.run:
        return np.arange(len(asked))
    if _one_run((instants, asked)):
        return last_at_or_before(instants.tick, asked.tick)
    if _alike(instants, asked):
        return np.arange(len(asked))
    places = last_at_or_before(*_keys(instants, asked))
    other = instants.run[places] != asked.run
    if other.any():
        places[other] = -1
    return places


def _alike(some: RunTicks, others: RunTicks) -> bool:
    """Whether all instants are the same, and no two that follow each other are."""
    if len(some) != len(others) or not np.array_equal(some.tick, others.tick):
        return False
    same = some.run is others.run or np.array_equal(some.run, others.run)
    return same and bool((some.tick[1:] != some.tick[:-1]).all())


def ranks(*parts: RunTicks) -> tuple[list[IntArray], int]:
    """Return the number of each instant among all there are, and how many these are."""
    keys = _keys(*parts)
    every, rank = np.unique(np.concatenate(keys), return_inverse=True)
    ends = np.cumsum([len(key) for key in keys])[:-1]
    return np.split(rank.reshape(-1), ends), len(every)


def next_of_run(instants: RunTicks, asked: RunTicks) -> IntArray:
    """Return the place of the first instant at or after each that is asked for, of its run.

    Where its run has none so late it is the place behind the run's last one.
    """
    if _one_run((instants, asked)):
        return np.searchsorted(instants.tick, asked.tick)
    keys = _keys(instants, asked)
    return np.searchsorted(keys[0], keys[1])


def first_of_run(instants: RunTicks, run: IntArray) -> IntArray:
    """Return the place of the first instant of some runs."""
    return np.searchsorted(instants.run, run)
