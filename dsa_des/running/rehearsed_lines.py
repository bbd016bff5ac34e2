"""Shared processors of a run whose windows are rehearsed (`dsa_des.running.rehearsal`)."""

from collections.abc import Callable, Mapping, Sequence
from typing import Protocol

import numpy as np

from dsa_des.arrays.sorted_union import sorted_union
from dsa_des.arrays.types import IntArray
from dsa_des.block.message import Message
from dsa_des.running.channel import Channel
from dsa_des.running.processors import Deliver, Processing
from dsa_des.running.rehearsal import Job, Player, Rehearsal, Rehearsed, Root, WaitingLine


class Performer(Protocol):
    """A running block, as far as its wakes go."""

    @property
    def subscribers(self) -> Mapping[str, Sequence[tuple[Channel, "Performer", str]]]:
        """Wires from its outputs, to whom, and into which input."""

    @property
    def name(self) -> str:
        """Its name in the scene."""

    def own_ticks(self, start: int, end: int) -> IntArray:
        """Return the instants in [start, end) at which it runs by itself."""

    def triggers(self) -> Sequence[Channel]:
        """Return the wires whose messages wake it."""

    def is_woken_over(self, port: str) -> bool:
        """Whether messages for an input wake it."""


class RehearsedLines:
    """All shared processors of a run; messages leave them when the rehearsal says.

    What happens in a window counts once `close` is called; until then `undo` takes it back.

    Parameters
    ----------
    lines : mapping
        Processors by name, at the start of the run.
    processor_of : mapping
        The processor of each block that waits at one.
    ticks_per_s : int
    record : callable
        Takes a block's name and a `Processing` message.
    """

    def __init__(
        self,
        lines: Mapping[str, WaitingLine],
        processor_of: Mapping[str, str],
        ticks_per_s: int,
        record: Callable[[str, Message], None],
    ) -> None:
        self._lines = dict(lines)
        self._processor_of = processor_of
        self._ticks_per_s = ticks_per_s
        self._record = record
        self._found: Rehearsed | None = None
        self._end = 0
        self._foreseen = 0, 0
        #: What waits or is worked on: how it is delivered, and the message.
        self._held: dict[Job, tuple[Deliver, Message]] = {}
        self._kept: dict[Job, tuple[Deliver, Message]] = {}
        self._submitted: dict[str, list[IntArray]] = {}
        self._roots: dict[Job, Root] = {}

    def cast(self, nodes: Mapping[str, Performer], places: Mapping[str, int]) -> None:
        """Learn the blocks and their wires: who waits at a processor, and whoever wakes them.

        Parameters
        ----------
        nodes : mapping
        places : mapping
            The depth of each block in an instant.
        """
        wakers: dict[str, set[str]] = {name: set() for name in nodes}
        over: dict[str, list[tuple[Channel, str]]] = {name: [] for name in nodes}
        for name, node in nodes.items():
            for wires in node.subscribers.values():
                for channel, target, port in wires:
                    if target.is_woken_over(port):
                        wakers[target.name].add(name)
                        over[name].append((channel, target.name))
        cast = set(self._processor_of)
        todo = list(cast)
        while todo:
            new = wakers[todo.pop()] - cast
            cast |= new
            todo += new
        self._cast = {name: nodes[name] for name in sorted(cast)}
        self._rehearsal = Rehearsal(
            Player(
                name,
                places[name],
                self._processor_of.get(name, ""),
                tuple((channel, target) for channel, target in over[name] if target in cast),
            )
            for name in self._cast
        )

    # -- what a block asks of its processor ----------------------------------------------------

    def start(self) -> None:
        """Do nothing: it works when a window is opened."""

    def refuses(self, block: str) -> bool:
        """Return False: what is refused is never run (`let_in`)."""
        return False

    def open_window(self, start: int, end: int) -> None:
        """Rehearse [start, end), and let go of what was held and leaves in it."""
        if self._found is not None:
            return  # each of the blocks says so
        woken = {}
        for name, node in self._cast.items():
            ticks = [node.own_ticks(start, end)]
            ticks += [channel.next_arrivals(end) for channel in node.triggers()]
            woken[name] = sorted_union([each for each in ticks if len(each)] or ticks[:1])
            if name in self._processor_of and (start, end) != self._foreseen:
                self._lines[self._processor_of[name]].service.foresee(name, woken[name])
        self._foreseen = start, end
        self._found, self._end = self._rehearsal.play(self._lines, woken, end, self._roots), end
        self._submitted = {}
        self._kept = dict(self._held)
        left, dropped = self._found.left, self._found.dropped
        for job in sorted((job for job in self._held if job in left), key=left.__getitem__):
            deliver, message = self._kept.pop(job)
            deliver(message, left[job])
        for job in dropped & self._held.keys():
            del self._kept[job]

    def let_in(self, block: str, ticks: IntArray, scans: IntArray) -> tuple[IntArray, IntArray]:
        """Return the instants at which a block is to run, of those at which it is woken."""
        assert self._found is not None
        refused = self._found.refused.get(block)
        if not refused or not len(ticks):
            return ticks, scans
        stays = np.flatnonzero(~np.isin(ticks, np.array(sorted(refused), dtype=np.int64)))
        return ticks[stays], scans[stays]

    def submit(self, block: str, message: Message, deliver: Deliver) -> None:
        """Take what a block sent in the window; deliver what leaves the processor in it."""
        assert self._found is not None
        tick = message.tick
        first = np.flatnonzero(np.concatenate([[True], tick[1:] != tick[:-1]]))
        bounds = np.append(first, len(tick))
        made = tick[first]
        self._submitted.setdefault(block, []).append(made)
        left, dropped = self._found.left, self._found.dropped
        done = np.array([left.get((block, t), -1) for t in made.tolist()], dtype=np.int64)
        rows = np.repeat(done, np.diff(bounds))
        there = np.flatnonzero(rows >= 0)
        for number in np.flatnonzero(done < 0).tolist():
            job = block, int(made[number])
            if job not in dropped:
                part = message.take(slice(int(bounds[number]), int(bounds[number + 1])))
                self._kept[job] = deliver, part
        if len(there):
            deliver(message if len(there) == len(rows) else message.take(there), rows[there])

    # -- what its windows ask --------------------------------------------------------------------

    def first_surprise(self) -> int | None:
        """Return the first tick at which a block sent other than was rehearsed, or None."""
        surprises = [self._surprise(block) for block in self._processor_of]
        return min((tick for tick in surprises if tick is not None), default=None)

    def learn(self, tick: int) -> None:
        """Remember who sent, for the next rehearsal: for sure up to the first surprise."""
        assert self._found is not None
        rehearsal = self._rehearsal
        for block in self._processor_of:
            sent = set(self._sent(block).tolist())
            if (tick in sent) != (tick in self._found.sent.get(block, ())):
                rehearsal.known[block, tick] = tick in sent
            for now, root in self._found.woken.get(block, ()):
                rehearsal.guesses[block, root] = rehearsal.usual[block] = now in sent

    def undo(self) -> None:
        """Take the window back."""
        self._found = None

    def close(self) -> None:
        """Let the window stand, and record what became of messages in it."""
        assert self._found is not None
        self._lines, self._held = self._found.lines, self._kept
        self._roots = {job: self._found.roots[job] for job in self._held}
        for line in self._lines.values():
            line.service.forget()
        known = self._rehearsal.known
        self._rehearsal.known = {job: sent for job, sent in known.items() if job[1] >= self._end}
        self._rehearsal.guesses.clear()
        for block, rows in sorted(self._found.notes.items()):
            tick, entered, started, behind, outcome = np.array(rows, dtype=np.int64).T
            name = self._processor_of[block]
            self._record(
                block,
                Processing(
                    tick, entered, started, behind, outcome,
                    processor=name, ticks_per_s=self._ticks_per_s,
                ),
            )  # fmt: skip
        self._found = None

    def _sent(self, block: str) -> IntArray:
        parts = self._submitted.get(block)
        return sorted_union(parts) if parts else np.empty(0, dtype=np.int64)

    def _surprise(self, block: str) -> int | None:
        assert self._found is not None
        expected = np.array(self._found.sent.get(block, []), dtype=np.int64)
        sent = self._sent(block)
        both = min(len(expected), len(sent))
        unlike = np.flatnonzero(expected[:both] != sent[:both])
        if len(unlike):
            return int(min(expected[unlike[0]], sent[unlike[0]]))
        rest = expected[both:] if len(expected) > both else sent[both:]
        return int(rest[0]) if len(rest) else None
