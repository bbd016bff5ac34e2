"""The common parts of all sensors: clock, reach, mounting, grid, look and declaration."""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from components.sensor.look import Cells, Look
    from components.sensor.parameters import SensorParameters
    from components.sensor.sensor import Sensor

__all__ = ["Cells", "Look", "Sensor", "SensorParameters"]

# Looked up on first use: importing one file of the package does not pay for the others.
_HOMES = {
    "Cells": "components.sensor.look",
    "Look": "components.sensor.look",
    "Sensor": "components.sensor.sensor",
    "SensorParameters": "components.sensor.parameters",
}


def __getattr__(name: str) -> Any:
    if name in _HOMES:
        from importlib import import_module

        return getattr(import_module(_HOMES[name]), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
