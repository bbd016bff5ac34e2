"""The tables of a scene that every block can read: weather, terrain, accuracy."""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from components.environment.tables import Accuracy, Navigation, Terrain, Weather

__all__ = ["Accuracy", "Navigation", "Terrain", "Weather"]

# Looked up on first use: importing one file of the package does not pay for the others.
_HOMES = {
    "Accuracy": "components.environment.tables",
    "Navigation": "components.environment.tables",
    "Terrain": "components.environment.tables",
    "Weather": "components.environment.tables",
}


def __getattr__(name: str) -> Any:
    if name in _HOMES:
        from importlib import import_module

        return getattr(import_module(_HOMES[name]), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
