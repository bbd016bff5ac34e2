"""Scenes, sensors and aircraft of ``configs``: reading them, and running scenes in memory.

Nothing here changes a value: every item takes one sensor's parameters from the same file.
"""

import csv
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from components.aircraft.aircraft import Aircraft
from components.display.flights import Flights
from components.examples import configs_folder
from components.optical.camera import Camera
from components.optical.sensors import ElectroOptical, Infrared
from components.radar.swerling import SwerlingParameters
from dsa_des.arrays.types import AnyArray
from dsa_des.block.component import Context
from dsa_des.block.message import Columns, Text
from dsa_des.errors import UsageError
from dsa_des.record.recording import Recorder
from dsa_des.record.sinks import ColumnSink
from dsa_des.replicas.changed_scene import Replica
from dsa_des.replicas.replicas import Failed, run_replicas
from dsa_des.running.simulation import Simulation
from dsa_des.scene.scene import Scene, load_scene
from dsa_des.scene.scene_file import read_scene_file
from dsa_des.time.randomness import Streams


def configs() -> Path:
    """Return the folder ``configs`` of the project: in the package, or beside it in its source."""
    return configs_folder()


def read_config(name: str) -> dict[str, Any]:
    """Return a TOML file of ``configs``, as ``sensors/oasys``, merged with those it extends."""
    return read_scene_file(configs() / f"{name}.toml").data


def radar_parameters(name: str = "oasys", **changes: Any) -> SwerlingParameters:
    """Return the parameters of a radar of ``configs/sensors``."""
    return SwerlingParameters.model_validate({**_block_parameters(f"sensors/{name}"), **changes})


def eo_camera(name: str = "afrl_eo") -> Camera:
    """Return an electro-optical camera built from a file of ``configs/sensors``."""
    return _camera(ElectroOptical, name)


def ir_camera(name: str = "midas_ir") -> Camera:
    """Return an infrared camera built from a file of ``configs/sensors``."""
    return _camera(Infrared, name)


def aircraft(name: str) -> Aircraft:
    """Return an aircraft of ``configs/aircraft``."""
    return Aircraft.model_validate(read_config(f"aircraft/{name}"))


def silhouette_area_keywords(name: str, band: str = "eo") -> dict[str, Any]:
    """Return an aircraft's areas (m²) in band eo or ir, by keyword of the silhouette models."""
    result: dict[str, Any] = getattr(aircraft(name), band).model_dump(
        exclude={"silhouette_table", "made_for"}
    )
    return result


def read_thesis_csv(name: str) -> list[dict[str, str]]:
    """Return the rows of a CSV file of ``configs/thesis``; lines with ``#`` are comments."""
    text = (configs() / "thesis" / name).read_text(encoding="utf-8").splitlines()
    return list(csv.DictReader(line for line in text if not line.startswith("#")))


def _camera(kind: type[Camera], name: str) -> Camera:
    parameters = kind.Parameters.model_validate(_block_parameters(f"sensors/{name}"))
    return kind(name, parameters, Context(Streams(0)))


def _block_parameters(name: str) -> dict[str, Any]:
    """Return the parameters in a block's configuration, without type and acknowledged notes."""
    beside = "type", "acknowledged"
    return {key: value for key, value in read_config(name).items() if key not in beside}


@dataclass
class ThesisRecording:
    """Recorded tables of one run of a scene."""

    #: Table name → column name → values.
    tables: Mapping[str, Columns]

    def matching_rows(self, table: str, **where: str) -> dict[str, AnyArray]:
        """Return a recorded table's columns, for rows whose named columns equal the texts."""
        columns = {name: _values(column) for name, column in self.tables[table].items()}
        keep = np.ones(len(columns["tick"]), dtype=bool)
        for name, text in where.items():
            keep &= columns[name] == text
        return {name: values[keep] for name, values in columns.items()}


@dataclass
class SceneRun(ThesisRecording):
    """Recorded tables of one run of a scene, together with the simulation that ran."""

    simulation: Simulation
    #: Time that building and running took.
    wall_s: float

    @cached_property
    def flights(self) -> Flights:
        """True flights of all aircraft of the run."""
        return flights_of(self.simulation)


def _values(column: AnyArray | Text) -> AnyArray:
    if isinstance(column, Text):
        return np.array([*column.names, None], dtype=object)[column.codes]
    return column


def flights_of(simulation: Simulation) -> Flights:
    """Return the true flights of all aircraft of a simulation; UsageError if it has no traffic."""
    result = Flights.from_simulation(simulation, {})
    if result is None:
        raise UsageError(f"{simulation.scene.path}: has no traffic")
    return result


def load_config_scene(name: str, *sets: str, swaps: Sequence[str] = ()) -> Scene:
    """Return a ``configs`` scene, as ``thesis/fig_4_14``, with values set and blocks swapped."""
    return load_scene(configs() / f"{name}.toml", sets=sets, swaps=swaps)


def run(loaded: Scene) -> SceneRun:
    """Run a scene in memory."""
    started = time.perf_counter()
    sink = ColumnSink()
    simulation = Simulation(loaded, recorder=Recorder([sink]))
    simulation.run()
    wall_s = time.perf_counter() - started
    return SceneRun(sink.tables(), simulation, wall_s)


def run_replicas_of_scene(loaded: Scene, replicas: int) -> list[ThesisRecording]:
    """Run a scene with the seeds 0, 1, ... and return the recording of each run."""
    done = []
    for outcome in run_replicas(loaded, [Replica(seed) for seed in range(replicas)]):
        if isinstance(outcome, Failed):
            raise ValueError(f"{loaded.path}: {outcome.error}")
        done.append(ThesisRecording(outcome.tables))
    return done
