"""Finding the instant at which a block failed inside a look-ahead window.

A block that handles a window at a time says only that something in the window went wrong. Draws
and scheduling are reproducible, so the run is repeated without recording, with the window cut at
the instants in question, until the failing call holds a single one.
"""

from collections.abc import Callable
from typing import Any, Protocol

from dsa_des.arrays.types import IntArray
from dsa_des.errors import BlockFailure, SceneError
from dsa_des.running.windows import Failure


class Repeated(Protocol):
    """A run of the same scene once more."""

    failure: Failure | None

    def run(self) -> Any:
        """Run to the end, or raise the `BlockFailure`."""


def pinpoint(repeat: Callable[[set[int]], Repeated], ticks: IntArray) -> BlockFailure | None:
    """Return the first failure of a run with its exact instant, or None if it won't repeat.

    Parameters
    ----------
    repeat : callable
        Makes the run that failed again, with windows cut at the given ticks.
    ticks : ndarray of int64
        The instants of the call that failed.
    """
    cuts: set[int] = set()
    while not cuts.issuperset(ticks.tolist()):
        cuts.update(ticks.tolist())
        try:
            again = repeat(cuts)
        except (SceneError, BlockFailure):
            return None
        try:
            again.run()
        except BlockFailure as failure:
            if again.failure is None or len(again.failure.ticks) <= 1:
                return failure
            ticks = again.failure.ticks
        else:
            return None
    return None
