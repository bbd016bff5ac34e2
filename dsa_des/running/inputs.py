"""What a block sees when it runs: what its inputs hold at each instant, and what has arrived.

The same for blocks that SimPy wakes, whatever their grain, and those that a host program calls.
"""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Protocol

import numpy as np

from dsa_des.arrays.types import IntArray
from dsa_des.block.message import Message
from dsa_des.block.ports import Input
from dsa_des.block.wake import Arrivals, Wake


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
    span_ticks, side_by_side
        As for `Wake`.
    """

    def __init__(
        self,
        declared: Mapping[str, Input],
        wires: Mapping[str, Sequence[WireEnd]],
        ticks_per_s: int,
        span_ticks: int = 0,
        *,
        side_by_side: bool = False,
    ) -> None:
        every = [(port, wire) for port in declared for wire in wires.get(port, ())]
        self._held = [(p, wire, declared[p].required) for p, wire in every if declared[p].held]
        self._queued = [(p, wire) for p, wire in every if not declared[p].held]
        self._ticks_per_s, self._span_ticks = ticks_per_s, span_ticks
        self._side_by_side = side_by_side

    def seen(
        self,
        ticks: IntArray,
        scans: IntArray,
        end: int,
        demand: Callable[[IntArray], Mapping[str, IntArray]] | None = None,
        *,
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
        return Wake(
            ticks, scans, self._ticks_per_s, held, arrived, asked, self._span_ticks,
            side_by_side=self._side_by_side,
        )  # fmt: skip


def _some_missing(sample: tuple[Message, IntArray] | None) -> bool:
    if sample is None:
        return True
    rows = sample[1]
    return bool(rows[0] < 0 if len(rows) == 1 else (rows < 0).any())
