"""A block that cannot be shared by replicas: one instance each, run as if they were one block.

The engine asks the block itself, as the first replica has it, for everything but `run`: its clock,
ports, requests, offers, width and grain. What stands in for it here has nothing else that could
differ from it.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields
from typing import Any

import numpy as np

from dsa_des.arrays.run_ticks import RunTicks, shared_zero_run_numbers
from dsa_des.arrays.types import IntArray
from dsa_des.block.component import Component
from dsa_des.block.message import STATIC, Message
from dsa_des.block.wake import Arrivals, Wake, messages_by_output
from dsa_des.errors import RunRefused


class NotInLockStep(RunRefused):
    """These replicas cannot run in lock step; the message says why. They can run one by one."""


class SplitBlock:
    """One instance per replica, made when its first rows arrive, closed when later ones run.

    Each instance sees only its own replica's rows, as in a run of its own. It is no block and has
    no face of its own: only `run` is called on it.

    `make` makes the instance of a replica; `finished` is called with a replica's number and its
    instance when its last window is over.
    """

    def __init__(
        self,
        outputs: Sequence[str],
        make: Callable[[int], Component],
        finished: Callable[[int, Component], None],
    ) -> None:
        self._outputs = tuple(outputs)
        self.make, self._finished = make, finished
        self._instances: dict[int, Component] = {}
        self._made: set[int] = set()
        #: By replica and port, what has come for an instance that has not run since.
        self._waiting: dict[int, dict[str, list[Arrivals]]] = {}

    def run(self, wake: Wake) -> dict[str, Message] | None:
        """Let every replica's instance handle its rows."""
        firsts = wake.instants.first_position_of_runs.tolist()
        sent: dict[str, list[Message]] = {}
        self._finish_ended_runs(wake.first_run)
        self._store_early_arrivals(wake)
        for first, end in zip(firsts, [*firsts[1:], len(wake)], strict=True):
            number = int(wake.run[first])
            if number not in self._instances:
                self._instances[number] = self.make(number)
                self._made.add(number)
            part = _wake_of_replica(wake, slice(first, end), number)
            for port, waiting in self._waiting.pop(number, {}).items():
                part._arrived = {
                    **part._arrived,
                    port: _append_arrivals(waiting, part.arrivals(port)),
                }
            result = self._instances[number].run(part)
            for port, message in messages_by_output(result, self._outputs).items():
                run = np.full(len(message), number, dtype=np.int64)
                sent.setdefault(port, []).append(message.with_runs(run))
        return {port: _concatenate(parts) for port, parts in sent.items()} or None

    def _store_early_arrivals(self, wake: Wake) -> None:
        """Keep messages that arrive for replicas that do not run in this wake, until those run."""
        for port, arrivals in wake._arrived.items():
            for new in arrivals:
                of = new.message.run
                for number in np.unique(of[~np.isin(of, wake.run)]).tolist():
                    part = _arrivals_of_replica(new, number)
                    held = self._waiting.setdefault(number, {}).setdefault(port, [])
                    held[:] = _append_arrivals(held, [part] if part else [])

    def close_instances(self, replicas: int) -> None:
        """Finish instances still open, and make and finish those of replicas that never ran.

        `NotInLockStep` if one of these would have told its neighbours something else.
        """
        self._finish_ended_runs(None)
        for number in sorted(set(range(replicas)) - self._made):
            self._finished(number, self.make(number))

    def _finish_ended_runs(self, before: int | None) -> None:
        for number in sorted(self._instances):
            if before is None or number < before:
                self._finished(number, self._instances.pop(number))


def _wake_of_replica(wake: Wake, rows: slice, number: int) -> Wake:
    """Return a wake with the rows of one replica, numbered as run 0, as if it ran alone."""
    held = {}
    for port, (message, row_at) in wake._held.items():
        mine = row_at[rows]
        there = mine[mine >= 0]
        if len(there) == 0:
            continue  # nothing has arrived in this replica yet
        low = int(there.min())
        part = _as_single_run(message.take(slice(low, int(there.max()) + 1)))
        held[port] = part, np.where(mine < 0, -1, mine - low)
    arrived = {
        port: [came for new in arrivals if (came := _arrivals_of_replica(new, number))]
        for port, arrivals in wake._arrived.items()
    }

    def demand() -> dict[str, IntArray]:
        return {block: _shifted_rows_within(asked, rows) for block, asked in wake.demand.items()}

    instants, scans = RunTicks.of_run(0, wake.ticks[rows]), wake.scans[rows]

    def before(scans: IntArray, run: IntArray) -> IntArray:
        return wake.previous_scan_tick[rows]

    idle = wake.idle[rows]
    return Wake(instants, scans, wake.ticks_per_s, held, arrived, demand, clock=before, idle=idle)


def _arrivals_of_replica(new: Arrivals, number: int) -> Arrivals | None:
    first, end = np.searchsorted(new.message.run, [number, number + 1]).tolist()
    if first == end:
        return None
    instants = RunTicks.of_run(0, new.tick[first:end])
    return Arrivals(new.source, instants, _as_single_run(new.message.take(slice(first, end))))


def _as_single_run(message: Message) -> Message:
    """Return a message of one run with its run number set to 0, as if that run were alone."""
    return message.with_runs(shared_zero_run_numbers(len(message)))


def _append_arrivals(one: list[Arrivals], other: list[Arrivals]) -> list[Arrivals]:
    """Return both lists' arrivals, `one` before `other`, joined and sorted by source."""
    by_source = {new.source: new for new in one}
    for new in other:
        old = by_source.get(new.source)
        if old is not None:
            message = type(new.message).concatenate([old.message, new.message])
            new = Arrivals(new.source, RunTicks.concatenate([old.instants, new.instants]), message)
        by_source[new.source] = new
    return [by_source[name] for name in sorted(by_source)]


def _shifted_rows_within(asked: IntArray, rows: slice) -> IntArray:
    first, end = np.searchsorted(asked, [rows.start, rows.stop]).tolist()
    return asked[first:end] - rows.start


def _concatenate(parts: list[Message]) -> Message:
    """Return messages joined; NotInLockStep if a field that holds for all rows differs."""
    first = parts[0]
    for item in fields(first):
        if item.metadata.get("per") != STATIC or item.name in first.joins_static:
            continue
        value = getattr(first, item.name)
        for part in parts[1:]:
            other = getattr(part, item.name)
            if other is not value and not _has_same_values(other, value):
                raise NotInLockStep(f"{type(first).__name__}.{item.name} differs between replicas")
    return type(first).concatenate(parts)


def _has_same_values(one: Any, other: Any) -> bool:
    if isinstance(one, np.ndarray):
        return np.array_equal(one, other)
    if isinstance(one, Mapping):
        return one.keys() == other.keys() and all(_has_same_values(one[k], other[k]) for k in one)
    return bool(one == other)
