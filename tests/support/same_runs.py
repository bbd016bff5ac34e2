"""The same rows however a scene is run: in any window, and beside other runs."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import pyarrow.compute as pc

from dsa_des.record.recording import Recorder
from dsa_des.record.sinks import MemorySink
from dsa_des.replicas.changed_scene import Replica, replica_scene
from dsa_des.replicas.lockstep import make_lockstep_simulation
from dsa_des.running.simulation import Simulation


def tables_of(scene: Any, runs: int = 1, **options: Any) -> tuple[Simulation, dict[str, Any]]:
    """Return a simulation that has run, as one of `runs`, and what it recorded.

    Of a list of scenes it is all of them in lock step.
    """
    sink = MemorySink()
    kind = make_lockstep_simulation if isinstance(scene, list) else Simulation
    simulation = kind(scene, recorder=Recorder([sink], runs=runs), **options)
    simulation.run()
    return simulation, {name: each.combine_chunks() for name, each in sink.tables().items()}


def replicas_of(scene: Any, *changes: Mapping[str, Any]) -> list[Any]:
    """Return a scene for each set of changes, with seeds of their own."""
    return [replica_scene(scene, Replica(20 + i, change)) for i, change in enumerate(changes)]


def same_as_alone(scenes: Sequence[Any], **options: Any) -> Simulation:
    """Run scenes in lock step, check each against a run of its own, and return the simulation."""
    simulation, together = tables_of(list(scenes), **options)
    rows = 0
    for number, scene in enumerate(scenes):
        for name, alone in tables_of(scene, len(scenes))[1].items():
            mine = pc.equal(together[name]["replica"], number)
            got = together[name].filter(mine).drop_columns(["replica"]).combine_chunks()
            assert got.equals(alone), (number, name)
            rows += alone.num_rows
    assert rows == sum(table.num_rows for table in together.values()) > 0
    return simulation


def same_in_any_window(
    scene: Any, windows: Iterable[int] = (1, 7), **options: Any
) -> dict[str, Any]:
    """Run a scene in each window, check every table, and return those of its own window."""
    _, whole = tables_of(scene)
    for window in windows:
        _, other = tables_of(scene, window=window, **options)
        assert other.keys() == whole.keys()
        for name, table in whole.items():
            assert other[name].equals(table), (window, name)
    return whole
