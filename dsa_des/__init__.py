"""The engine of dsa_des: time, ports, graph, runs and recording of block simulations.

The package knows no radar. Blocks are found by their registered names (see
`dsa_des.block.registry`), so this package never imports `components`.
"""

from typing import Any

from dsa_des.record.version import __version__

# Names are looked up on first use: `dsa-des --help` must not pay for NumPy or Arrow.
_PUBLIC = {
    "read_run": "dsa_des.record.run_folder",
    "load_scene": "dsa_des.scene.scene",
    "Simulation": "dsa_des.run.simulation",
    "Component": "dsa_des.block.component",
    "Parameters": "dsa_des.block.component",
    "Input": "dsa_des.block.ports",
    "Output": "dsa_des.block.ports",
    "Message": "dsa_des.block.message",
}

__all__ = [
    "Component",
    "Input",
    "Message",
    "Output",
    "Parameters",
    "Simulation",
    "__version__",
    "load_scene",
    "read_run",
]


def __getattr__(name: str) -> Any:
    if name in _PUBLIC:
        from importlib import import_module

        return getattr(import_module(_PUBLIC[name]), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
