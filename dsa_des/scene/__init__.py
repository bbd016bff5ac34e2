"""From a TOML file to a checked scene: reading, overriding, wiring, checking."""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from dsa_des.scene.block_table import Block
    from dsa_des.scene.scene import Scene, check_scene, load_scene, load_tables, open_scene

__all__ = ["Block", "Scene", "check_scene", "load_scene", "load_tables", "open_scene"]

# Looked up on first use: importing one file of the package does not pay for the others.
_HOMES = {
    "Block": "dsa_des.scene.block_table",
    "Scene": "dsa_des.scene.scene",
    "check_scene": "dsa_des.scene.scene",
    "load_scene": "dsa_des.scene.scene",
    "load_tables": "dsa_des.scene.scene",
    "open_scene": "dsa_des.scene.scene",
}


def __getattr__(name: str) -> Any:
    if name in _HOMES:
        from importlib import import_module

        return getattr(import_module(_HOMES[name]), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
