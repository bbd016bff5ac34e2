"""Windows: what of a run is simulated at a time.

A run asks its windows which one comes next, runs it, and tells them what came of it. They decide
whether it stands or is to be run otherwise; nothing that is recorded depends on them. Some wrap
others: what waits for the wall clock (`dsa_des.running.pacing`) works with windows of any kind.
"""

from dataclasses import dataclass
from typing import NamedTuple, Protocol

from dsa_des.arrays.types import IntArray
from dsa_des.errors import BlockFailure


class Window(NamedTuple):
    """The ticks [start, end) that run at a time.

    All of a provisional window runs at its start, and may be undone: what a block raises in it
    counts only when the windows let it stand. Blocks that no loop leads to run from its start up to
    `ahead`, not at all where that is the start: they have come farther. None is the end.
    """

    start: int
    end: int
    provisional: bool = False
    ahead: int | None = None


@dataclass(frozen=True)
class Failure:
    """What a block raised in a window: as it is said, as it was, and at which instants."""

    said: BlockFailure
    cause: BaseException
    ticks: IntArray


class Windows(Protocol):
    """Which window comes next."""

    def limit(self, longest_ticks: int) -> None:
        """Let no window be longer than this; called before the first."""

    def next(self) -> Window | None:
        """Return the window to run now, or None when the run has come to its end."""

    def heard(self, window: Window, failure: Failure | None) -> int | None:
        """Take note that a window has run, and what a block raised in it.

        Returns
        -------
        int or None
            The tick before which everything is final, also the failure; None if the window does
            not stand, and what `next` gives is to be run instead.
        """


class EqualWindows:
    """Windows of one length from the start of a run to its end.

    Parameters
    ----------
    end_tick : int
        Where the last one ends.
    longest_ticks : int
    """

    def __init__(self, end_tick: int, longest_ticks: int) -> None:
        self.end_tick, self.longest_ticks = end_tick, longest_ticks
        self.start = 0

    def limit(self, longest_ticks: int) -> None:
        """Let no window be longer than this."""
        self.longest_ticks = min(self.longest_ticks, max(1, longest_ticks))

    def end_after(self, length_ticks: int) -> int:
        """Return where a window of this length from `start` on ends."""
        return min(self.start + length_ticks, self.end_tick)

    def next(self) -> Window | None:
        """Return the next window."""
        if self.start >= self.end_tick:
            return None
        return Window(self.start, self.end_after(self.longest_ticks))

    def heard(self, window: Window, failure: Failure | None) -> int | None:
        """Go on where a window ended."""
        self.start = window.end
        return window.end
