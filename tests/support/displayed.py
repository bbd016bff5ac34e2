"""A scene run with the operator's display beside it, without a page."""

from collections.abc import Callable, Mapping
from typing import Any

import dsa_des
from components.cdti.scope import Scope
from dsa_des.record.recording import Recorder
from dsa_des.record.sinks import MemorySink
from dsa_des.running.simulation import Simulation


def displayed(
    scene: Mapping[str, Any],
    look: Callable[[Scope, float], None] | None = None,
    window: int | None = None,
) -> tuple[Scope, dict[str, list[dict[str, Any]]]]:
    """Return the display at the end of a run, and the recorded rows by table.

    Parameters
    ----------
    scene : mapping
    look : callable, optional
        Called with the display and the time, s, after each message.
    window : int, optional
        As of `Simulation`.
    """
    tables = MemorySink()
    recorder = Recorder([tables])
    simulation = Simulation(dsa_des.load_scene(scene), recorder=recorder, window=window)
    scope = Scope(simulation)
    recorder.listeners.append(scope.store_message)
    if look is not None:
        per_s = simulation.ticks_per_s
        recorder.listeners.append(lambda _, message: look(scope, int(message.tick[-1]) / per_s))
    simulation.run()
    return scope, {name: table.to_pylist() for name, table in tables.tables().items()}
