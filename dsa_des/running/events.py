"""SimPy as blocks see it: two events, their order, what all of a run share, and the environment.

Both events keep a block's own priority within an instant.
"""

from collections.abc import Callable
from typing import Any, Protocol

import numpy as np
import simpy

from dsa_des.arrays.run_ticks import RunTicks, shared_zero_run_numbers
from dsa_des.arrays.types import IntArray
from dsa_des.block.wake import Wake
from dsa_des.record.recording import Recorder
from dsa_des.running.windows import RunningBlock, Window
from dsa_des.time.timeline_runs import Runs

# SimPy's own URGENT (0) ends a run just before an instant; nothing of ours may come before it.
WINDOW_PRIORITY = 1.0
DEPTH_PRIORITY = 1000.0
# What a block sends later than it is made is there before any block runs.
LEAVE_PRIORITY = 0.5


class Abort(Exception):
    """Raised to leave SimPy after a block failed; the simulation keeps the failure itself.

    SimPy rebuilds an exception from its ``args``, which breaks those that need keywords, so the
    original never travels through it.
    """


class WakeUp(simpy.Event):
    """A SimPy event that happens `delay` ticks from now, with a priority of its own."""

    def __init__(self, env: simpy.Environment, delay: int, priority: Any) -> None:
        super().__init__(env)
        self._ok = True
        self._value = None
        env.schedule(self, priority, delay)


class Bell(simpy.Event):
    """A SimPy event that a block's process waits for; rung in a `WakeUp`, it keeps its priority."""

    def ring(self) -> None:
        """Resume the waiting processes immediately, within the current event."""
        callbacks, self.callbacks = self.callbacks, None  # type: ignore[assignment]
        self._ok = True
        self._value = None
        for callback in callbacks:
            callback(self)


class RunState(Protocol):
    """Interface of the state of a run that all of its blocks share.

    ``window`` is the one that runs now; ``recorder`` is None where nothing is recorded.
    """

    env: simpy.Environment
    ticks_per_s: int
    recorder: Recorder | None
    window: Window
    runs: Runs

    def fail(
        self, node: RunningBlock, ticks: IntArray, error: BaseException, scan: int = -1
    ) -> None:
        """Record that a block raised an error when it handled `ticks`, and leave SimPy."""


class OwnProcess(Protocol):
    """What a `BlockEnvironment` needs of its block's node: priority, arrivals, inputs, sending."""

    simulation: RunState

    def priority(self) -> float:
        """Return the block's priority among the events of one instant."""

    def wait(self) -> Bell | WakeUp:
        """Return the event of the next arrival at a trigger input."""

    def receive(self) -> Wake:
        """Return a `Wake` with the inputs as they are now."""

    @property
    def send(self) -> Callable[..., None]:
        """Send a message, or messages by output name, for the given instants."""


class BlockEnvironment:
    """SimPy's environment for one block: the same method names, times in ticks, and events in the
    block's place within an instant.

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
        """Ticks per second of the run."""
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
        """Return a `Wake` with the inputs as they are now; queued rows are handed out once."""
        return self._node.receive()

    def send(self, result: Any, leaves: int | None = None) -> None:
        """Send a message, or messages by output name; their tick must be `now`.

        It sets out later, where `leaves` is a later tick: before any block runs then.
        """
        self._node.send(result, RunTicks(shared_zero_run_numbers(1), self.tick_array()), leaves)

    def tick_array(self) -> np.ndarray:
        """Return the current tick as the ``tick`` of a one-row message."""
        return np.array([self.now], dtype=np.int64)
