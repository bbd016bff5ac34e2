"""Messages between blocks: targets, detections, manoeuvres, reach."""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from components.messages.detections import Detections, SensorOffer
    from components.messages.fused import FusedDetections
    from components.messages.reach import Reach
    from components.messages.steering import Manoeuvres
    from components.messages.targets import GatedTargets, RelativeTargets, TrafficStates
    from components.messages.tracks import Tracks

__all__ = [
    "Detections",
    "FusedDetections",
    "GatedTargets",
    "Manoeuvres",
    "Reach",
    "RelativeTargets",
    "SensorOffer",
    "Tracks",
    "TrafficStates",
]

# Looked up on first use: importing one file of the package does not pay for the others.
_HOMES = {
    "Detections": "components.messages.detections",
    "FusedDetections": "components.messages.fused",
    "GatedTargets": "components.messages.targets",
    "Manoeuvres": "components.messages.steering",
    "Reach": "components.messages.reach",
    "RelativeTargets": "components.messages.targets",
    "SensorOffer": "components.messages.detections",
    "Tracks": "components.messages.tracks",
    "TrafficStates": "components.messages.targets",
}


def __getattr__(name: str) -> Any:
    if name in _HOMES:
        from importlib import import_module

        return getattr(import_module(_HOMES[name]), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
