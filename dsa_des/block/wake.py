"""One wake of a block: the instants it runs at, its inputs there and what it answers."""

from collections.abc import Callable, Collection, Iterator, Mapping
from copy import copy
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from dsa_des.arrays.run_ticks import RunTicks, is_shared_single_run, positions_with_found_mask
from dsa_des.arrays.types import BoolArray, FloatArray, IntArray
from dsa_des.block.message import Message


@dataclass(frozen=True, eq=False)
class Arrivals:
    """The rows that came over one wire since the block's last run.

    Parameters
    ----------
    source : str
        Name of the sending block.
    instants : RunTicks
        When each row arrived, and in which run.
    message : Message
        The rows; ``message.tick`` says what instants they speak of.
    """

    source: str
    instants: RunTicks
    message: Any

    @property
    def tick(self) -> IntArray:
        """When each row arrived, in ticks of its run."""
        return self.instants.tick


class Wake:
    """One run of a block: an instant, or a window of instants, in order within each run.

    Parameters
    ----------
    instants : RunTicks
        Run and tick of each row, in order of run: ``run`` and ``ticks``. A single run is run 0, and
        ticks count from the start of the row's own.
    scans : ndarray of int64, shape (rows,)
        Scan numbers of the block's own clock; -1 at instants that are not its own scans.
    ticks_per_s : int
    held : mapping
        For sampled and trigger inputs: ``(message, rows)`` as `Channel.sample` gives them.
    arrived : mapping
        For queued inputs, and for inputs with many writers: the new rows of each wire.
    demand : callable, or None
        Gives the attribute of this name when it is first asked for: a mapping from each clocked
        block downstream to the rows of this wake at which it scans.
    first_run : int
        The first run that goes on: rows of those before it never come again.
    clock : callable, optional
        Given scan numbers and their runs, returns when the scan before each was
        (`RunClock.previous_ticks`).
    idle : ndarray of bool, shape (rows,), optional
        At which rows nothing came and no scan is: the block is woken as it asked to be
        (`Component.acts_every_s`). By default none.
    """

    def __init__(
        self,
        instants: RunTicks,
        scans: IntArray,
        ticks_per_s: int,
        held: Mapping[str, tuple[Any, IntArray]],
        arrived: Mapping[str, list[Arrivals]],
        demand: Callable[[], Mapping[str, IntArray]] | None = None,
        first_run: int = 0,
        clock: Callable[[IntArray, IntArray], IntArray] | None = None,
        idle: BoolArray | None = None,
    ) -> None:
        self.instants = instants
        self.run, self.ticks = instants.run, instants.tick
        self.scans = scans
        self.ticks_per_s = ticks_per_s
        self._held = held
        self._arrived = arrived
        self._demand = demand
        self.first_run = first_run
        self._clock = clock
        self._idle = idle

    def __len__(self) -> int:
        return len(self.ticks)

    @cached_property
    def demand(self) -> Mapping[str, IntArray]:
        """The rows of this wake at which each clocked block downstream scans, by block name."""
        return {} if self._demand is None else self._demand()

    @property
    def idle(self) -> BoolArray:
        """Mask of rows without messages, run only because of `Component.acts_every_s`."""
        return np.zeros(len(self), dtype=bool) if self._idle is None else self._idle

    def without_idle(self) -> "Wake | None":
        """Return the wake without its idle rows: itself if none is idle, None if all are."""
        if self._idle is None or not self._idle.any():
            return self
        rows = np.flatnonzero(~self._idle)
        return self.select_rows(rows, self._arrived) if len(rows) else None

    def select_rows(self, rows: IntArray, arrived: Mapping[str, list[Arrivals]]) -> "Wake":
        """Return a wake of the rows at the given indices, with `arrived` as its arrivals."""
        held = {port: (message, of[rows]) for port, (message, of) in self._held.items()}

        def demand() -> dict[str, IntArray]:
            return {
                block: np.flatnonzero(np.isin(rows, asked)) for block, asked in self.demand.items()
            }

        return Wake(
            self.instants.take_with_known_positions(rows), self.scans[rows], self.ticks_per_s,
            held, arrived, demand,
            first_run=self.first_run, clock=self._clock,
            idle=None if self._idle is None else self._idle[rows],
        )  # fmt: skip

    @cached_property
    def previous_scan_tick(self) -> IntArray:
        """The tick of the block's scan before each row, in the row's run; -1 if there is none."""
        if self._clock is None:
            return np.full(len(self), -1)
        return self._clock(self.scans, self.run)

    @property
    def time_s(self) -> FloatArray:
        """Time of each row since the start of its run, s."""
        return self.ticks / self.ticks_per_s

    def held(self, port: str) -> tuple[Any, IntArray] | None:
        """Return ``(message, rows)`` of an input: row ``rows[i]`` is the latest at instant i (-1 if
        none has arrived); None if the input holds nothing.
        """
        return self._held.get(port)

    def __getitem__(self, port: str) -> Any:
        """Return the message held at each instant, row by row, or None when nothing came yet."""
        held = self._held.get(port)
        if held is None:
            return None
        message, rows = held
        count = len(rows)
        whole = len(message) == count and rows[0] == 0 and rows[-1] == count - 1
        if whole and (count == 1 or bool((rows[1:] > rows[:-1]).all())):
            return message
        if rows[0] < 0:
            if rows[-1] < 0:
                return None
            raise LookupError(f"nothing has arrived at {port!r} at the first instants; use held()")
        return message.take(rows)

    def arrivals(self, port: str) -> list[Arrivals]:
        """Return the new rows of each wire into `port`, sorted by source name."""
        return self._arrived.get(port, [])


def messages_by_output(result: Any, outputs: Collection[str]) -> Mapping[str, Message]:
    """Return a block's messages by output, a dict; a single message is the only output's.

    TypeError if a lone message could go to several outputs.
    """
    if result is None:
        return {}
    if not isinstance(result, Message):
        return result
    if len(outputs) != 1:
        raise TypeError(
            f"returned one message but has {len(outputs)} outputs; return a dict of "
            f"{', '.join(sorted(outputs)) or 'nothing'}"
        )
    return {next(iter(outputs)): result}


def checked_messages(
    result: Any, outputs: Mapping[str, Any], ran: RunTicks
) -> Iterator[tuple[str, Message]]:
    """Yield (output, message) of all returned messages that have rows, after checking them.

    TypeError or ValueError if one is not what its output declares, or of other instants than `ran`.
    """
    for port, message in messages_by_output(result, outputs).items():
        declared = outputs.get(port)
        if declared is None:
            raise TypeError(f"returned a message for {port!r}, which is not one of its outputs")
        if not isinstance(message, declared.message):
            raise TypeError(
                f"output {port!r} is declared to send {declared.message.__name__}, "
                f"not {type(message).__name__}"
            )
        if len(message.tick) == 0:
            continue
        message.check()
        yield port, _with_run_numbers(port, message, ran)


def _with_run_numbers(port: str, message: Message, ran: RunTicks) -> Message:
    """Return the message with the run number of each row, set here if the block did not set it.

    Rows that are not of instants at which the block ran, in order, are refused: what a row is dated
    with is when it was made, which decides when it arrives and where it stands in the recording.
    """
    sent = message.tick
    if sent is ran.tick:
        message = message if is_shared_single_run(ran.run) else copy(message)
        message.instants = ran  # with what is known of them
        return message
    if sent.dtype == np.int64:
        if not is_shared_single_run(ran.run) and is_shared_single_run(message.run):
            if ran.is_one_run:
                message = message.with_runs(np.full(len(sent), ran.run[0], dtype=np.int64))
            elif np.array_equal(sent, ran.tick):
                message = message.with_runs(ran.run)
            else:
                raise ValueError(
                    f"output {port!r} has {len(sent)} rows, and the wake {len(ran)} of several "
                    "runs: the message must say of which run each is (`run = wake.run[rows]`)"
                )
        position, there = positions_with_found_mask(ran, message.instants)
        if there is None and bool((position[1:] >= position[:-1]).all()):
            return message
    raise ValueError(
        f"output {port!r} has ticks [{sent[0]} ... {sent[-1]}] of type {sent.dtype}; "
        f"they must be int64 and lie in the instants it ran at, in order: those of the wake "
        f"[{ran.tick[0]} ... {ran.tick[-1]}], also where an input speaks of an earlier one"
    )
