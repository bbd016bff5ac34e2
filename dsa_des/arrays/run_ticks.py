"""Instants of several runs, each run's together and in order: where one lies among others.

Ticks count from the start of their own run, so an instant is a run and a tick. What searches among
instants comes here: how two numbers are compared as one is nobody else's business.
"""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from dsa_des.arrays.sorted_union import sorted_union_and_positions
from dsa_des.arrays.types import BoolArray, IntArray

_ZERO = np.zeros((), dtype=np.int64)
_ZERO.flags.writeable = False
#: One number, seen as often as a run may have rows: a slice of it is made in no time.
_ZEROS: IntArray = np.ndarray((1 << 40,), np.int64, buffer=_ZERO, strides=(0,))
# Keys stay below this.
_MOST = 1 << 62
# Of fewer rows a search costs less than to look whether they are the same.
_MANY = 64
# A tick has at least so many bits of a key (two hours of ns either way), so that the keys that an
# array of instants keeps serve whatever it is compared with.
_LEAST_BITS = 44


def shared_zero_run_numbers(rows: int) -> IntArray:
    """Return the run number of `rows` rows of a single run: zeros, which are stored once."""
    return _ZEROS[:rows]


def is_shared_single_run(run: IntArray) -> bool:
    """Return whether run numbers are the shared zeros of a single run, not merely equal values."""
    return run.base is _ZERO


def take_runs(run: IntArray, rows: IntArray) -> IntArray:
    """Return the run numbers of the rows at the given indices."""
    return shared_zero_run_numbers(len(rows)) if run.base is _ZERO else run[rows]


def concatenate_runs(parts: Sequence[IntArray]) -> IntArray:
    """Return the runs of the rows of all parts, one after the other."""
    if all(part.base is _ZERO for part in parts):
        return shared_zero_run_numbers(sum(map(len, parts)))
    return np.concatenate(parts)


@dataclass(eq=False, slots=True)
class RunTicks:
    """Instants, in order of run and then of tick unless it is said otherwise.

    Parameters
    ----------
    run, tick : (n,) of int64
        A single run is run 0.
    """

    run: IntArray
    tick: IntArray
    #: Keys that were asked for, with the bits of a tick in them, and what bounds these.
    _keys: tuple[int, IntArray] | None = field(default=None, init=False, repr=False)
    _extent: tuple[int, int] | None = field(default=None, init=False, repr=False)
    #: Parts of them, and the positions of each part's instants.
    _parts: list[tuple["RunTicks", IntArray]] = field(default_factory=list, init=False, repr=False)

    def __len__(self) -> int:
        return len(self.tick)

    @classmethod
    def empty(cls) -> "RunTicks":
        """Return an empty set of instants."""
        return cls(shared_zero_run_numbers(0), np.empty(0, dtype=np.int64))

    @classmethod
    def of_run(cls, run: int, tick: IntArray) -> "RunTicks":
        """Return instants of one run."""
        runs = (
            shared_zero_run_numbers(len(tick))
            if run == 0
            else np.full(len(tick), run, dtype=np.int64)
        )
        return cls(runs, tick)

    @classmethod
    def concatenate(cls, parts: Sequence["RunTicks"]) -> "RunTicks":
        """Return the instants of all parts, one after the other, without sorting them."""
        if len(parts) == 1:
            return parts[0]
        ticks = np.concatenate([part.tick for part in parts])
        return cls(concatenate_runs([part.run for part in parts]), ticks)

    def take(self, rows: slice | IntArray | BoolArray) -> "RunTicks":
        """Return the instants at the given indices, in the slice, or where the mask is True."""
        if isinstance(rows, slice):
            count = len(self.tick)
            if rows.indices(count) == (0, count, 1):
                return self
        tick = self.tick[rows]
        return RunTicks(
            shared_zero_run_numbers(len(tick))
            if is_shared_single_run(self.run)
            else self.run[rows],
            tick,
        )

    def take_with_known_positions(self, rows: IntArray) -> "RunTicks":
        """Return the instants at ascending indices `rows`, and remember these for fast searches."""
        some = self.take(rows)
        self._parts.append((some, rows))
        return some

    def add_ticks(self, ticks: int | IntArray) -> "RunTicks":
        """Return instants of the same runs with `ticks` added to their ticks."""
        return RunTicks(self.run, self.tick + ticks)

    def count_before_end(self, end: int) -> int:
        """Return how many instants are before the tick `end`; all are of one run and ascending."""
        return len(self.tick) if self.tick[-1] < end else int(self.tick.searchsorted(end))

    @property
    def is_one_run(self) -> bool:
        """Whether all instants, which are sorted by run, are of one run."""
        run = self.run
        return is_shared_single_run(run) or len(run) == 0 or bool(run[0] == run[-1])

    @property
    def last_position_of_runs(self) -> IntArray:
        """The index of the last instant of each run, ascending."""
        if len(self) == 0 or self.is_one_run:
            return np.arange(len(self))[-1:]
        # A search for each run: they are far fewer than the instants.
        numbers = np.arange(self.run[0], self.run[-1] + 1)
        ends = np.searchsorted(self.run, numbers, side="right") - 1
        return ends[np.append(True, ends[1:] != ends[:-1])]

    @property
    def first_position_of_runs(self) -> IntArray:
        """The index of the first instant of each run, ascending."""
        if len(self) == 0 or self.is_one_run:
            return np.zeros(min(1, len(self)), dtype=np.int64)
        return np.append(0, self.last_position_of_runs[:-1] + 1)

    def sort_indices(self) -> IntArray | None:
        """Return indices that sort by run and tick, stably; None if sorted already."""
        if len(self) < 2:
            return None
        (key,) = _sortable_keys_and_tick_bits(self)[0]
        if bool((key[1:] >= key[:-1]).all()):
            return None
        return np.argsort(key, kind="stable")

    def running_largest_tick(self) -> "RunTicks":
        """Return the largest tick up to each row in its run; runs are sorted, ticks need not be."""
        if self.is_one_run:
            return RunTicks(self.run, np.maximum.accumulate(self.tick))
        # As one number, a tick of a later run is larger than all of the runs before.
        first, span = int(self.tick.min()), int(self.tick.max()) - int(self.tick.min()) + 1
        if span * (int(self.run[-1]) - int(self.run[0]) + 1) < 2**63:
            of_run = (self.run - self.run[0]) * span
            return RunTicks(
                self.run, np.maximum.accumulate(self.tick - first + of_run) - of_run + first
            )
        parts = np.split(self.tick, self.first_position_of_runs[1:])
        return RunTicks(self.run, np.concatenate([np.maximum.accumulate(p) for p in parts]))

    def count_before_run_tick(self, run: int, tick: int) -> int:
        """Return how many instants are before a tick of a run, earlier runs' all included."""
        if is_shared_single_run(self.run):
            return len(self) if run > 0 else int(np.searchsorted(self.tick, tick))
        first, last = np.searchsorted(self.run, [run, run + 1]).tolist()
        return int(first + np.searchsorted(self.tick[first:last], tick))


def _is_same_run(parts: Sequence[RunTicks]) -> bool:
    """Return whether all parts' instants, in any order, are of one and the same run."""
    for part in parts:
        if part.run.base is not _ZERO:
            break
    else:
        return True
    filled = [part.run for part in parts if len(part)]
    # Mostly they are sorted, so that both ends tell.
    return not filled or all(
        run[0] == filled[0][0] == run[-1] and bool((run == run[0]).all()) for run in filled
    )


def _sortable_keys_and_tick_bits(*parts: RunTicks) -> tuple[list[IntArray], int]:
    """Return for each part one integer per instant that sorts like (run, tick), and how many low
    bits of it are the tick (-1 where it has no such bits).

    Instants may be in no order. Where runs and ticks do not go into one number, ranks of the ticks
    do, and there are -1 bits.
    """
    if all(is_shared_single_run(part.run) for part in parts):
        return [part.tick for part in parts], -1
    extents = [_largest_tick_and_run(part) for part in parts]
    bits = max(_LEAST_BITS, max(most.bit_length() for most, _ in extents) + 1)
    if (max(runs for _, runs in extents) + 1) << bits < _MOST:
        return [_sortable_key(part, bits) for part in parts], bits
    ticks, rank = np.unique(np.concatenate([part.tick for part in parts]), return_inverse=True)
    ends = np.cumsum([len(part) for part in parts])[:-1]
    ranks: Any = np.split(rank.reshape(-1), ends)
    return [part.run * len(ticks) + rank for part, rank in zip(parts, ranks, strict=True)], -1


def _largest_tick_and_run(part: RunTicks) -> tuple[int, int]:
    """Return the largest absolute tick and the largest run number."""
    if part._extent is None:
        tick, run = part.tick, part.run
        most = max(int(tick.max()), -int(tick.min())) if len(tick) else 0
        part._extent = most, int(run.max()) if len(run) else 0
    return part._extent


def _sortable_key(part: RunTicks, bits: int) -> IntArray:
    """Return run · 2**bits + tick of each instant: it sorts like (run, tick), even if tick < 0."""
    if part._keys is None or part._keys[0] != bits:
        key = part.run << bits
        key += part.tick
        part._keys = bits, key
    return part._keys[1]


#: What was put together last, and the unions: several blocks ask for that of the same instants.
_unions: deque[tuple[set[RunTicks], RunTicks]] = deque(maxlen=2)


def union_of_instants(parts: Sequence[RunTicks]) -> RunTicks:
    """Return all distinct instants of the sorted parts, in order of run and tick."""
    for put_together, known in _unions:
        if put_together == set(parts):  # the same objects
            return known
    if _is_same_run(parts):
        ticks, positions = sorted_union_and_positions([part.tick for part in parts])
        run = next((int(part.run[0]) for part in parts if len(part)), 0)
        instants = RunTicks.of_run(run, ticks)
    else:
        keys, bits = _sortable_keys_and_tick_bits(*parts)
        every, positions = sorted_union_and_positions(keys)
        if bits < 0:
            rows = np.empty(len(every), dtype=np.int64)
            rows[np.concatenate(positions)] = np.arange(sum(map(len, parts)))
            instants = RunTicks.concatenate(parts).take(rows)
        else:
            runs = (every + (1 << (bits - 1))) >> bits
            instants = RunTicks(runs, every - (runs << bits))
            instants._keys = bits, every
    for position in positions:
        position.flags.writeable = False  # whoever asks is given it
    instants._parts = list(zip(parts, positions, strict=True))
    _unions.append((set(parts), instants))
    return instants


def _remembered_positions(instants: RunTicks, part: RunTicks) -> IntArray | None:
    """Return the indices of `part` in `instants` if they were remembered, else None."""
    for one, positions in instants._parts:
        if one is part:
            return positions
    return None


def last_position_at_or_before(instants: RunTicks, asked: RunTicks) -> IntArray:
    """Return the index in `instants` of the last at or before each of `asked` in its run, or -1."""
    return _last_positions_and_surely_all_met(instants, asked)[0]


def _last_positions_and_surely_all_met(
    instants: RunTicks, asked: RunTicks
) -> tuple[IntArray, bool]:
    """Return the index of the latest instant of the same run at or before each asked one (or -1),
    and whether all asked ones are known to be in `instants`.
    """
    there, count = len(instants.tick), len(asked.tick)
    if there == 0:
        return np.full(count, -1, dtype=np.int64), False
    if instants.tick is asked.tick and instants.run is asked.run:
        return np.arange(count), True
    if (known := _remembered_positions(instants, asked)) is not None:
        return known, True
    one_run = _is_same_run((instants, asked))
    known_keys, keys = (
        (instants.tick, asked.tick) if one_run else _sortable_keys_and_tick_bits(instants, asked)[0]
    )
    # As for blocks that run at the same instants; a search would take a tenth of a whole run.
    same = there == count >= _MANY and bool((known_keys == keys).all())
    if same and bool((keys[1:] > keys[:-1]).all()):
        return np.arange(count), True
    positions = known_keys.searchsorted(keys, side="right") - 1
    if not one_run:
        other = instants.run[positions] != asked.run
        if other.any():
            positions[other] = -1
    return positions, False


def positions_with_found_mask(
    instants: RunTicks, asked: RunTicks
) -> tuple[IntArray, BoolArray | None]:
    """Return the index in `instants` of the last at or before each asked one in its run (else -1),
    and a mask of those met exactly (None: all).
    """
    positions, met = _last_positions_and_surely_all_met(instants, asked)
    if met or len(instants) == 0:
        return positions, None if met else np.zeros(len(asked), dtype=bool)
    there: BoolArray = (positions >= 0) & (instants.tick[positions] == asked.tick)
    return positions, None if there.all() else there


def rank_instants(*parts: RunTicks) -> tuple[list[IntArray], int]:
    """Return, per part, its instants' ranks among all distinct ones, and the number of these."""
    keys, _ = _sortable_keys_and_tick_bits(*parts)
    every, rank = np.unique(np.concatenate(keys), return_inverse=True)
    ends = np.cumsum([len(key) for key in keys])[:-1]
    return np.split(rank.reshape(-1), ends), len(every)


def first_position_at_or_after(instants: RunTicks, asked: RunTicks) -> IntArray:
    """Return the index of the first at or after each of `asked` in its run, or that behind the run.

    Where its run has none so late it is the position behind the run's last one.
    """
    if _is_same_run((instants, asked)):
        return instants.tick.searchsorted(asked.tick)
    keys, _ = _sortable_keys_and_tick_bits(instants, asked)
    return keys[0].searchsorted(keys[1])


def first_position_in_runs(instants: RunTicks, run: IntArray) -> IntArray:
    """Return the index in `instants` of each given run's first instant, or where it would stand."""
    return instants.run.searchsorted(run)
