"""The sensors of the display: where each looks, and which have fallen silent."""

import math
from collections.abc import Mapping
from typing import Any

from components.messages.detections import Detections, SensorOffer
from components.sensor.palette import IR
from dsa_des.block.component import Component
from dsa_des.running.simulation import Simulation
from dsa_des.text.safe_text import escape_unprintable

#: A sensor from which nothing has come for so many of its scans, and so long, is said to be out.
_SILENT_SCANS, _SILENT_S = 2.5, 1.0


def describe_sensors(components: Mapping[str, Component]) -> list[dict[str, Any]]:
    """Return each sensor's name, kind, range (m), azimuth limits (deg); None where unknown."""
    return [_describe(name, one) for name, one in sorted(components.items()) if _is_sensor(one)]


def silent_sensors(
    longest_s: Mapping[str, float], heard_s: Mapping[str, float], time_s: float
) -> list[str]:
    """Return names of sensors silent for longer than they may be, by when each was last heard."""
    return [
        escape_unprintable(name)
        for name, most_s in longest_s.items()
        if time_s - heard_s.get(name, 0.0) > most_s
    ]


def longest_silences_s(simulation: Simulation) -> dict[str, float]:
    """Return each initially active sensor's silence, s, after which it counts as failed."""
    scene, result = simulation.scene, dict[str, float]()
    for name, component in sorted(simulation.components.items()):
        if not _is_sensor(component) or not getattr(component.p, "enabled", True):
            continue
        every = [
            one.blocks[name].parameters for one in (scene, *(s.scene for s in scene.stretches))
        ]
        clocks = [clock for p in every if (clock := component.clock_of(p)) is not None]
        if clocks:
            slowest_s = max(float(1 / clock.rate_hz) for clock in clocks)
            first_s = max(float(clock.offset_s) for clock in clocks)
            result[name] = max(_SILENT_SCANS * slowest_s, _SILENT_S) + first_s
    return result


def _is_sensor(component: Component) -> bool:
    return any(issubclass(output.message, Detections) for output in component.outputs.values())


def _describe(name: str, component: Component) -> dict[str, Any]:
    offer: SensorOffer = component.offer("detections")
    kind = "radar" if offer.measures_range else "ir" if component.mark is IR else "eo"
    reach = offer.reach
    result: dict[str, Any] = {"name": escape_unprintable(name), "kind": kind}
    if reach is None or not reach.enabled:
        return {**result, "range": None, "azimuth": None}
    # Bounds are in the sensor's axes.
    turned_deg = getattr(component.p, "mount_azimuth_deg", 0.0)
    low, high = (round(math.degrees(edge) + turned_deg, 3) for edge in reach.azimuth_rad)
    far = getattr(component, "reach", reach).range_max_m
    return {
        **result,
        "range": round(far, 1) if math.isfinite(far) else None,
        "azimuth": [low, high],
    }
