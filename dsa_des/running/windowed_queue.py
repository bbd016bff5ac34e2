"""A shared processor that serves a whole window at once.

Where no block on a processor waits for another one on it, when each message enters is known before
any of them is served: the line can be worked through in one go, which takes a microsecond per
message instead of three events. The outcome is that of `dsa_des.running.processors.Processor`.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import simpy

from dsa_des.arrays.types import IntArray
from dsa_des.block.message import Message
from dsa_des.running.events import WakeUp
from dsa_des.running.processors import DONE, DROPPED, Deliver, Service, noted

_NEVER = np.iinfo(np.int64).max


@dataclass(eq=False)
class _Entry:
    """What one block sent over one output in a window: a job for each instant."""

    block: str
    deliver: Deliver
    message: Message
    #: First row of each job, and one past the last row.
    bounds: IntArray
    #: Tick at which each job is done; `_NEVER` while it waits or when it was dropped.
    done: IntArray


class WindowedQueue:
    """One processor whose blocks all run in look-ahead windows.

    Invariants: those of `Processor`; within a window it runs after all of its blocks and before
    every block that hears of them.

    Parameters
    ----------
    name : str
    service : Service
        How long it works on each message.
    keeps_newest : bool
        Whether only the newest message waits (``drop_oldest``).
    env : simpy.Environment
    ticks_per_s : int
    end_tick : int
        First tick that is no longer simulated.
    record : callable
        Takes the block's name and a `Processing` message.
    priority : float
        Its place among the blocks at the start of a window.
    """

    def __init__(
        self,
        name: str,
        service: Service,
        keeps_newest: bool,
        env: simpy.Environment,
        ticks_per_s: int,
        end_tick: int,
        record: Callable[[str, Message], None],
        priority: float,
    ) -> None:
        self.name = name
        self._service = service
        self._keeps_newest = keeps_newest
        self._env = env
        self._ticks_per_s = ticks_per_s
        self._end_tick = end_tick
        self._record = record
        self._priority = priority
        self._window: tuple[int, int] | None = None
        self._entries: list[_Entry] = []
        #: Jobs that are done later than the last window's end: entered, started, done and block.
        self._entered = np.empty(0, dtype=np.int64)
        self._started = np.empty(0, dtype=np.int64)
        self._done = np.empty(0, dtype=np.int64)
        self._blocks = np.empty(0, dtype=object)
        self._free_from = 0
        #: The job that waits, as its entry, its number there and the tick at which it entered; and
        #: the one worked on, as its block and the ticks at which it entered and was started.
        self._waiting: tuple[_Entry, int, int] | None = None
        self._working: tuple[str, int, int] | None = None

    def start(self) -> None:
        """Do nothing: it works when a window is opened."""

    def refuses(self, block: str) -> bool:
        """Return False: every scan is made."""
        return False

    def open_window(self, start: int, end: int) -> None:
        """Let the messages of [start, end) be served once all blocks have sent theirs."""
        if self._window == (start, end):
            return  # each of its blocks says so
        self._window = start, end
        wake_up = WakeUp(self._env, start - int(self._env.now), self._priority)
        wake_up.callbacks.append(lambda event: self._serve(end))

    def submit(self, block: str, message: Message, deliver: Deliver) -> None:
        """Take what a block sent over one output in the window that is open."""
        tick = message.tick
        first = np.flatnonzero(np.concatenate([[True], tick[1:] != tick[:-1]]))
        bounds = np.append(first, len(tick)).astype(np.int64)
        self._entries.append(
            _Entry(block, deliver, message, bounds, np.full(len(first), _NEVER, dtype=np.int64))
        )

    # -- the line ------------------------------------------------------------------------------

    def _serve(self, end: int) -> None:
        entries, self._entries = sorted(self._entries, key=lambda entry: entry.block), []
        ticks = [entry.message.tick[entry.bounds[:-1]] for entry in entries]
        tick = np.concatenate([*ticks, np.empty(0, dtype=np.int64)])
        of = np.repeat(np.arange(len(entries)), [len(part) for part in ticks])
        job = np.concatenate([np.arange(len(part)) for part in ticks] or [of])
        order = np.argsort(tick, kind="stable")  # blocks of one instant enter by name
        tick, of, job = tick[order], of[order], job[order]
        names = np.array([entry.block for entry in entries], dtype=object)
        blocks = names[of] if len(names) else np.empty(0, dtype=object)
        if self._keeps_newest:
            self._newest(entries, tick, of, job, end)
        else:
            self._all_in_turn(entries, tick, of, job, blocks, end)
        for entry in entries:
            _send(entry)

    def _all_in_turn(
        self,
        entries: Sequence[_Entry],
        tick: IntArray,
        of: IntArray,
        job: IntArray,
        blocks: np.ndarray,
        end: int,
    ) -> None:
        """Serve every job: it starts when it has entered and the one before it is done."""
        service = self._service.ticks(blocks, tick)
        worked = np.cumsum(service)
        idle = np.maximum(tick, self._free_from) - (worked - service)
        done = np.maximum.accumulate(idle) + worked
        for number, entry in enumerate(entries):
            mine = of == number
            entry.done[job[mine]] = done[mine]
        if len(done):
            self._free_from = int(done[-1])
        entered = np.concatenate([self._entered, tick])
        started = np.concatenate([self._started, done - service])
        done = np.concatenate([self._done, done])
        blocks = np.concatenate([self._blocks, blocks])
        now = int(np.searchsorted(done, end))
        # Who entered before this instant and comes later waits behind it.
        behind = np.searchsorted(entered, done[:now]) - np.arange(1, now + 1)
        self._note(blocks[:now], done[:now], entered[:now], started[:now], behind, DONE)
        self._entered, self._started = entered[now:], started[now:]
        self._done, self._blocks = done[now:], blocks[now:]

    def _newest(
        self, entries: Sequence[_Entry], tick: IntArray, of: IntArray, job: IntArray, end: int
    ) -> None:
        """Serve the newest that waits whenever the processor is free; drop the others."""
        notes: list[tuple[str, int, int, int, int, int]] = []

        def begin(now: int) -> None:
            assert self._waiting is not None
            entry, number, entered = self._waiting
            service = self._service.ticks(
                np.array([entry.block], dtype=object), np.array([entered], dtype=np.int64)
            )
            self._waiting = None
            self._free_from = now + int(service[0])
            entry.done[number] = self._free_from
            self._working = (entry.block, entered, now)

        def finish(until: int) -> None:
            while self._working is not None and self._free_from <= until:
                block, entered, started = self._working
                now = self._free_from
                behind = 0 if self._waiting is None else 1
                notes.append((block, now, entered, started, behind, DONE))
                self._working = None
                if self._waiting is not None:
                    begin(now)

        late = None if self._waiting is None else self._waiting[0]
        last = -1
        for now, number, place in zip(tick.tolist(), of.tolist(), job.tolist(), strict=True):
            if now != last:
                if self._waiting is not None and self._working is None:
                    begin(last)
                finish(now)
                last = now
            if self._waiting is not None:
                entry, _, entered = self._waiting
                notes.append((entry.block, now, entered, -1, 0, DROPPED))
            self._waiting = entries[number], place, now
        if self._waiting is not None and self._working is None:
            begin(last)
        finish(end - 1)
        if late is not None and late not in entries:
            _send(late)
        for outcome in (DONE, DROPPED):
            these = [note for note in notes if note[5] == outcome]
            blocks = np.array([note[0] for note in these], dtype=object)
            columns = np.array([note[1:5] for note in these], dtype=np.int64).reshape(-1, 4).T
            self._note(blocks, columns[0], columns[1], columns[2], columns[3], outcome)

    def _note(
        self,
        blocks: np.ndarray,
        tick: IntArray,
        entered: IntArray,
        started: IntArray,
        behind: IntArray,
        outcome: int,
    ) -> None:
        inside = tick < self._end_tick
        for block in sorted(set(blocks[inside].tolist())):
            mine = inside & (blocks == block)
            self._record(
                block,
                noted(
                    tick[mine], entered[mine], started[mine], behind[mine], outcome,
                    self.name, self._ticks_per_s,
                ),
            )  # fmt: skip


def _send(entry: _Entry) -> None:
    """Deliver the jobs whose end is known; they are not delivered again."""
    known = np.flatnonzero(entry.done < _NEVER)
    if len(known) == 0:
        return
    lengths = np.diff(entry.bounds)
    done = np.repeat(entry.done, lengths)
    rows = np.flatnonzero(done < _NEVER)
    message = entry.message if len(rows) == len(done) else entry.message.take(rows)
    entry.done[known] = _NEVER
    entry.deliver(message, done[rows])
