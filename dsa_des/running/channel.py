"""Wires: rows on their way to an input, what is lost or late, and what a block sees when it runs.

Rows are kept in order of arrival. A look-ahead sender may deposit rows long before they arrive; a
reader only ever sees those that have arrived by the instant it asks about. What a block sees is
the same whether SimPy wakes it, at whatever grain, or a host program calls it.
"""

from collections import deque
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, Protocol

import numpy as np

from dsa_des.arrays.run_ticks import RunTicks, last_position_at_or_before, union_of_instants
from dsa_des.arrays.types import BoolArray, IntArray
from dsa_des.block.component import Input
from dsa_des.block.message import Message
from dsa_des.block.wake import Arrivals, Wake
from dsa_des.running.effects import WireFaults
from dsa_des.time.clock import MAX_TICK
from dsa_des.time.timeline_runs import Runs

#: Rows and when they arrive.
Rows = tuple[RunTicks, Message]
# So many messages are kept before the last row of each run is sought in them.
_MOST_PASSED = 16


class Channel:
    """The message rows on their way over one wire to an input, ordered by run, then arrival.

    Every window takes what arrives in its stretch of time; what each run holds is remembered until
    it has ended.

    It takes `delay_ticks`; rows that are late (`faults`) may be overtaken; what arrives when its
    run has ended (`runs`) does not.
    """

    def __init__(
        self,
        source: str,
        delay_ticks: int = 0,
        faults: WireFaults | None = None,
        runs: Runs | None = None,
    ) -> None:
        self.source = source
        #: From what carries the receiver messages are seen; empty for as they are.
        self.platform = ""
        self.delay_ticks = delay_ticks
        self._faults = faults
        self._runs = Runs() if runs is None else runs
        #: Arrivals of rows, which are the last ones of the message beside them.
        self._waiting: deque[Rows] = deque()
        #: What was collected; the last row of each run is held.
        self._passed: list[Rows] = []
        #: First arrival of every message pushed since `watch`.
        self._pushed: list[int] | None = None

    def set_held_message(self, message: Message, tick: int) -> None:
        """Make `message` the one held by the input in every run, as if it arrived at `tick`."""
        if (count := self._runs.count) == 1:
            self._passed = [(RunTicks.of_run(0, np.array([tick], dtype=np.int64)), message)]
            return
        held = type(message).concatenate([message] * count).with_runs(np.arange(count))
        self._passed = [(RunTicks(held.run, np.full(count, tick, dtype=np.int64)), held)]

    def state(self) -> tuple[Any, Any]:
        """Return the waiting and the held rows, to be restored by `set_state`."""
        return tuple(self._waiting), tuple(self._passed)

    def set_state(self, state: tuple[Any, Any]) -> None:
        """Restore waiting and held rows that `state` returned."""
        self._waiting, self._passed = deque(state[0]), list(state[1])

    def record_pushed_arrivals(self) -> None:
        """Start anew to record the first arrival tick of every message that is pushed."""
        self._pushed = []

    def earliest_pushed_tick(self) -> int | None:
        """Return the earliest arrival tick pushed since recording began; None if there are none."""
        return min(self._pushed) if self._pushed else None

    def push(self, message: Message, sent: int | IntArray | None = None) -> RunTicks:
        """Add a message; return (run, tick) at which rows not lost will arrive, in order.

        `sent` is the tick at which it was sent, or each of its rows, when that is later than their
        own.
        """
        arrivals = message.instants
        if self.platform:
            message = message.seen_from(self.platform)
        if sent is not None:
            arrivals = RunTicks(message.run, np.full(len(message), sent, dtype=np.int64))
        if self.delay_ticks:
            arrivals = arrivals.add_ticks(self.delay_ticks)
        if self._faults is not None:
            made = message.instants
            kept = np.flatnonzero(self._faults.is_kept(made))
            arrivals, message = arrivals.take(kept), message.take(kept)
            arrivals = arrivals.add_ticks(self._faults.lateness_ticks(made.take(kept)))
            if (order := arrivals.sort_indices()) is not None:
                arrivals, message = arrivals.take(order), message.take(order)
        if self._runs.count > 1 and (self.delay_ticks or self._faults is not None):
            # What would arrive after its run does not: nothing would wait for it there.
            arrivals, message = _select_rows(
                arrivals, message, arrivals.tick < self._runs.run_ticks
            )
        if len(arrivals) == 0:
            return arrivals
        self._waiting.append((arrivals, message))
        if self._pushed is not None:
            self._pushed.append(int(arrivals.tick[0]))
        return arrivals

    def drop_superseded_rows(self, tick: int) -> None:
        """Drop waiting rows that no reader at `tick` or later can see, as newer ones replace them.

        A slow sensor behind a fast one would otherwise let a message wait for each window between
        two of its scans. Where several runs go, a row is superseded in its own only.
        """
        if self._faults is None and len(self._runs.going) == 1:
            while len(self._waiting) > 1 and self._waiting[1][0].tick[0] <= tick:
                self._waiting.popleft()

    def arrivals_before(self, end: int) -> RunTicks:
        """Return the (run, tick) of the waiting rows that arrive before `end`; none is removed."""
        arriving = []
        for arrivals, _ in self._waiting:
            due = self._count_or_mask_before(arrivals, end)
            part = arrivals.take(slice(due) if isinstance(due, int) else due)
            if len(part.tick):
                arriving.append(part)
        if not arriving:
            return RunTicks.empty()
        if self._faults is None and 1 in (len(arriving), len(self._runs.going)):
            return RunTicks.concatenate(arriving)
        return union_of_instants(arriving)  # late rows overtake and may coincide

    def earliest_waiting_tick(self) -> int:
        """Return the earliest arrival tick of the waiting rows; `MAX_TICK` if none wait."""
        return min((int(arrivals.tick.min()) for arrivals, _ in self._waiting), default=MAX_TICK)

    def _count_or_mask_before(self, arrivals: RunTicks, end: int) -> int | BoolArray:
        """Return which rows arrive before `end`: their number if they come first, else a mask."""
        if len(self._runs.going) == 1:
            return arrivals.count_before_end(end)
        if end >= self._runs.run_ticks:
            return len(arrivals)
        due = arrivals.tick < end
        return len(arrivals) if due.all() else due

    def pop_arrived_rows(self, end: int) -> Rows | None:
        """Remove and return rows that arrive before `end`, in order of arrival; None if none do."""
        if not self._waiting:
            return None
        taken: list[Rows] = []
        left: deque[Rows] = deque()
        one, first = self._runs.count == 1, self._runs.going.start
        while self._waiting:
            arrivals, message = self._waiting.popleft()
            if not one and arrivals.run[-1] < first:
                continue  # of a run that has ended before they came
            due = self._count_or_mask_before(arrivals, end)
            if not isinstance(due, int):
                rows, others = np.flatnonzero(due), np.flatnonzero(~due)
                if len(rows):
                    taken.append((arrivals.take(rows), message.take(rows)))
                left.append((arrivals.take(others), message.take(others)))
                continue
            start = len(message.tick) - len(arrivals.tick)
            if due == len(arrivals.tick):
                taken.append((arrivals, message.take(slice(start, None)) if start else message))
                continue
            if due:
                part = message.take(slice(start, start + due))
                taken.append((arrivals.take(slice(due)), part))
            left.append((arrivals.take(slice(due, None)), message))
            if self._faults is None and one:
                break  # rows behind these arrive later still
        left.extend(self._waiting)
        self._waiting = left
        collected = concatenate_rows(taken)
        if collected is not None and len(taken) > 1:
            collected = _sort_rows(collected)
        if collected is None or not self._runs.early:
            return collected
        collected = _select_rows(*collected, self._runs.is_before_ends(collected[0]))
        return collected if len(collected[0]) else None

    def held_rows_at_instants(self, asked: RunTicks, end: int) -> tuple[Message, IntArray] | None:
        """Return (message, index of its row held at each instant); instants in order before `end`.

        With the message comes the row of it that is held at each instant, -1 when none has arrived.
        None: it holds nothing at all.
        """
        new = self.pop_arrived_rows(end)
        if new is not None:
            rows = last_position_at_or_before(new[0], asked)
            if rows[0] >= 0 and (len(rows) == 1 or bool((rows >= 0).all())):
                # What was before need not be looked up.
                self._keep_as_held(new, end)
                return new[1], rows
        before = concatenate_rows(self._passed)
        parts = [] if before is None else [_last_of_each_run(*_sort_rows(before))]
        held = concatenate_rows(parts if new is None else [*parts, new])
        if held is None:
            return None
        held = _sort_rows(held)
        self._passed = [held]
        if self._runs.count > 1:
            self._keep_last_rows(end)
        return held[1], last_position_at_or_before(held[0], asked)

    def _keep_as_held(self, new: Rows, end: int) -> None:
        """Keep collected rows as held; drop older ones where all simulated runs have new ones."""
        if self._runs.count == 1:
            self._passed = [new]
            return
        if self._has_all_runs(new[0]):  # nothing older is held by any run that goes
            stop = self._runs.going.stop
            self._passed = [part for part in self._passed if part[0].run[-1] >= stop]
        self._passed.append(new)
        if len(self._passed) > _MOST_PASSED or end >= self._runs.run_ticks:
            self._keep_last_rows(end)

    def _has_all_runs(self, arrivals: RunTicks) -> bool:
        """Return whether the arrivals include every run that is being simulated."""
        runs = self._runs.going
        if len(runs) == 1:
            return True
        if len(arrivals) < len(runs) and not self._runs.early:
            return False
        reached = arrivals.run[arrivals.last_position_of_runs]
        if self._runs.early:
            return self._runs.count_full_length(reached) == self._runs.count_full_length(
                np.array(runs)
            )
        return len(reached) == len(runs)

    def _keep_last_rows(self, end: int) -> None:
        """Reduce the held rows to the last collected one of each run that is being simulated."""
        runs = self._runs.going
        first = runs.stop if end >= self._runs.run_ticks else runs.start
        going = [part for part in self._passed if part[0].run[-1] >= first]
        held = concatenate_rows(going)
        self._passed = [] if held is None else [_last_of_each_run(*_sort_rows(held))]


def _select_rows(arrivals: RunTicks, message: Message, kept: BoolArray) -> Rows:
    if kept.all():
        return arrivals, message
    rows = np.flatnonzero(kept)
    return arrivals.take(rows), message.take(rows)


def _last_of_each_run(arrivals: RunTicks, message: Message) -> Rows:
    """Return the last row of each run, with its arrival."""
    if len(arrivals) == 1:
        return arrivals, message
    if arrivals.is_one_run:
        last = slice(len(arrivals) - 1, None)
        return arrivals.take(last), message.take(last)
    lasts = arrivals.last_position_of_runs
    return arrivals.take(lasts), message.take(lasts)


def _sort_rows(rows: Rows) -> Rows:
    """Return rows sorted by run and arrival; rows arriving at the same instant keep their order."""
    order = rows[0].sort_indices()
    return rows if order is None else (rows[0].take(order), rows[1].take(order))


def concatenate_rows(parts: Sequence[Rows]) -> Rows | None:
    """Return arrivals and rows of all parts joined in the order given; None if there are none."""
    if not parts:
        return None
    if len(parts) == 1:
        return parts[0]
    arrivals = RunTicks.concatenate([part[0] for part in parts])
    message = type(parts[0][1]).concatenate([part[1] for part in parts])
    return arrivals, message


class WireEnd(Protocol):
    """Interface of a wire's receiving end, which `dsa_des.running.channel.Channel` implements."""

    source: str

    def held_rows_at_instants(self, asked: RunTicks, end: int) -> tuple[Message, IntArray] | None:
        """Return (message, its row index held at each instant or -1); None if nothing is held."""

    def pop_arrived_rows(self, end: int) -> Rows | None:
        """Remove and return the rows that arrive before `end`; None if there are none."""


class Inputs:
    """The wires into a block, by whether the input holds the latest message or queues them all."""

    def __init__(
        self,
        declared: Mapping[str, Input],
        wires: Mapping[str, Sequence[WireEnd]],
        ticks_per_s: int,
        runs: Runs | None = None,
    ) -> None:
        every = [(port, wire) for port in declared for wire in wires.get(port, ())]
        self._held = [(p, wire, declared[p].required) for p, wire in every if declared[p].is_held]
        self._queued = [(p, wire) for p, wire in every if not declared[p].is_held]
        self._ticks_per_s = ticks_per_s
        self._runs = Runs() if runs is None else runs

    def make_wake(
        self,
        asked: RunTicks,
        scans: IntArray,
        end: int,
        demand: Callable[[RunTicks], Mapping[str, IntArray]] | None = None,
        *,
        clock: Callable[[IntArray, IntArray], IntArray] | None = None,
        idle: BoolArray | None = None,
        complete: bool = True,
    ) -> Wake | None:
        """Return the `Wake` of what the block sees at the instants; None if it can run at none.

        `scans`, `clock`, `idle` are as for `Wake`; `end` is the first tick that is no longer seen;
        `demand`, given the instants of the wake, returns what `Wake.demand` is. Where `complete`,
        instants are left out at which a required input holds nothing yet.
        """
        held: dict[str, tuple[Message, IntArray]] = {}
        missing: np.ndarray | None = None
        for port, wire, required in self._held:
            sample = wire.held_rows_at_instants(asked, end)
            if sample is not None:
                held[port] = sample
            if required and complete and _lacks_row_at_some_instant(sample):
                absent = np.ones(len(asked), bool) if sample is None else sample[1] < 0
                missing = absent if missing is None else missing | absent
        if missing is not None:  # before the first messages
            there = np.flatnonzero(~missing)
            if len(there) == 0:
                return None
            asked, scans = asked.take(there), scans[there]
            idle = None if idle is None else idle[there]
            held = {port: (message, rows[there]) for port, (message, rows) in held.items()}
        arrived: dict[str, list[Arrivals]] = {}
        for port, wire in self._queued:
            new = wire.pop_arrived_rows(end)
            if new is not None:
                arrived.setdefault(port, []).append(Arrivals(wire.source, *new))
        rows = None if demand is None else partial(demand, asked)
        first, per_s = self._runs.going.start, self._ticks_per_s
        return Wake(asked, scans, per_s, held, arrived, rows, first, clock, idle)


def _lacks_row_at_some_instant(sample: tuple[Message, IntArray] | None) -> bool:
    if sample is None:
        return True
    rows = sample[1]
    return bool(rows[0] < 0 if len(rows) == 1 else (rows < 0).any())
