"""The engine of dsa_des: time, ports, graph, runs and recording of block simulations.

The package knows no radar. Blocks are found by their registered names (see
`dsa_des.block.registry`), so this package never imports `components`.
"""

import os
import sys


def _drop_working_directory_from_path() -> None:
    """Remove the working directory from ``sys.path`` if started as ``python -m dsa_des``.

    A ``re.py`` or a folder ``components`` there is not ours: this comes before any import that
    Python has not made already. The folder that we were imported from stays.
    """
    home = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
    as_program = sys.argv[:1] == ["-m"] and {"dsa_des", "-mdsa_des"} & {*sys.orig_argv}
    if as_program and not sys.flags.safe_path and sys.path[:1] == [os.getcwd()] != [home]:
        del sys.path[0]


_drop_working_directory_from_path()

from importlib import import_module  # noqa: E402
from typing import TYPE_CHECKING, Any  # noqa: E402

from dsa_des.record.version import __version__  # noqa: E402

if TYPE_CHECKING:
    from dsa_des.block.component import Component, Input, Output, Parameters
    from dsa_des.block.message import Message
    from dsa_des.errors import BlockFailure, OutputError, Problem, SceneError, UsageError
    from dsa_des.library.runs import run
    from dsa_des.library.scenes import load_scene
    from dsa_des.library.study import StudyResult, study
    from dsa_des.record.run_folder import Run, read_run
    from dsa_des.running.simulation import Simulation
    from dsa_des.scene.examples import examples
    from dsa_des.scene.scene import Scene
    from dsa_des.studies.runner import Progress

# Names are looked up on first use: `dsa-des --help` must not pay for NumPy or Arrow.
_HOMES = {
    "BlockFailure": "dsa_des.errors",
    "Component": "dsa_des.block.component",
    "Input": "dsa_des.block.component",
    "Message": "dsa_des.block.message",
    "Output": "dsa_des.block.component",
    "OutputError": "dsa_des.errors",
    "Parameters": "dsa_des.block.component",
    "Problem": "dsa_des.errors",
    "Progress": "dsa_des.studies.runner",
    "Run": "dsa_des.record.run_folder",
    "Scene": "dsa_des.scene.scene",
    "SceneError": "dsa_des.errors",
    "Simulation": "dsa_des.running.simulation",
    "StudyResult": "dsa_des.library.study",
    "UsageError": "dsa_des.errors",
    "examples": "dsa_des.scene.examples",
    "load_scene": "dsa_des.library.scenes",
    "read_run": "dsa_des.record.run_folder",
    "run": "dsa_des.library.runs",
    "study": "dsa_des.library.study",
}

__all__ = [
    "BlockFailure",
    "Component",
    "Input",
    "Message",
    "Output",
    "OutputError",
    "Parameters",
    "Problem",
    "Progress",
    "Run",
    "Scene",
    "SceneError",
    "Simulation",
    "StudyResult",
    "UsageError",
    "__version__",
    "examples",
    "load_scene",
    "read_run",
    "run",
    "study",
]


def __getattr__(name: str) -> Any:
    if name in _HOMES:
        return getattr(import_module(_HOMES[name]), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
