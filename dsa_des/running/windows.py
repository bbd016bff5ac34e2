"""Windows: what of a run is simulated at a time.

A run asks its windows which one comes next, runs it, and tells them what came of it. They decide
whether it stands or is to be run otherwise; nothing that is recorded depends on them. `Windows` end
where something that was sent in them could come back.

`RewindingWindows` look farther. In a loop every way back has a delay. A window is run with its
feedback wires cut: blocks see what had come back before the window began. If then a message turns
out to arrive inside the window, everything from that instant on was wrong; the run goes back to the
window's start and runs it again up to that instant, where it was right. Windows start small after
such a message and double while nothing comes back; they are never shorter than the delay of what
comes back, as within it nothing can.
"""

from collections import deque
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import numpy as np

from dsa_des.arrays.run_ticks import RunTicks
from dsa_des.arrays.types import IntArray
from dsa_des.block.component import Component
from dsa_des.errors import BlockFailure
from dsa_des.record.recording import Recorder
from dsa_des.running.channel import Channel
from dsa_des.time.run_clock import RunClock
from dsa_des.time.timeline_runs import Runs


class Window(NamedTuple):
    """A span of ticks [start, end) that is simulated in one go.

    All of a provisional window runs at its start, and may be undone: what a block raises in it
    counts only when the windows let it stand. Blocks that no loop leads to run from its start up to
    `ahead`, not at all where that is the start: they have come farther.
    """

    start: int
    end: int
    ahead: int
    provisional: bool = False


@dataclass(frozen=True)
class Failure:
    """What a block raised in a window: error to show, original exception and instants handled."""

    said: BlockFailure
    cause: BaseException
    ticks: IntArray


@dataclass
class Demand:
    """A block downstream with a scan clock, and how many ticks before its scans it needs rows."""

    block: str
    clock: RunClock
    lead_ticks: int

    def instants_between(self, start: int, end: int) -> RunTicks:
        """Return instants in [start, end) when the upstream block must send for this one's scans.

        None of these rows would arrive after the end of the run, where the clock has no scan.
        """
        _, instants = self.clock.scans_between(start + self.lead_ticks, end + self.lead_ticks)
        return instants.add_ticks(-self.lead_ticks) if self.lead_ticks else instants


class RunningBlock(Protocol):
    """A block as its run sees it; `runner` is the object that handles its wakes."""

    runner: Any

    @property
    def name(self) -> str:
        """The block's name in the scene."""

    @property
    def component(self) -> Component:
        """The block's component."""

    @property
    def state_objects(self) -> Sequence[object]:
        """All objects whose attributes hold the block's state."""

    @property
    def wires(self) -> Sequence[Channel]:
        """The channels of the wires into the block."""


class Windows:
    """Cuts runs into windows no longer than the horizon, group by group of runs to their end.

    Nothing that is sent in a window comes back in it. The horizon is the lookahead of conservative
    parallel simulation (Chandy and Misra, "Distributed simulation: a case study in design and
    verification of distributed programs", IEEE Transactions on Software Engineering SE-5, 1979).
    Blocks that no loop leads to have none: they run ahead, in windows of full length.

    Of runs without a loop as many whole ones go as a window of `longest_ticks` may hold, with a
    horizon all. `next_instant`, given a tick and that up to which blocks ahead of the loops have
    run, returns one before which no block runs: windows in which nothing happens are left out.
    """

    next_instant: Callable[[int, int], int] | None = None

    def __init__(
        self,
        runs: Runs,
        longest_ticks: int,
        horizon_ticks: int | None = None,
    ) -> None:
        self.runs, self.end_tick, self.longest_ticks = runs, runs.run_ticks, longest_ticks
        self._horizon, self._all_go = self.end_tick, horizon_ticks is not None
        if horizon_ticks is not None:
            self._horizon = max(1, horizon_ticks)
            self.longest_ticks = max(1, longest_ticks // runs.count)  # each has as many scans
        self._begin(0)

    def _begin(self, first: int) -> None:
        together = max(1, self.longest_ticks // self.end_tick)
        last = self.runs.count if self._all_go else min(first + together, self.runs.count)
        self.runs.going = range(first, last)
        self.start = 0
        self._ahead = 0  # up to when blocks before the loops have run

    def limit_length(self, longest_ticks: int) -> None:
        """Set the longest length of a window; to be called before the first window."""
        self.longest_ticks = min(self.longest_ticks, max(1, longest_ticks))
        if self.start == 0:
            self._begin(self.runs.going.start)

    def end_after(self, length_ticks: int) -> int:
        """Return the tick at which a window of this length from the current `start` ends."""
        return min(self.start + length_ticks, self.end_tick)

    def next(self) -> Window | None:
        """Return the window to run next, or None when the run is over."""
        if self.start >= self.end_tick:
            return None
        if self.next_instant is not None and self._all_go:
            self.start = min(self.next_instant(self.start, self._ahead), self.end_tick - 1)
        length, ahead = min(self.longest_ticks, self._horizon), self.start
        if self._ahead <= self.start:  # whole windows lie in what is run ahead
            ahead = self._ahead = self.end_after(self.longest_ticks // length * length)
        return Window(self.start, min(self.end_after(length), self._ahead), ahead)

    def commit(self, window: Window, failure: Failure | None) -> int | None:
        """Keep or undo a window that has run; `failure` is what a block raised in it.

        Returned is the tick before which everything is final, also the failure; None if the window
        does not stand, and what `next` gives is to be run instead.
        """
        self.start = window.end
        if self.start >= self.end_tick and self.runs.going.stop < self.runs.count:
            self._begin(self.runs.going.stop)
        return window.end


# At the start, and after something came back, a window has this part of its full length.
_RESTART = 32
_CONTAINERS = (list, dict, set, deque, np.ndarray)


class _Copied(dict[type, bool]):
    """Class → whether saving state copies its values, as a block might change them in place."""

    def __missing__(self, kind: type) -> bool:
        self[kind] = issubclass(kind, _CONTAINERS)
        return self[kind]


_copied = _Copied()


class Rewinder:
    """Saves and restores the state of all blocks, wires and the record of a run.

    Over the wires between `cut_edges` messages come back; `runs` forget ends that were undone.
    """

    def __init__(
        self,
        nodes: Collection[RunningBlock],
        cut_edges: Collection[tuple[str, str]],
        recorder: Recorder | None,
        runs: Runs,
    ) -> None:
        self._recorder = recorder
        self._things: list[Any] = [
            thing for node in nodes for thing in node.state_objects if hasattr(thing, "__dict__")
        ]
        self._things.append(runs)
        into = [(node.name, channel) for node in nodes for channel in node.wires]
        self._channels = [channel for _, channel in into]
        self._feedback = [channel for name, channel in into if (channel.source, name) in cut_edges]

    def record_feedback_arrivals(self) -> None:
        """Start anew to record when messages arrive over feedback wires."""
        for channel in self._feedback:
            channel.record_pushed_arrivals()

    def save_state(self) -> None:
        """Save the state of all blocks, wires and the record."""
        self._states = [_copy_state(vars(thing)) for thing in self._things]
        self._wires = [channel.state() for channel in self._channels]
        self._recorded = None if self._recorder is None else self._recorder.count_for_rewind()

    def restore(self) -> None:
        """Restore the state that was saved last."""
        for thing, state in zip(self._things, self._states, strict=True):
            vars(thing).clear()
            vars(thing).update(_copy_state(state))
        for channel, wire in zip(self._channels, self._wires, strict=True):
            channel.set_state(wire)
        if self._recorder is not None and self._recorded is not None:
            self._recorder.rewind(self._recorded)
        self.record_feedback_arrivals()

    def earliest_feedback_tick(self) -> int | None:
        """Return the earliest feedback arrival tick since recording began; None if none came."""
        ticks = [channel.earliest_pushed_tick() for channel in self._feedback]
        return min((tick for tick in ticks if tick is not None), default=None)


class RewindingWindows(Windows):
    """Windows longer than the horizon, for one run, undone if a message came back inside them."""

    def __init__(
        self, runs: Runs, longest_ticks: int, horizon_ticks: int, rewinder: Rewinder
    ) -> None:
        super().__init__(runs, longest_ticks, horizon_ticks)
        self._rewinder = rewinder
        self._length = 0
        self._least = self._horizon
        self._came = 0  # when something came back last
        self._right: Window | None = None  # what is right of a window that was undone
        self._careful = False  # whether they run no farther than the rest, after a failure

    def next(self) -> Window | None:
        """Return the valid part of an undone window, or a new one; None when the run is over.

        It may be undone if it is longer than the horizon, or blocks run ahead in it.
        """
        if self._right is not None or self.start >= self.end_tick:
            return self._right
        length = max(self._length or self._restart_length_ticks(), self._least)
        end = self.end_after(min(length, self.longest_ticks))
        ahead = end if self._careful else self.end_after(self.longest_ticks)
        if self._ahead > self.start:
            # A window does not reach beyond what is there of them.
            end, ahead = min(end, self._ahead), self.start
        provisional = max(end - self._horizon, ahead) > self.start
        if provisional:
            self._rewinder.save_state()
        self._rewinder.record_feedback_arrivals()
        return Window(self.start, end, ahead, provisional)

    def commit(self, window: Window, failure: Failure | None) -> int | None:
        """Keep a window that has run and return the tick before which all is final; if feedback
        came in it or its failure is uncertain, undo it and return None.
        """
        back = self._rewinder.earliest_feedback_tick()
        early = window.end if back is None else back
        if failure is not None and window.ahead > window.end:
            # Perhaps it lies beyond the window: again, and nobody runs ahead.
            self._rewinder.restore()
            self._right, self._careful = None, True
            return None
        if self._right is None and failure is not None and window.provisional:
            if early < window.end or len(failure.ticks) > 1:
                # What failed may never have happened: look less far.
                self._rewinder.restore()
                middle = int(failure.ticks[len(failure.ticks) // 2])
                self._length, self._least = max(1, min(early, middle) - self.start), 0
                return None
        elif self._right is None and early < window.end:
            self._rewinder.restore()
            self._right = Window(self.start, early, window.ahead, True)
            return None
        self._right, self._least = None, self._horizon
        self._ahead = max(self._ahead, window.ahead)
        self._careful = False
        if back is None:
            self._length = min(
                2 * (self._length or self._restart_length_ticks()), self.longest_ticks
            )
        else:  # what comes back often comes regularly; at first, or after a hurry, start small
            length = max(1, back - self._came) if self._came else self._restart_length_ticks()
            self._length = min(length, self.longest_ticks)
            self._came = back
        return super().commit(window, failure)

    def _restart_length_ticks(self) -> int:
        return max(1, min(self.longest_ticks // _RESTART, self._horizon))


def _copy_state(state: Mapping[str, Any]) -> dict[str, Any]:
    """Return an object's attributes, with copies of values a block might change in place."""
    return {
        name: value.copy() if _copied[value.__class__] else value for name, value in state.items()
    }
