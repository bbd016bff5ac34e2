"""Shared processors: blocks that compute on the same machine queue for it.

A block whose table says ``processor = "gpu"`` looks at the world at its own instants, as ever, but
its messages leave only when the processor has worked on them. The processor serves one message at
a time; blocks that scan at the same instant line up in the order of their names. What became of
every message is recorded in the table ``processing``.

Where no block on a processor waits for another one on it, when each message enters is known before
any of them is served: the line of a whole window is then worked through in one go, in closed form
if all wait their turn. Elsewhere it is worked through at the instants at which something enters or
is done. Both give the same.
"""

from collections import deque
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import Any, ClassVar

import numpy as np
import simpy

from dsa_des.arrays.types import FloatArray, IntArray
from dsa_des.block.message import PER_ROW, STATIC, Message, Text, column
from dsa_des.running.events import WakeUp
from dsa_des.scene.block_table import ProcessorParameters
from dsa_des.scene.queue_policy import QueuePolicy, find_policy
from dsa_des.time.clock import ticks_to_nanoseconds
from dsa_des.time.randomness import Stream, key_of

# Messages are done before, and enter after, every block of an instant.
DONE_PRIORITY = 0.5
ENTRY_PRIORITY = 1e9
_NEVER = np.iinfo(np.int64).max

DONE, DROPPED, SKIPPED = range(3)
_OUTCOMES = ("done", "dropped", "skipped")
#: Takes a message and the tick, or the tick of each row, at which work on it ended.
Deliver = Callable[[Message, Any], None]


@dataclass(eq=False)
class Processing(Message):
    """What happened to messages at a shared processor (done, dropped, skipped), at ``tick``."""

    row_table: ClassVar[str] = "processing"

    processor: str = column(
        "", "", "shared processor", "text", of=STATIC,
        value=lambda said: Text(np.zeros(len(said), dtype=np.int64), (said.processor,)),
    )  # fmt: skip
    entered: IntArray = column(
        "s", "", "when the message came to the processor",
        of=PER_ROW, name="entered_s", instant=True,
    )  # fmt: skip
    started_s: FloatArray = column("s", "", "when work on it began; null if never", of=PER_ROW)
    age_s: FloatArray = column("s", "", "from when it was handed in to its delivery", of=PER_ROW)
    queue_length: IntArray = column(
        "messages", "", "messages that waited behind it at its outcome", "int64", of=PER_ROW
    )
    #: Index into `_OUTCOMES`.
    outcome: IntArray = column(
        "", "", "whether it was done, dropped or skipped", "text",
        of=PER_ROW, value=lambda said: Text(said.outcome, _OUTCOMES),
    )  # fmt: skip


class Service:
    """Draws how long a processor works on each message, keyed by block and instant.

    From each of `from_ticks` on, what enters is worked on as the next of `parameters` say. A
    `ValueError` says so if that is shorter than one tick.
    """

    def __init__(
        self,
        name: str,
        parameters: Sequence[ProcessorParameters],
        from_ticks: IntArray,
        ticks_per_s: int,
        stream: Stream,
    ) -> None:
        self._from_ticks = from_ticks
        self._least = np.array([round(p.service_s * ticks_per_s) for p in parameters])
        self._spread = np.array([float(p.service_spread_s * ticks_per_s) for p in parameters])
        self._stream = stream
        self._ticks_per_s = ticks_per_s
        if self._least.min() < 1:
            raise ValueError(f"processors.{name}: service_s is shorter than one tick")

    def service_ticks(self, blocks: Iterable[str], entered: IntArray) -> IntArray:
        """Return messages' service times in ticks, by their block and tick of entry."""
        of = np.searchsorted(self._from_ticks, entered, side="right") - 1
        least: IntArray = self._least[of]
        if not self._spread.any():
            return least
        pairs = zip(blocks, ticks_to_nanoseconds(entered, self._ticks_per_s).tolist(), strict=True)
        keys = np.array([key_of("job", block, tick) for block, tick in pairs], dtype=np.uint64)
        extra = np.rint(self._stream.uniform(keys, 0) * self._spread[of])
        return least + extra.astype(np.int64)


@dataclass(eq=False)
class _Entry:
    """A message that a block sent over one output, as one job for each instant in it."""

    block: str
    message: Message
    deliver: Deliver
    #: First row of each job, and one past the last row.
    bounds: IntArray
    #: Tick at which each job will be done; `_NEVER` while it waits, if it goes, once it was sent.
    done: IntArray

    @classmethod
    def from_message(cls, block: str, message: Message, deliver: Deliver) -> "_Entry":
        first = np.flatnonzero(np.append(True, message.tick[1:] != message.tick[:-1]))
        done = np.full(len(first), _NEVER, dtype=np.int64)
        return cls(block, message, deliver, np.append(first, len(message)), done)

    def deliver_finished_rows(self) -> None:
        """Deliver, once, the rows of the jobs whose end is known."""
        if len(known := np.flatnonzero(self.done < _NEVER)) == 0:
            return
        done = np.repeat(self.done, np.diff(self.bounds))
        rows = np.flatnonzero(done < _NEVER)
        message = self.message if len(rows) == len(done) else self.message.take(rows)
        self.done[known] = _NEVER
        self.deliver(message, done[rows])


@dataclass(eq=False)
class _Job:
    """The rows of one instant: when they entered, how long they take, and whose they are."""

    block: str
    entered: int
    service: int = 0
    entry: _Entry | None = None
    number: int = 0
    started: int = -1


class Processor:
    """One shared processor and the queue of jobs that wait for it.

    Invariants: it works on at most one message at a time; messages of one instant enter in the
    order of their blocks' names; whatever is done at an instant has left before any block of that
    instant runs. In a window it comes after all of its blocks and before every block that hears of
    them.

    `record` takes a block's name and a `Processing` message; `window_priority` is its position
    among the blocks at the start of a window, where it serves whole windows.
    """

    def __init__(
        self,
        name: str,
        parameters: ProcessorParameters,
        service: Service,
        env: simpy.Environment,
        ticks_per_s: int,
        record: Callable[[str, Message], None],
        window_priority: float | None = None,
    ) -> None:
        self.name = name
        self._policy = find_policy(parameters.when_busy)()
        self._service = service
        self._env = env
        self._ticks_per_s = ticks_per_s
        self._record = record
        self._window_priority = window_priority
        self._window: tuple[int, int] | None = None
        self._entries: list[_Entry] = []
        self._line: deque[_Job] = deque()
        self._working: _Job | None = None
        self._free_from = 0
        #: What became of jobs since `record_job_outcomes`: block, and the numbers of
        # `_record_processing_rows`.
        self._notes: list[tuple[str, tuple[int, ...]]] = []
        #: Entries of which something leaves, since `_deliver_finished_messages`.
        self._leaving: dict[_Entry, None] = {}
        #: In closed form, jobs that are done after the last window: entered, started, done, block.
        self._under_way = (*[np.empty(0, dtype=np.int64)] * 3, np.empty(0, dtype=object))

    def skip_if_busy(self, block: str) -> bool:
        """Return whether a scan is skipped now as the processor is busy, and record that if so."""
        if not self._policy.skips(self._working is not None):
            return False
        now = int(self._env.now)
        self._note_outcome(_Job(block, now), now, SKIPPED)
        return True

    def schedule_service_of_window(self, start: int, end: int) -> None:
        """Schedule the messages of [start, end) to be served after all blocks have sent theirs."""
        if self._window_priority is None or self._window == (start, end):
            return  # each of its blocks says so
        self._window = start, end
        wake_up = WakeUp(self._env, start - int(self._env.now), self._window_priority)
        wake_up.callbacks.append(lambda event: self._serve_window(end))

    def submit(self, block: str, message: Message, deliver: Deliver) -> None:
        """Queue a block's message; `deliver` is called with its rows when work on them ends."""
        if self._window_priority is None and not self._entries:
            WakeUp(self._env, 0, ENTRY_PRIORITY).callbacks.append(self._serve_instant)
        self._entries.append(_Entry.from_message(block, message, deliver))

    def _pop_entries_sorted_by_block(self) -> list[_Entry]:
        entries, self._entries = self._entries, []
        return sorted(entries, key=lambda entry: entry.block)

    # -- at an instant -------------------------------------------------------------------------

    def _serve_instant(self, event: simpy.Event) -> None:
        entries, now = self._pop_entries_sorted_by_block(), int(self._env.now)
        ticks = np.full(len(entries), now, dtype=np.int64)
        services = self._service.service_ticks([entry.block for entry in entries], ticks).tolist()
        jobs = zip(entries, services, strict=True)
        self._enqueue_jobs(now, [_Job(entry.block, now, service, entry) for entry, service in jobs])
        self._deliver_finished_messages()

    def _on_job_done(self, event: simpy.Event) -> None:
        self._finish_jobs_until(int(self._env.now))
        self._deliver_finished_messages()

    # -- the line ------------------------------------------------------------------------------

    def _enqueue_jobs(self, now: int, jobs: Iterable[_Job]) -> None:
        for job in jobs:
            if self._policy.skips(self._working is not None or bool(self._line)):
                self._note_outcome(job, now, SKIPPED)  # another block of this instant was first
                continue
            gone: Any = self._policy.dropped(tuple(self._line), job)
            for left in gone:
                if left is not job:
                    self._line.remove(left)
                self._note_outcome(left, now, DROPPED)
            if job not in gone:
                self._line.append(job)
        if self._working is None:
            self._start_next_job(now)

    def _start_next_job(self, now: int) -> None:
        if not self._line:
            return
        self._working = job = self._line.popleft()
        job.started, self._free_from = now, now + job.service
        assert job.entry is not None
        job.entry.done[job.number] = self._free_from
        self._leaving[job.entry] = None
        if self._window_priority is None:
            WakeUp(self._env, job.service, DONE_PRIORITY).callbacks.append(self._on_job_done)

    def _finish_jobs_until(self, until: int) -> None:
        while self._working is not None and self._free_from <= until:
            job, now, self._working = self._working, self._free_from, None
            self._note_outcome(job, now, DONE)
            self._start_next_job(now)

    def _note_outcome(self, job: _Job, tick: int, outcome: int) -> None:
        numbers = (tick, job.entered, job.started, len(self._line), outcome)
        self._notes.append((job.block, numbers))

    def record_job_outcomes(self) -> None:
        """Record the outcomes of jobs since the last call: when each entered, started and ended."""
        if notes := self._notes:
            self._notes = []
            self._record_processing_rows(
                [block for block, _ in notes], *np.array([n for _, n in notes]).T
            )

    def _deliver_finished_messages(self) -> None:
        """Deliver the messages of jobs whose end is now known."""
        leaving, self._leaving = self._leaving, {}
        for entry in leaving:
            entry.deliver_finished_rows()

    def _record_processing_rows(self, blocks: Iterable[str], *columns: IntArray) -> None:
        of = np.array(blocks, dtype=object)
        for block in sorted(set(of.tolist())):
            tick, entered, started, behind, outcome = (c[of == block] for c in columns)
            started_s = np.where(outcome == DONE, started / self._ticks_per_s, np.nan)
            age_s = np.where(outcome == DONE, (tick - entered) / self._ticks_per_s, np.nan)
            rows = Processing(tick, self.name, entered, started_s, age_s, behind, outcome)
            self._record(block, rows)

    # -- in a window ---------------------------------------------------------------------------

    def _serve_window(self, end: int) -> None:
        entries = self._pop_entries_sorted_by_block()
        ticks = [entry.message.tick[entry.bounds[:-1]] for entry in entries]
        tick = np.concatenate([*ticks, np.empty(0, dtype=np.int64)])
        order = np.argsort(tick, kind="stable")  # blocks of one instant enter by name
        tick = tick[order]
        of = np.repeat(np.arange(len(entries)), [len(part) for part in ticks])[order]
        number = np.concatenate([*map(np.arange, map(len, ticks)), np.empty(0, dtype=np.int64)])
        number = number[order].astype(np.int64)
        blocks = np.array([*(entry.block for entry in entries), ""], dtype=object)[of]
        service = self._service.service_ticks(blocks, tick)
        if type(self._policy) is QueuePolicy:
            done = self._end_ticks_of_served_jobs(tick, service, blocks, end)
            for n, entry in enumerate(entries):
                entry.done[number[of == n]] = done[of == n]
                entry.deliver_finished_rows()
            return
        rows = (blocks, tick, service, [entries[n] for n in of.tolist()], number)
        jobs = [
            _Job(*row) for row in zip(*(_array_to_list(values) for values in rows), strict=True)
        ]
        for now, group in groupby(jobs, key=lambda job: job.entered):
            self._finish_jobs_until(now)
            self._enqueue_jobs(now, group)
        self._finish_jobs_until(end - 1)
        self._deliver_finished_messages()

    def _end_ticks_of_served_jobs(
        self, tick: IntArray, service: IntArray, blocks: np.ndarray, end: int
    ) -> IntArray:
        """Serve jobs in order of entry, return their end ticks, and record those before `end`."""
        worked = np.cumsum(service)
        idle = np.maximum(tick, self._free_from) - (worked - service)
        ends: IntArray = np.maximum.accumulate(idle) + worked
        if len(ends):
            self._free_from = int(ends[-1])
        new = (tick, ends - service, ends, blocks)
        under_way = [np.concatenate(parts) for parts in zip(self._under_way, new, strict=True)]
        entered, started, done, blocks = under_way
        now = int(np.searchsorted(done, end))
        # Who entered before this instant and comes later waits behind it.
        behind = np.searchsorted(entered, done[:now]) - np.arange(1, now + 1)
        outcome = np.full(now, DONE, dtype=np.int64)
        self._record_processing_rows(
            blocks[:now], done[:now], entered[:now], started[:now], behind, outcome
        )
        self._under_way = (entered[now:], started[now:], done[now:], blocks[now:])
        return ends


def _array_to_list(values: Any) -> list[Any]:
    return values.tolist() if isinstance(values, np.ndarray) else values
