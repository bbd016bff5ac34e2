"""Pacing of a run: simulated time goes by as fast as the clock on the wall, times a factor.

A pacer only waits between look-ahead windows (`Simulation.run`); it changes when results come,
never what they are.
"""

import math
import time
from collections.abc import Callable
from dataclasses import dataclass

from dsa_des.errors import UsageError
from dsa_des.text.safe_text import shorten

#: Wall time that a look-ahead window may stand for: what is simulated ahead stays below it, s.
LONGEST_WAIT_S = 0.1
#: Systems refuse to sleep for centuries, s.
LONGEST_SLEEP_S = 3600.0
_SLOWEST, _FASTEST = 1e-6, 1e12


def parse_factor(text: str, option: str = "--realtime") -> float:
    """Return the speed factor that is given as text for ``--realtime``, or for another option.

    A `UsageError` says so if it is not a finite number above 0.
    """
    try:
        factor = float(text)
    except ValueError:
        factor = math.nan
    if not _SLOWEST <= factor <= _FASTEST:
        raise UsageError(
            f"{option} {shorten(text, 80)}: must be a number above 0, from {_SLOWEST:g} to "
            f"{_FASTEST:g}: simulated seconds per second, 1 for the speed of the clock"
        )
    return factor


@dataclass
class Pacer:
    """Holds a simulation to `factor` simulated seconds per wall second, and measures its lag.

    `factor` are simulated seconds per second; `now` is the clock, s, and `sleep` waits so many
    seconds.
    """

    factor: float
    now: Callable[[], float] = time.perf_counter
    sleep: Callable[[float], None] = time.sleep
    windows: int = 0
    max_lag_s: float = 0.0
    total_lag_s: float = 0.0
    #: Whether the run is to end at the instant up to which it has come, and that instant, s.
    stopped: bool = False
    time_s: float = 0.0

    def __post_init__(self) -> None:
        self._started = self.now()

    @property
    def longest_window_s(self) -> float:
        """Simulated time that a window may hold, s."""
        return LONGEST_WAIT_S * self.factor

    def start(self) -> None:
        """Make the present wall-clock time that of simulated time 0."""
        self._started = self.now()

    def __call__(self, time_s: float) -> None:
        """Wait for the instant up to which the simulation has come."""
        self.time_s = time_s
        due = self._started + time_s / self.factor
        while (ahead_s := due - self.now()) > 0.0:
            self.sleep(min(ahead_s, LONGEST_SLEEP_S))
        # Waking up late counts as well: the user waits for that too.
        lag_s = max(0.0, self.now() - due)
        self.windows += 1
        self.max_lag_s = max(self.max_lag_s, lag_s)
        self.total_lag_s += lag_s

    def report(self) -> dict[str, float]:
        """Return the factor and by how much windows ended late, wall seconds."""
        mean_lag_s = self.total_lag_s / self.windows if self.windows else 0.0
        return {
            "factor": self.factor,
            "windows": self.windows,
            "max_lag_s": self.max_lag_s,
            "mean_lag_s": mean_lag_s,
        }

    def sentence(self) -> str:
        """Return the report as a sentence for the terminal."""
        said = self.report()
        return (
            f"paced at {self.factor:g} x wall clock: behind by at most "
            f"{_lag_text(said['max_lag_s'])}, {_lag_text(said['mean_lag_s'])} on average, "
            f"over {self.windows} windows"
        )


def _lag_text(lag_s: float) -> str:
    return f"{1000 * lag_s:.1f} ms" if lag_s < 10 else f"{lag_s:.1f} s"
