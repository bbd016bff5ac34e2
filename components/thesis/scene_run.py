"""Running a scene of ``configs`` in memory and reading what was recorded."""

import time
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from components.display.flights import Flights
from components.thesis.project_files import configs
from dsa_des.errors import UsageError
from dsa_des.recording import MemorySink, Recorder
from dsa_des.scene import Scene, load_scene
from dsa_des.simulation import Simulation
from dsa_des.types import AnyArray


@dataclass
class SceneRun:
    """A run of one scene.

    Parameters
    ----------
    simulation : Simulation
    tables : dict
        Recorded tables, Arrow.
    wall_s : float
        Time that building and running took.
    """

    simulation: Simulation
    tables: dict[str, Any]
    wall_s: float

    def rows(self, table: str, **where: str) -> dict[str, AnyArray]:
        """Return the columns of a recorded table, of those rows whose columns have these texts."""
        found = self.tables[table]
        columns = {name: np.asarray(found[name].to_pylist()) for name in where}
        keep = np.ones(found.num_rows, dtype=bool)
        for name, text in where.items():
            keep &= columns[name] == text
        return {
            name: found[name].to_numpy(zero_copy_only=False)[keep] for name in found.schema.names
        }

    @cached_property
    def flights(self) -> Flights:
        """Where everybody was."""
        found = Flights.of(self.simulation, {})
        if found is None:
            raise UsageError(f"{self.simulation.scene.path}: has no traffic")
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
    sink = MemorySink()
    simulation = Simulation(loaded, recorder=Recorder([sink]))
    simulation.run()
    wall_s = time.perf_counter() - started
    return SceneRun(simulation, sink.tables(), wall_s)


def monte_carlo(loaded: Scene, replicas: int) -> list[SceneRun]:
    """Run a scene with the seeds 0, 1, ...; the draws of each run are its own."""
    return [run(replace(loaded, seed=seed)) for seed in range(replicas)]
