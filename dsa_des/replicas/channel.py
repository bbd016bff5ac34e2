"""The buffer at the receiving end of one wire, for the rows of all replicas in lock step.

Rows stand in order of replica, then of arrival. Every window takes what arrives in its stretch of
time, and what each replica holds is remembered until the next, or until it ends.
"""

from collections import deque
from dataclasses import dataclass

import numpy as np

from dsa_des.arrays.sorted_union import last_at_or_before, sorted_union
from dsa_des.arrays.types import BoolArray, FloatArray, IntArray
from dsa_des.block.message import Message
from dsa_des.running.channel import Channel, WireFaults, joined
from dsa_des.time.clock import nanosecond_of
from dsa_des.time.randomness import Stream
from dsa_des.time.run_ends import RunEnds
from dsa_des.time.timeline import ReplicaTime, first_scan

# So many messages are kept before the last row of each replica is sought in them.
_MOST_PASSED = 16


@dataclass(frozen=True)
class ReplicaWireFaults(WireFaults):
    """Keyed faults of a wire in every replica; its streams are those of replicas.

    Parameters
    ----------
    span_ticks : int
        From one replica's start to the next.
    """

    span_ticks: int = 0

    def _drawn(self, stream: Stream, ticks: IntArray) -> FloatArray:
        replica, own = np.divmod(ticks, self.span_ticks)
        instant = nanosecond_of(own, self.ticks_per_s).astype(np.uint64)
        return stream.uniform(instant, replica * first_scan(1))


class ReplicaChannel(Channel):
    """Rows on their way to one input, of many replicas.

    Parameters
    ----------
    source, delay_ticks, faults
        As for `Channel`.
    time : ReplicaTime
    ends : RunEnds
        What arrives at the end of its run, or later, does not.
    """

    def __init__(
        self,
        source: str,
        delay_ticks: int,
        faults: WireFaults | None,
        time: ReplicaTime,
        ends: RunEnds,
    ) -> None:
        super().__init__(source, delay_ticks, faults)
        self._time, self._span, self._ends = time, time.span_ticks, ends
        #: What was sampled since `_last` was made.
        self._passed: list[tuple[IntArray, Message]] = []

    def hold(self, message: Message, tick: int) -> None:
        """Make `message` the last arrived one in every replica, as if it had come at `tick`."""
        begin = np.arange(self._time.replicas, dtype=np.int64) * self._span
        starts = enumerate(begin.tolist())
        held = [message.shifted(start, first_scan(number)) for number, start in starts]
        self._last = begin + tick, type(message).concatenate(held)

    def push(self, message: Message, sent: int | IntArray | None = None) -> IntArray:
        """Deposit a message and return the ticks at which its rows arrive, in order."""
        arrivals = message.tick + self.delay_ticks if self.delay_ticks else message.tick
        if self._faults is None and not self.delay_ticks:
            self._waiting.append((arrivals, message))
            return arrivals
        start = message.tick - message.tick % self._span
        kept = np.ones(len(arrivals), dtype=bool)
        if self._faults is not None:
            kept = self._faults.kept(message.tick)
            arrivals = arrivals + self._faults.lateness(message.tick)
        # What would arrive after the end of its replica does not: nothing would wait for it there.
        kept &= arrivals - start < self._time.run_ticks
        if not kept.all():
            rows = np.flatnonzero(kept)
            arrivals, message = arrivals[rows], message.take(rows)
        if len(arrivals) == 0:
            return arrivals
        if self._faults is not None and bool((arrivals[1:] < arrivals[:-1]).any()):
            order = np.argsort(arrivals, kind="stable")
            arrivals, message = arrivals[order], message.take(order)
        self._waiting.append((arrivals, message))
        return arrivals

    def forget(self, tick: int) -> None:
        """Keep all: a row is superseded in its own replica only."""

    def next_arrivals(self, end: int) -> IntArray:
        """Return the ticks at which rows arrive before `end` that were not collected yet."""
        ticks = [arrivals[self._due(arrivals, end)] for arrivals, _ in self._waiting]
        ticks = [part for part in ticks if len(part)]
        if len(ticks) == 1 and self._faults is None:
            return ticks[0]
        return sorted_union(ticks) if ticks else np.empty(0, dtype=np.int64)

    def _due(self, arrivals: IntArray, end: int) -> slice | BoolArray:
        """Return which rows arrive before `end`."""
        if end >= self._time.run_ticks:
            return slice(None)
        due = arrivals % self._span < end
        return slice(None) if due.all() else due

    def collect(self, end: int) -> tuple[IntArray, Message] | None:
        """Remove and return the rows that arrive before `end`, or None."""
        taken: list[tuple[IntArray, Message]] = []
        left: deque[tuple[IntArray, Message]] = deque()
        for arrivals, message in self._waiting:
            due = self._due(arrivals, end)
            if isinstance(due, slice):
                taken.append((arrivals, message))
                continue
            rows, others = np.flatnonzero(due), np.flatnonzero(~due)
            if len(rows):
                taken.append((arrivals[rows], message.take(rows)))
            left.append((arrivals[others], message.take(others)))
        self._waiting = left
        return self._in_time(_in_order(taken))

    def _in_time(self, found: tuple[IntArray, Message] | None) -> tuple[IntArray, Message] | None:
        """Return the rows that arrive before their run has ended."""
        if found is None or not self._ends.early:
            return found
        kept = self._ends.before(found[0])
        if kept.all():
            return found
        rows = np.flatnonzero(kept)
        return (found[0][rows], found[1].take(rows)) if len(rows) else None

    def sample(self, ticks: IntArray, end: int) -> tuple[Message, IntArray] | None:
        """Return what the input holds in each replica at each of `ticks`; see `Channel.sample`."""
        new = self.collect(end)
        if new is not None:
            self._passed.append(new)
            rows = last_at_or_before(new[0], ticks)
            if bool((new[0][rows] == ticks).all()):
                # What has come at the very instant is held: what was before need not be looked up.
                if len(self._passed) > _MOST_PASSED or end >= self._time.run_ticks:
                    self._remember(end)
                elif self._of_all(new[0]):
                    self._passed = [new]  # nothing older is held by any replica
                    self._last = self._last if self._goes_on(self._last, end) else None
                return new[1], rows
        if self._last is not None:
            self._passed.insert(0, self._last)
        held = _in_order(self._passed)
        self._passed, self._last = [], held
        if held is None:
            return None
        arrivals, message = held
        rows = self._held_rows(arrivals, ticks)
        self._remember(end)
        return message, rows

    def _held_rows(self, arrivals: IntArray, ticks: IntArray) -> IntArray:
        """Return the row that is held at each tick; -1 where its replica holds nothing yet."""
        rows = last_at_or_before(arrivals, ticks)
        if not np.array_equal(arrivals[rows], ticks):
            rows[arrivals[rows] // self._span != ticks // self._span] = -1
        return rows

    def _of_all(self, arrivals: IntArray) -> bool:
        """Whether there is a row of every replica that goes on, of rows in order of replica."""
        runs = self._time.runs
        if len(arrivals) < len(runs) and not self._ends.early:
            return False
        replica = arrivals // self._span
        if self._ends.early:
            return self._ends.running(np.unique(replica)) == self._ends.running(np.array(runs))
        return 1 + int(np.count_nonzero(replica[1:] != replica[:-1])) == len(runs)

    def _remember(self, end: int) -> None:
        """Keep of what has passed the last row of each replica that goes on."""
        parts = ([] if self._last is None else [self._last]) + self._passed
        held = _in_order([part for part in parts if self._goes_on(part, end)])
        self._passed, self._last = [], None
        if held is not None:
            lasts = _last_of_each(held[0] // self._span)
            self._last = held[0][lasts], held[1].take(lasts)

    def _goes_on(self, part: tuple[IntArray, Message] | None, end: int) -> bool:
        """Whether a part holds rows of replicas that go on after a window, rather than passed."""
        runs = self._time.runs
        first = runs.stop if end >= self._time.run_ticks else runs.start
        return part is not None and bool(part[0][-1] >= first * self._span)


def _last_of_each(replica: IntArray) -> IntArray:
    """Return the place of the last row of each replica, of rows in order of replica."""
    return np.flatnonzero(np.append(replica[1:] != replica[:-1], True))


def _in_order(parts: list[tuple[IntArray, Message]]) -> tuple[IntArray, Message] | None:
    """Join rows and put them in order; what arrives at one instant stays in the order given."""
    found = joined(parts)
    if found is None or len(parts) == 1 or bool((found[0][1:] >= found[0][:-1]).all()):
        return found
    order = np.argsort(found[0], kind="stable")
    return found[0][order], found[1].take(order)
