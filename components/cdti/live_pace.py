"""The pace of a run with a person in it: it waits for the clock, may pause, and can be stopped."""

import threading
from collections.abc import Callable

from dsa_des.running.pacing import Pacer

#: Wall time that a window stands for, s: so long, at most, a decision waits to be taken in.
WINDOW_S = 0.02
_LOOK_AGAIN_S = 0.25


class LivePacer(Pacer):
    """A pacer that holds while nobody is there, and tells how far the run has come.

    Parameters
    ----------
    factor : float
        Simulated seconds per second.
    holds : callable
        Whether the run waits now; asked between windows.
    came_to : callable
        Called with the simulated time, s, when the clock has come as far, and with the lag, s.
    """

    def __init__(
        self,
        factor: float,
        holds: Callable[[], bool],
        came_to: Callable[[float, float], None],
    ) -> None:
        super().__init__(factor)
        self._holds, self._came_to = holds, came_to
        self._changed = threading.Event()
        self.paused_s = 0.0

    @property
    def longest_window_s(self) -> float:
        """Simulated time that a window may hold, s."""
        return WINDOW_S * self.factor

    def wake(self) -> None:
        """Look again whether to wait: something has changed. Any thread may call it."""
        self._changed.set()

    def stop(self) -> None:
        """End the run after the window that is under way."""
        self.stopped = True
        self._changed.set()

    def start(self) -> None:
        """Let simulated time 0 be when nothing holds the run any more."""
        self._hold()
        super().start()

    def __call__(self, time_s: float) -> None:
        """Wait for the instant up to which the simulation has come, and while the run is held."""
        self.time_s = time_s
        due = self._started + time_s / self.factor
        while not self.stopped and (ahead_s := due - self.now()) > 0.0:
            self._changed.wait(min(ahead_s, _LOOK_AGAIN_S))
            self._changed.clear()
        lag_s = max(0.0, self.now() - due)
        self.windows += 1
        self.max_lag_s = max(self.max_lag_s, lag_s)
        self.total_lag_s += lag_s
        self._came_to(time_s, lag_s)
        self._hold()

    def _hold(self) -> None:
        """Wait while the run is held; its clock stands still meanwhile."""
        began = self.now()
        while not self.stopped and self._holds():
            self._changed.wait(_LOOK_AGAIN_S)
            self._changed.clear()
        held_s = self.now() - began
        self._started += held_s
        self.paused_s += held_s

    def report(self) -> dict[str, float]:
        """Return the factor, the lag, and for how long the run was held."""
        return {**super().report(), "paused_s": self.paused_s}
