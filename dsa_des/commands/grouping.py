"""Whether a stranger's block gives the same however many scans it is given at a time."""

import os
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from dsa_des.errors import SceneError
from dsa_des.record.recording import Recorder
from dsa_des.record.sinks import MemorySink
from dsa_des.running.simulation import Simulation
from dsa_des.scene.scene import Scene
from dsa_des.terminal.terminal import say

_OURS = ("dsa_des", "components")
#: Scans of the slowest clock that are run for `check_window_independence`.
_SCANS_TO_GROUP = 8
_DEADLINE_S = 60.0


class _NotBack(Exception):
    """A block has not returned within the time allowed."""

    exit_code = 2


def check_window_independence(loaded: Scene, again: Callable[..., Scene]) -> None:
    """Raise SceneError if a foreign block's results differ for scans run singly and together."""
    strangers = [
        name
        for name, block in loaded.blocks.items()
        if block.cls.windowed and block.cls.__module__.partition(".")[0] not in _OURS
    ]
    clocks = [block.cls.clock_of(block.parameters) for block in loaded.blocks.values()]
    rates = [clock.rate_hz for clock in clocks if clock is not None]
    if not strangers or not rates:
        return
    length = _SCANS_TO_GROUP / min(rates)
    whole = again(duration=str(min(length, loaded.duration_s or length)))
    recorded = []
    try:
        with _interrupt_after(_DEADLINE_S):
            for window in (1, None):
                tables = MemorySink()
                Simulation(whole, window=window, recorder=Recorder([tables])).run()
                # As text: a value that is no number is equal to itself.
                recorded.append({name: str(t.to_pydict()) for name, t in tables.tables().items()})
    except _NotBack as error:  # in between two blocks
        raise SceneError(
            [loaded.problem(f"blocks.{n}.type", str(error)) for n in strangers]
        ) from None
    one, many = recorded
    differ = [name for name in one if one[name] != many[name]]
    if differ:
        message = "gives other results where scans are worked on one by one and together (table "
        message += f"{differ[0]}): what it returns must not depend on how often it is called"
        raise SceneError([loaded.problem(f"blocks.{name}.type", message) for name in strangers])


@contextmanager
def _interrupt_after(limit_s: float) -> Iterator[None]:
    """Raise `_NotBack` in the context after `limit_s` seconds, where the system has a timer."""
    ours = threading.current_thread() is threading.main_thread()
    if not ours or not hasattr(signal, "setitimer"):
        yield
        return

    words = f"has not returned within {limit_s:g} s, in which a few scans are tried"
    left = 3

    def late(*_: Any) -> None:
        nonlocal left
        left -= 1
        if left < 0:  # it catches all that is raised in it
            say(f"error: a block {words}", err=True)
            os._exit(2)
        raise _NotBack(words)

    before = signal.signal(signal.SIGALRM, late)
    signal.setitimer(signal.ITIMER_REAL, limit_s, 1.0)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
