"""Scenes, sensors and aircraft of the project's folder ``configs``, and reading them.

Nothing here changes a value: every item takes one sensor's parameters from the same file.
"""

import csv
from pathlib import Path
from typing import Any

from components.aircraft.aircraft import Aircraft
from components.examples import folder
from components.optical.camera import Camera
from components.optical.eo import ElectroOptical
from components.optical.ir import Infrared
from components.radar.swerling import SwerlingParameters
from dsa_des.block.component import Context
from dsa_des.scene.scene_file import read_scene_file
from dsa_des.time.randomness import Streams


def configs() -> Path:
    """Return the folder ``configs`` of the project: in the package, or beside it in its source."""
    return folder()


def table(name: str) -> dict[str, Any]:
    """Return a TOML file of ``configs`` with all it extends, for example ``sensors/oasys``."""
    return read_scene_file(configs() / f"{name}.toml").data


def radar(name: str = "oasys", **changes: Any) -> SwerlingParameters:
    """Return the parameters of a radar of ``configs/sensors``."""
    return SwerlingParameters.model_validate({**_without_type(f"sensors/{name}"), **changes})


def eo_camera(name: str = "afrl_eo") -> Camera:
    """Return an electro-optical camera of ``configs/sensors``, for its pixels and its weights."""
    return _camera(ElectroOptical, name)


def ir_camera(name: str = "midas_ir") -> Camera:
    """Return an infrared camera of ``configs/sensors``."""
    return _camera(Infrared, name)


def aircraft(name: str) -> Aircraft:
    """Return an aircraft of ``configs/aircraft``."""
    return Aircraft.model_validate(table(f"aircraft/{name}"))


def read_csv(name: str) -> list[dict[str, str]]:
    """Return the rows of a CSV file of ``configs/thesis``; lines with ``#`` are comments."""
    text = (configs() / "thesis" / name).read_text(encoding="utf-8").splitlines()
    return list(csv.DictReader(line for line in text if not line.startswith("#")))


def _camera(kind: type[Camera], name: str) -> Camera:
    parameters = kind.Parameters.model_validate(_without_type(f"sensors/{name}"))
    return kind(name, parameters, Context(Streams(0)))


def _without_type(name: str) -> dict[str, Any]:
    return {key: value for key, value in table(name).items() if key != "type"}
