"""Aircraft as sensors see them, and the aircraft of a run."""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from components.aircraft.aircraft import Aircraft, Roster

__all__ = ["Aircraft", "Roster"]

# Looked up on first use: importing one file of the package does not pay for the others.
_HOMES = {
    "Aircraft": "components.aircraft.aircraft",
    "Roster": "components.aircraft.aircraft",
}


def __getattr__(name: str) -> Any:
    if name in _HOMES:
        from importlib import import_module

        return getattr(import_module(_HOMES[name]), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
