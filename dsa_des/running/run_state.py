"""What a block, or a window that may be rewound, needs of the run it is part of."""

from collections.abc import Mapping, Sequence
from typing import Any, Protocol

import simpy

from dsa_des.arrays.types import IntArray
from dsa_des.block.component import Component
from dsa_des.record.recording import Recorder
from dsa_des.running.channel import Channel
from dsa_des.running.windows import Window
from dsa_des.time.run_ends import RunEnds


class RunningBlock(Protocol):
    """A block as its run sees it; `runner` is what handles its wakes."""

    runner: Any

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

    ``window`` is the one that runs now; ``trace`` and ``recorder`` are None where
    they are not asked for.
    """

    env: simpy.Environment
    ticks_per_s: int
    trace: list[tuple[int, str]] | None
    recorder: Recorder | None
    window: Window
    ends: RunEnds

    @property
    def span_ticks(self) -> int:
        """Ticks from one replica's start to the next; 0 where one runs by itself."""

    @property
    def side_by_side(self) -> bool:
        """Whether windows are stretches of time of all replicas."""

    def stretch(self, ticks: IntArray) -> tuple[int, int]:
        """Return a start and an end between which the rows of a wake lie, as clocks count."""

    def fail(
        self, node: RunningBlock, ticks: IntArray, error: BaseException, scan: int = -1
    ) -> None:
        """Note that a block raised when it handled `ticks`, and leave SimPy."""
