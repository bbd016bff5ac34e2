"""Running scenes in lock step and each by itself."""

from types import SimpleNamespace

import pyarrow.compute as pc
import pytest

from dsa_des.record.recording import Recorder
from dsa_des.record.sinks import MemorySink
from dsa_des.replicas.changed_scene import Replica, scene_of
from dsa_des.replicas.lockstep import lock_step
from dsa_des.running.simulation import Simulation


def tables_of(kind, scenes, runs=1, **options):
    """Return a simulation that has run, as one of `runs`, and what it recorded."""
    sink = MemorySink()
    simulation = kind(scenes, recorder=Recorder([sink], runs=runs), **options)
    simulation.run()
    return simulation, sink.tables()


def same_as_alone(scenes, **options):
    """Run scenes in lock step, check each against a run of its own, and return the simulation."""
    simulation, together = tables_of(lock_step, scenes, **options)
    assert sum(table.num_rows for table in together.values()) > 0
    for number, scene in enumerate(scenes):
        for name, alone in tables_of(Simulation, scene, len(scenes))[1].items():
            mine = pc.equal(together[name]["replica"], number)
            got = together[name].filter(mine).drop_columns(["replica"]).combine_chunks()
            assert got.equals(alone), (number, name)
    return simulation


def replicas_of(scene, *changes):
    """Return a scene for each set of changes, with seeds of their own."""
    return [scene_of(scene, Replica(20 + i, change)) for i, change in enumerate(changes)]


@pytest.fixture(scope="session")
def lock():
    """Everything above."""
    return SimpleNamespace(
        tables_of=tables_of, same_as_alone=same_as_alone, replicas_of=replicas_of
    )
