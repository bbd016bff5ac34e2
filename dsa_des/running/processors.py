"""Shared processors: blocks that compute on the same machine queue for it.

A block whose table says ``processor = "gpu"`` looks at the world at its own instants, as ever, but
its messages leave only when the processor has worked on them. The processor serves one message at
a time; blocks that scan at the same instant line up in the order of their names. What became of
every message is recorded in the table ``processing``.
"""

from collections import deque
from collections.abc import Callable, Generator, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import simpy

from dsa_des.arrays.types import IntArray
from dsa_des.block.message import Column, Columns, Message, Text, static
from dsa_des.running.events import Bell, WakeUp
from dsa_des.scene.block_table import ProcessorParameters
from dsa_des.scene.queue_policy import find_policy
from dsa_des.time.clock import nanosecond_of
from dsa_des.time.randomness import Stream, key_of

# Messages are finished before, and taken in after, every block of an instant.
FINISH_PRIORITY = 0.5
ENTRY_PRIORITY = 1e9

DONE, DROPPED, SKIPPED = range(3)
_OUTCOMES = ("done", "dropped", "skipped")
#: Takes a message and the tick, or the tick of each row, at which work on it ended.
Deliver = Callable[[Message, Any], None]


@dataclass(eq=False)
class Processing(Message):
    """What became of one message at a processor (``tick`` is the instant of the outcome).

    Parameters
    ----------
    entered, started : (rows,)
        Ticks at which it was handed in and at which work on it began.
    queue_length : (rows,)
        Messages waiting behind it at the instant of the outcome.
    outcome : (rows,)
        Index into ``done``, ``dropped``, ``skipped``.
    """

    recorded: ClassVar[Mapping[str, Mapping[str, Column]]] = {
        "processing": {
            "processor": Column("", "", "shared processor", "text"),
            "entered_s": Column("s", "", "when the message came to the processor"),
            "started_s": Column("s", "", "when work on it began; null if never"),
            "age_s": Column("s", "", "from when it was handed in to its delivery"),
            "queue_length": Column(
                "messages", "", "messages that waited behind it at its outcome", "int64"
            ),
            "outcome": Column("", "", "whether it was done, dropped or skipped", "text"),
        }
    }

    entered: IntArray
    started: IntArray
    queue_length: IntArray
    outcome: IntArray
    processor: str = static()
    ticks_per_s: int = static()

    def tables(self) -> dict[str, Columns]:
        """Return the rows of ``processing``; a message that was never worked on has no start."""
        worked = self.outcome == 0
        columns: Columns = {
            "tick": self.tick,
            "processor": Text(np.zeros(len(self), dtype=np.int64), (self.processor,)),
            "entered_s": self.entered / self.ticks_per_s,
            "started_s": np.where(worked, self.started / self.ticks_per_s, np.nan),
            "age_s": np.where(worked, (self.tick - self.entered) / self.ticks_per_s, np.nan),
            "queue_length": self.queue_length,
            "outcome": Text(self.outcome, _OUTCOMES),
        }
        return {"processing": columns}


def noted(
    tick: IntArray,
    entered: IntArray,
    started: IntArray,
    queue_length: IntArray,
    outcome: int,
    processor: str,
    ticks_per_s: int,
) -> Processing:
    """Return the rows for messages with the same outcome."""
    return Processing(
        tick,
        entered,
        started,
        queue_length,
        np.full(len(tick), outcome, dtype=np.int64),
        processor=processor,
        ticks_per_s=ticks_per_s,
    )


class Service:
    """How long a processor works on each message.

    Parameters
    ----------
    name : str
    parameters : ProcessorParameters
    ticks_per_s : int
    stream : Stream
        Draws of the extra times, keyed by block and instant.

    Raises
    ------
    ValueError
        If the time is shorter than one tick.
    """

    def __init__(
        self, name: str, parameters: ProcessorParameters, ticks_per_s: int, stream: Stream
    ) -> None:
        self._least = round(parameters.service_s * ticks_per_s)
        self._spread = float(parameters.service_spread_s * ticks_per_s)
        self._stream = stream
        self._ticks_per_s = ticks_per_s
        if self._least < 1:
            raise ValueError(f"processors.{name}: service_s is shorter than one tick")

    def ticks(self, blocks: Iterable[str], entered: IntArray) -> IntArray:
        """Return the time for each message, by its block and the tick at which it entered."""
        if not self._spread:
            return np.full(len(entered), self._least, dtype=np.int64)
        pairs = zip(blocks, nanosecond_of(entered, self._ticks_per_s).tolist(), strict=True)
        keys = np.array([key_of("job", block, tick) for block, tick in pairs], dtype=np.uint64)
        extra = np.rint(self._stream.uniform(keys, 0) * self._spread)
        return self._least + extra.astype(np.int64)


@dataclass(eq=False)
class _Job:
    block: str
    entered: int
    message: Message | None = None
    deliver: Deliver | None = None


class Processor:
    """One processor, as a SimPy process that serves a line of messages.

    Invariants: it works on at most one message at a time; messages of one instant enter in the
    order of their blocks' names; whatever finishes at an instant is delivered before any block of
    that instant runs.

    Parameters
    ----------
    name : str
    parameters : ProcessorParameters
    service : Service
    env : simpy.Environment
    ticks_per_s : int
    record : callable
        Takes the block's name and a `Processing` message.
    """

    def __init__(
        self,
        name: str,
        parameters: ProcessorParameters,
        service: Service,
        env: simpy.Environment,
        ticks_per_s: int,
        record: Callable[[str, Message], None],
    ) -> None:
        self.name = name
        self._policy = find_policy(parameters.when_busy)()
        self._env = env
        self._ticks_per_s = ticks_per_s
        self._service = service
        self._record = record
        self._entering: list[_Job] = []
        self._line: deque[_Job] = deque()
        self._busy = False
        self._bell = Bell(env)

    def start(self) -> None:
        """Start the processor's SimPy process."""
        self._env.process(self._serve())

    def refuses(self, block: str) -> bool:
        """Whether a scan at this instant is to be left out because the processor is busy."""
        if not self._policy.skips(self._busy):
            return False
        now = int(self._env.now)
        self._note(_Job(block, now), now, SKIPPED)
        return True

    def open_window(self, start: int, end: int) -> None:
        """Do nothing: it works message by message."""

    def submit(self, block: str, message: Message, deliver: Deliver) -> None:
        """Hand in what `block` made at this instant; `deliver` is called when it is worked on."""
        now = int(self._env.now)
        if not self._entering:
            entry = WakeUp(self._env, 0, ENTRY_PRIORITY)
            entry.callbacks.append(self._enter)
        self._entering.append(_Job(block, now, message, deliver))

    def _enter(self, event: simpy.Event) -> None:
        entering, self._entering = sorted(self._entering, key=lambda job: job.block), []
        now = int(self._env.now)
        for job in entering:
            if self._policy.skips(self._busy or bool(self._line)):
                self._note(job, now, SKIPPED)  # another block of this instant was first
                continue
            gone: Any = self._policy.dropped(tuple(self._line), job)
            for left in gone:
                if left is not job:
                    self._line.remove(left)
                self._note(left, now, DROPPED)
            if job not in gone:
                self._line.append(job)
        if self._line and not self._busy and self._bell.callbacks:
            self._bell.ring()

    def _serve(self) -> Generator[simpy.Event, None, None]:
        while True:
            if not self._line:
                self._bell = Bell(self._env)
                yield self._bell
            job = self._line.popleft()
            self._busy = True
            started = int(self._env.now)
            service = self._service.ticks([job.block], np.array([job.entered], dtype=np.int64))
            yield WakeUp(self._env, int(service[0]), FINISH_PRIORITY)
            self._busy = False
            now = int(self._env.now)
            self._note(job, now, DONE, started)
            assert job.deliver is not None and job.message is not None
            job.deliver(job.message, now)

    def _note(self, job: _Job, tick: int, outcome: int, started: int = -1) -> None:
        values = (tick, job.entered, started, len(self._line))
        row = [np.array([value], dtype=np.int64) for value in values]
        message = noted(row[0], row[1], row[2], row[3], outcome, self.name, self._ticks_per_s)
        self._record(job.block, message)
