"""The state of a run that a block needs, or a window that may be rewound."""

from collections.abc import Mapping, Sequence
from typing import Protocol

import simpy

from dsa_des.arrays.types import IntArray
from dsa_des.block.component import Component
from dsa_des.errors import BlockFailure
from dsa_des.record.recording import Recorder
from dsa_des.running.channel import Channel
from dsa_des.running.rewind_check import Witness


class RunningBlock(Protocol):
    """A block as its run sees it."""

    @property
    def name(self) -> str:
        """Its name in the scene."""

    @property
    def component(self) -> Component:
        """The block itself."""

    @property
    def channels(self) -> Mapping[str, Sequence[Channel]]:
        """The wires into it, by input."""


class RunState(Protocol):
    """The state of a run that all of its blocks share.

    ``window`` is the one that runs now, in ticks [start, end); ``trace`` and ``recorder`` are None
    where they are not asked for; ``span_ticks`` is 0 where no replicas share the run.
    """

    env: simpy.Environment
    ticks_per_s: int
    window: tuple[int, int]
    trace: list[tuple[int, str]] | None
    recorder: Recorder | None

    @property
    def span_ticks(self) -> int:
        """Ticks from one replica's start to the next."""

    @property
    def end_tick(self) -> int:
        """First tick that is no longer simulated."""

    def fail(
        self, node: RunningBlock, ticks: IntArray, error: BaseException, scan: int = -1
    ) -> None:
        """Note that a block raised when it handled `ticks`, and leave SimPy."""


class RewindableRun(RunState, Protocol):
    """A run whose windows may have to be run again.

    ``failure`` is what a block raised in this window and why, ``failed_at`` the instants of the
    call; ``cuts`` are ticks at which windows end, ``cut_edges`` the (source, target) pairs of the
    wires that close loops. ``witness``, if there is one, compares windows that run twice.
    """

    failure: tuple[BlockFailure, BaseException] | None
    failed_at: IntArray
    cuts: list[int]
    cut_edges: set[tuple[str, str]]
    witness: Witness | None
    window_ticks: int

    @property
    def nodes(self) -> Mapping[str, RunningBlock]:
        """The running blocks by name."""

    def run_window(self, start: int, end: int) -> None:
        """Run every block over [start, end)."""

    def raise_failure(self) -> None:
        """Raise what a block raised in this window, if one did."""
