"""The simulation as a block with its own ``process(self, env)`` generator sees it."""

from collections.abc import Callable
from typing import Any, Protocol

import numpy as np

from dsa_des.block.wake import Wake
from dsa_des.running.events import Bell, WakeUp
from dsa_des.running.run_state import RunState


class OwnProcess(Protocol):
    """The runtime of a block that has a process of its own."""

    simulation: RunState

    def priority(self) -> float:
        """Return its place within an instant."""

    def wait(self) -> Bell | WakeUp:
        """Return the event of the next arrival at a trigger input."""

    def receive(self) -> Wake:
        """Return the inputs as they are now."""

    @property
    def send(self) -> Callable[..., None]:
        """Send a message, or messages by output name, of some ticks."""


class BlockEnvironment:
    """SimPy's environment as one block sees it: same words, times in ticks, events in its order.

    A timeout here resumes the block at its own place within the instant, after every block
    upstream; SimPy's own timeouts would resume it before them.
    """

    def __init__(self, node: OwnProcess) -> None:
        self._node = node

    @property
    def now(self) -> int:
        """Current tick."""
        return int(self._node.simulation.env.now)

    @property
    def ticks_per_s(self) -> int:
        """Resolution of the run."""
        return self._node.simulation.ticks_per_s

    @property
    def simpy(self) -> Any:
        """The SimPy environment itself, for resources and stores."""
        return self._node.simulation.env

    def timeout(self, ticks: int) -> WakeUp:
        """Return an event `ticks` from now."""
        if ticks < 0:
            raise ValueError(f"ticks is {ticks}: it must be 0 or greater")
        return WakeUp(self._node.simulation.env, int(ticks), self._node.priority())

    def arrival(self) -> Bell | WakeUp:
        """Return the event of the next arrival at a trigger input.

        It happens at once when something arrived since the last `receive`, while the block was
        busy with a timeout.
        """
        return self._node.wait()

    def receive(self) -> Wake:
        """Return the inputs as they are now; queued rows are handed out once."""
        return self._node.receive()

    def send(self, result: Any) -> None:
        """Send a message, or messages by output name; their tick must be `now`."""
        self._node.send(result, self.tick_array())

    def tick_array(self) -> np.ndarray:
        """Return the current tick as the ``tick`` of a one-row message."""
        return np.array([self.now], dtype=np.int64)
