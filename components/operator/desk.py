"""Where decisions lie between the page of an operator and the block that takes them in."""

import threading
from collections.abc import Callable
from dataclasses import dataclass

from components.messages.decisions import OperatorDecision

#: A person does not decide so often between two scans; who floods the desk is refused.
MOST_WAITING = 32


@dataclass(frozen=True)
class Laid:
    """A decision on the desk, and who is told when it was taken in.

    Parameters
    ----------
    decision : OperatorDecision
    taken : callable
        Called with the simulated time, s, from the thread of the simulation.
    """

    decision: OperatorDecision
    taken: Callable[[float], None]


class Desk:
    """Decisions in the order in which they came; one thread lays them down, another takes them."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._waiting: list[Laid] = []
        self._open = True

    def lay(self, laid: Laid) -> bool:
        """Lay down a decision; False if the run is over or too many wait."""
        with self._lock:
            if not self._open or len(self._waiting) >= MOST_WAITING:
                return False
            self._waiting.append(laid)
            return True

    def take(self, time_s: float, tick: int) -> list[tuple[int, OperatorDecision]]:
        """Take all that waits, at an instant of the simulation, and tell those who laid it."""
        with self._lock:
            found, self._waiting = self._waiting, []
        for laid in found:
            laid.taken(time_s)
        return [(tick, laid.decision) for laid in found]

    def close(self) -> list[Laid]:
        """Take nothing more; return what was never taken in, and so never acknowledged."""
        with self._lock:
            self._open = False
            found, self._waiting = self._waiting, []
        return found
