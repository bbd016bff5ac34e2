"""Shared processors: blocks that compute on the same machine queue for it.

A block whose table says ``processor = "gpu"`` looks at the world at its own instants, as ever, but
its messages leave only when the processor has worked on them. The processor serves one message at
a time; blocks that scan at the same instant line up in the order of their names. What became of
every message is recorded in the table ``processing``.
"""

from collections import deque
from collections.abc import Callable, Generator, Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import simpy

from dsa_des.arrays.types import IntArray
from dsa_des.block.message import Columns, Message, Text, static
from dsa_des.running.events import Bell, WakeUp
from dsa_des.scene.processor import ProcessorParameters
from dsa_des.time.randomness import Stream, key_of

# Messages are finished before, and taken in after, every block of an instant.
FINISH_PRIORITY = 0.5
ENTRY_PRIORITY = 1e9

_OUTCOMES = ("done", "dropped", "skipped")


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

    recorded: ClassVar[Mapping[str, Mapping[str, str]]] = {
        "processing": {
            "processor": "text",
            "entered_s": "float64",
            "started_s": "float64",
            "age_s": "float64",
            "queue_length": "int64",
            "outcome": "text",
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


@dataclass
class _Job:
    block: str
    entered: int
    deliver: Callable[[int], None]


class Processor:
    """One processor, as a SimPy process that serves a line of messages.

    Invariants: it works on at most one message at a time; messages of one instant enter in the
    order of their blocks' names; whatever finishes at an instant is delivered before any block of
    that instant runs.

    Parameters
    ----------
    name : str
    parameters : ProcessorParameters
    env : simpy.Environment
    ticks_per_s : int
    stream : Stream
        Draws of the service times, keyed by block and instant.
    record : callable
        Takes the block's name and a `Processing` message.
    """

    def __init__(
        self,
        name: str,
        parameters: ProcessorParameters,
        env: simpy.Environment,
        ticks_per_s: int,
        stream: Stream,
        record: Callable[[str, Message], None],
    ) -> None:
        self.name = name
        self.p = parameters
        self._env = env
        self._ticks_per_s = ticks_per_s
        self._service = round(parameters.service_s * ticks_per_s)
        self._spread = float(parameters.service_spread_s * ticks_per_s)
        self._stream = stream
        self._record = record
        self._entering: list[_Job] = []
        self._line: deque[_Job] = deque()
        self._busy = False
        self._bell = Bell(env)
        if self._service < 1:
            raise ValueError(f"processors.{name}: service_s is shorter than one tick")

    def start(self) -> None:
        """Start the processor's SimPy process."""
        self._env.process(self._serve())

    def refuses(self, block: str) -> bool:
        """Whether a scan at this instant is to be left out because the processor is busy."""
        if self.p.when_busy != "skip" or not self._busy:
            return False
        now = int(self._env.now)
        self._note(_Job(block, now, lambda tick: None), now, "skipped")
        return True

    def submit(self, block: str, deliver: Callable[[int], None]) -> None:
        """Hand in what `block` made at this instant; `deliver` is called when it is worked on."""
        now = int(self._env.now)
        if not self._entering:
            entry = WakeUp(self._env, 0, ENTRY_PRIORITY)
            entry.callbacks.append(self._enter)
        self._entering.append(_Job(block, now, deliver))

    def _enter(self, event: simpy.Event) -> None:
        entering, self._entering = sorted(self._entering, key=lambda job: job.block), []
        now = int(self._env.now)
        for job in entering:
            if self.p.when_busy == "skip" and (self._busy or self._line):
                self._note(job, now, "skipped")  # another block of this instant was first
                continue
            if self.p.when_busy == "drop_oldest" and self._line:
                self._note(self._line.popleft(), now, "dropped")
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
            yield WakeUp(self._env, self._service_ticks(job), FINISH_PRIORITY)
            self._busy = False
            now = int(self._env.now)
            self._note(job, now, "done", started)
            job.deliver(now)

    def _service_ticks(self, job: _Job) -> int:
        if not self._spread:
            return self._service
        draw = self._stream.uniform(np.uint64(key_of("job", job.block, job.entered)), 0)
        return self._service + round(float(draw) * self._spread)

    def _note(self, job: _Job, tick: int, outcome: str, started: int = -1) -> None:
        row = [np.array([value], dtype=np.int64) for value in (tick, job.entered, started)]
        length = np.array([len(self._line)], dtype=np.int64)
        code = np.array([_OUTCOMES.index(outcome)], dtype=np.int64)
        message = Processing(row[0], row[1], row[2], length, code, self.name, self._ticks_per_s)
        self._record(job.block, message)
