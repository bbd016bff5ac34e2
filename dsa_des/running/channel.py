"""Wires: rows on their way to an input, what is lost or late, and what a block sees when it runs.

Rows are kept in order of arrival. A look-ahead sender may deposit rows long before they arrive; a
reader only ever sees those that have arrived by the instant it asks about. What a block sees is
the same whether SimPy wakes it, at whatever grain, or a host program calls it.
"""

from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, Protocol

import numpy as np

from dsa_des.arrays.sorted_union import last_at_or_before, sorted_union
from dsa_des.arrays.types import BoolArray, FloatArray, IntArray
from dsa_des.block.component import Input
from dsa_des.block.message import Message
from dsa_des.block.wake import Arrivals, Wake
from dsa_des.time.clock import nanosecond_of
from dsa_des.time.randomness import Stream
from dsa_des.time.timeline import ReplicaTime


@dataclass(frozen=True)
class WireFaults:
    """Keyed faults of one wire; a row's fate depends on the wire and on its instant only.

    Parameters
    ----------
    jitter_ticks : float
        Largest extra delay; each row takes a uniformly drawn part of it.
    drop_probability : float
    jitter, drops : Stream
        Draws named after the wire.
    ticks_per_s : int
    """

    jitter_ticks: float
    drop_probability: float
    jitter: Stream
    drops: Stream
    ticks_per_s: int

    def kept(self, ticks: IntArray) -> BoolArray:
        """Return which rows sent at `ticks` are not lost."""
        return self._drawn(self.drops, ticks) >= self.drop_probability

    def lateness(self, ticks: IntArray) -> IntArray:
        """Return the extra delay of the rows sent at `ticks`, in ticks."""
        return np.rint(self._drawn(self.jitter, ticks) * self.jitter_ticks).astype(np.int64)

    def _drawn(self, stream: Stream, ticks: IntArray) -> FloatArray:
        instant = nanosecond_of(ticks, self.ticks_per_s).astype(np.uint64)
        return stream.uniform(instant, 0)


class Channel:
    """Rows on their way to one input.

    Parameters
    ----------
    source : str
        Name of the sending block.
    delay_ticks : int
        Time on the wire.
    faults : WireFaults, optional
        Loss and lateness of single rows; late rows may be overtaken.
    """

    def __init__(
        self,
        source: str,
        delay_ticks: int = 0,
        faults: WireFaults | None = None,
    ) -> None:
        self.source = source
        self.delay_ticks = delay_ticks
        self._faults = faults
        #: Arrivals of rows, which are the last ones of the message beside them.
        self._waiting: deque[tuple[IntArray, Message]] = deque()
        #: The last row of it is held.
        self._last: tuple[IntArray, Message] | None = None
        #: First arrival of every message pushed since `state` or `set_state`.
        self._pushed: list[int] | None = None

    def hold(self, message: Message, tick: int) -> None:
        """Make `message` the last arrived one, as if it had come at `tick`."""
        self._last = (np.array([tick], dtype=np.int64), message)

    def state(self) -> tuple[Any, Any]:
        """Return what waits and what is held, for `set_state`; note pushes from now on."""
        self._pushed = []
        return tuple(self._waiting), self._last

    def set_state(self, state: tuple[Any, Any]) -> None:
        """Go back to a state that `state` gave."""
        self._waiting, self._last = deque(state[0]), state[1]
        self._pushed = []

    def earliest_pushed(self) -> int | None:
        """Return the first arrival of what was pushed since `state` or `set_state`, or None."""
        return min(self._pushed) if self._pushed else None

    def push(self, message: Message, sent: int | IntArray | None = None) -> IntArray:
        """Deposit a message and return the ticks at which its rows arrive, in order.

        Parameters
        ----------
        message : Message
        sent : int or array of int, optional
            The tick at which it was sent, or each of its rows, when that is later than their own.
        """
        ticks = message.tick
        if sent is not None:
            ticks = np.full(len(message), sent, dtype=np.int64)
        arrivals = ticks + self.delay_ticks if self.delay_ticks else ticks
        if self._faults is not None:
            kept = np.flatnonzero(self._faults.kept(message.tick))
            arrivals = arrivals[kept] + self._faults.lateness(message.tick[kept])
            order = np.argsort(arrivals, kind="stable")
            arrivals, message = arrivals[order], message.take(kept[order])
            if len(kept) == 0:
                return arrivals
        self._waiting.append((arrivals, message))
        if self._pushed is not None:
            self._pushed.append(int(arrivals[0]))
        return arrivals

    def forget(self, tick: int) -> None:
        """Drop what a reader who only asks what is held, at `tick` or later, can never see.

        A slow sensor behind a fast one would otherwise let a message wait for each window between
        two of its scans.
        """
        if self._faults is None:
            while len(self._waiting) > 1 and self._waiting[1][0][0] <= tick:
                self._waiting.popleft()

    def next_arrivals(self, end: int) -> IntArray:
        """Return the ticks at which rows arrive before `end` that were not collected yet."""
        ticks = [arrivals[: np.searchsorted(arrivals, end)] for arrivals, _ in self._waiting]
        if self._faults is not None and ticks:
            return sorted_union(ticks)  # late rows overtake and may coincide
        return np.concatenate(ticks) if ticks else np.empty(0, dtype=np.int64)

    def collect(self, end: int) -> tuple[IntArray, Message] | None:
        """Remove and return the rows that arrive before `end`, in order of arrival, or None."""
        taken: list[tuple[IntArray, Message]] = []
        left: deque[tuple[IntArray, Message]] = deque()
        while self._waiting:
            arrivals, message = self._waiting.popleft()
            count = len(arrivals) if arrivals[-1] < end else int(np.searchsorted(arrivals, end))
            start = len(message) - len(arrivals)
            if count:
                taken.append((arrivals[:count], message.take(slice(start, start + count))))
            if count == len(arrivals):
                continue
            left.append((arrivals[count:], message))
            if self._faults is None:
                break  # rows behind these arrive later still
        left.extend(self._waiting)
        self._waiting = left
        found = joined(taken)
        if self._faults is not None and found is not None and len(taken) > 1:
            order = np.argsort(found[0], kind="stable")
            found = found[0][order], found[1].take(order)
        return found

    def sample(self, ticks: IntArray, end: int) -> tuple[Message, IntArray] | None:
        """Return what the input holds at each of `ticks` (in order, all before `end`).

        Returns
        -------
        (message, rows) or None
            ``rows[i]`` is the row of `message` held at ``ticks[i]``; -1 when none has arrived.
        """
        new = self.collect(end)
        last = self._last
        if new is not None:
            self._last = new
            if new[0][0] <= ticks[0]:
                last = None  # superseded before the first instant asked about: spare the copy
        if last is not None:
            last = last[0][-1:], last[1].take(slice(len(last[1]) - 1, len(last[1])))
        held = joined([part for part in (last, new) if part is not None])
        if held is None:
            return None
        arrivals, message = held
        if new is None:
            self._last = held
        return message, last_at_or_before(arrivals, ticks)


def joined(parts: list[tuple[IntArray, Message]]) -> tuple[IntArray, Message] | None:
    """Return the rows of all parts as one, in the order given, or None without any."""
    if not parts:
        return None
    if len(parts) == 1:
        return parts[0]
    arrivals = np.concatenate([part[0] for part in parts])
    message = type(parts[0][1]).concatenate([part[1] for part in parts])
    return arrivals, message


class WireEnd(Protocol):
    """The receiving end of a wire, as `dsa_des.running.channel.Channel` has it."""

    source: str

    def sample(self, ticks: IntArray, end: int) -> tuple[Message, IntArray] | None:
        """Return what is held at each of `ticks`, all before `end`."""

    def collect(self, end: int) -> tuple[IntArray, Message] | None:
        """Remove and return the rows that arrive before `end`."""


class Inputs:
    """The wires into a block, by how it reads them.

    Parameters
    ----------
    declared : mapping
        The block's inputs.
    wires : mapping
        The wires into each.
    ticks_per_s : int
    time : ReplicaTime, optional
        How runs lie in time, where there are many.
    """

    def __init__(
        self,
        declared: Mapping[str, Input],
        wires: Mapping[str, Sequence[WireEnd]],
        ticks_per_s: int,
        time: ReplicaTime | None = None,
    ) -> None:
        every = [(port, wire) for port in declared for wire in wires.get(port, ())]
        self._held = [(p, wire, declared[p].required) for p, wire in every if declared[p].held]
        self._queued = [(p, wire) for p, wire in every if not declared[p].held]
        self._ticks_per_s = ticks_per_s
        self._time = ReplicaTime(1, 0) if time is None else time

    def seen(
        self,
        ticks: IntArray,
        scans: IntArray,
        end: int,
        demand: Callable[[IntArray], Mapping[str, IntArray]] | None = None,
        *,
        clock: Callable[[IntArray], IntArray] | None = None,
        complete: bool = True,
    ) -> Wake | None:
        """Return what the block sees at some instants, or None if it cannot run at any.

        Parameters
        ----------
        ticks, scans : ndarray of int64, shape (rows,)
            As for `Wake`.
        end : int
            First tick that is no longer seen.
        demand : callable, optional
            Given the instants of the wake, returns what `Wake.demand` is.
        clock : callable, optional
            As for `Wake`.
        complete : bool
            Leave out instants at which a required input holds nothing yet.
        """
        held: dict[str, tuple[Message, IntArray]] = {}
        missing: np.ndarray | None = None
        for port, wire, required in self._held:
            sample = wire.sample(ticks, end)
            if sample is not None:
                held[port] = sample
            if required and complete and _some_missing(sample):
                absent = np.ones(len(ticks), bool) if sample is None else sample[1] < 0
                missing = absent if missing is None else missing | absent
        if missing is not None:  # before the first messages
            there = np.flatnonzero(~missing)
            if len(there) == 0:
                return None
            ticks, scans = ticks[there], scans[there]
            held = {port: (message, rows[there]) for port, (message, rows) in held.items()}
        arrived: dict[str, list[Arrivals]] = {}
        for port, wire in self._queued:
            new = wire.collect(end)
            if new is not None:
                arrived.setdefault(port, []).append(Arrivals(wire.source, *new))
        asked = None if demand is None else partial(demand, ticks)
        span, run = self._time.span_ticks, self._time.runs.start
        return Wake(ticks, scans, self._ticks_per_s, held, arrived, asked, span, run, clock)


def _some_missing(sample: tuple[Message, IntArray] | None) -> bool:
    if sample is None:
        return True
    rows = sample[1]
    return bool(rows[0] < 0 if len(rows) == 1 else (rows < 0).any())
