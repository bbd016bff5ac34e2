"""The two SimPy events that blocks live by; both keep a block's own priority."""

from typing import Any

import simpy


class WakeUp(simpy.Event):
    """An event that happens after `delay` ticks with a priority of its own."""

    def __init__(self, env: simpy.Environment, delay: int, priority: Any) -> None:
        super().__init__(env)
        self._ok = True
        self._value = None
        env.schedule(self, priority, delay)


class Bell(simpy.Event):
    """What a block's process waits for; rung from inside a `WakeUp`, so it keeps its priority."""

    def ring(self) -> None:
        """Resume the waiting processes, now, within the current event."""
        callbacks, self.callbacks = self.callbacks, None  # type: ignore[assignment]
        self._ok = True
        self._value = None
        for callback in callbacks:
            callback(self)
