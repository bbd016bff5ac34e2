"""Running a scene of ``configs`` in memory and reading what was recorded."""

import time
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from components.display.flights import Flights
from components.evidence.thesis.project_files import configs
from dsa_des.arrays.types import AnyArray
from dsa_des.block.message import Columns, Text
from dsa_des.errors import UsageError
from dsa_des.record.recording import Recorder
from dsa_des.record.sinks import ColumnSink
from dsa_des.replicas.changed_scene import Replica
from dsa_des.replicas.replicas import Failed, run_replicas
from dsa_des.running.simulation import Simulation
from dsa_des.scene.scene import Scene, load_scene


@dataclass
class Recording:
    """What a run of a scene recorded.

    Parameters
    ----------
    tables : dict
        Table name → column name → values.
    """

    tables: Mapping[str, Columns]

    def rows(self, table: str, **where: str) -> dict[str, AnyArray]:
        """Return the columns of a recorded table, of those rows whose columns have these texts."""
        columns = {name: _values(column) for name, column in self.tables[table].items()}
        keep = np.ones(len(columns["tick"]), dtype=bool)
        for name, text in where.items():
            keep &= columns[name] == text
        return {name: values[keep] for name, values in columns.items()}


@dataclass
class SceneRun(Recording):
    """A run of one scene, with what ran.

    Parameters
    ----------
    tables : dict
    simulation : Simulation
    wall_s : float
        Time that building and running took.
    """

    simulation: Simulation
    wall_s: float

    @cached_property
    def flights(self) -> Flights:
        """Where all aircraft were."""
        return flights_of(self.simulation)


def _values(column: AnyArray | Text) -> AnyArray:
    if isinstance(column, Text):
        return np.array([*column.names, None], dtype=object)[column.codes]
    return column


def flights_of(simulation: Simulation) -> Flights:
    """Return where all aircraft are.

    Raises
    ------
    UsageError
        If the scene has no traffic.
    """
    found = Flights.of(simulation, {})
    if found is None:
        raise UsageError(f"{simulation.scene.path}: has no traffic")
    return found


def scene(name: str, *sets: str) -> Scene:
    """Load a scene of ``configs``, for example ``thesis/fig_4_14``, with values set.

    Raises
    ------
    SceneError
        With every problem found.
    """
    return load_scene(configs() / f"{name}.toml", sets=sets)


def run(loaded: Scene) -> SceneRun:
    """Run a scene in memory."""
    started = time.perf_counter()
    sink = ColumnSink()
    simulation = Simulation(loaded, recorder=Recorder([sink]))
    simulation.run()
    wall_s = time.perf_counter() - started
    return SceneRun(sink.tables(), simulation, wall_s)


def monte_carlo(loaded: Scene, replicas: int) -> list[Recording]:
    """Run a scene with the seeds 0, 1, ...; the draws of each run are its own.

    Raises
    ------
    ValueError
        If one of them failed.
    """
    done = []
    for outcome in run_replicas(loaded, [Replica(seed) for seed in range(replicas)]):
        if isinstance(outcome, Failed):
            raise ValueError(f"{loaded.path}: {outcome.error}")
        done.append(Recording(outcome.tables))
    return done
