"""The outcome of an encounter, and the warning time before it (``closest_approach``,
``well_clear``).

Loss of well clear is that of ASTM F3442 for small unmanned aircraft, 2000 ft horizontally and
250 ft vertically; a near mid-air collision is 500 ft and 100 ft.
"""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from pydantic import Field

from components.metrics.declaration import ANY, DeclarationParameters, declarations
from components.metrics.rows import TargetMetric, sensors_of
from components.metrics.separation import (
    RelativeFlight,
    closest,
    first_inside,
    separations,
    traffic_block,
)
from dsa_des.arrays.types import FloatArray
from dsa_des.scene.scene import Scene
from dsa_des.studies.metric import EVENT, NUMBER, Group, Result

FOOT_M = 0.3048
WELL_CLEAR_M = (2000 * FOOT_M, 250 * FOOT_M)
NMAC_M = (500 * FOOT_M, 100 * FOOT_M)


class EncounterParameters(DeclarationParameters):
    """Parameters of encounter metrics."""

    step_s: float = Field(
        default=0.1, gt=0, le=10, description="Spacing of the times at which distances are taken."
    )


class _Encounter(TargetMetric):
    Parameters = EncounterParameters
    tables = {"detections": ("block", "target", "time_s", "true_range_m", "declared", "scan")}

    def __init__(self, parameters: Any, scene: Scene) -> None:
        super().__init__(parameters, scene)
        traffic_block(scene)
        self.sensors = sensors_of(scene, parameters.sensors)

    def of_flights(
        self, group: Group, read: Callable[[list[RelativeFlight]], tuple[float, ...]], width: int
    ) -> FloatArray:
        """Return what `read` makes of every replica's flights, shape (width, replicas).

        Flights are computed once for all replicas that share them.
        """
        known: dict[tuple[Any, ...], tuple[float, ...]] = {}
        values = np.empty((width, len(group)))
        mine = (f"blocks.{traffic_block(group.scene).name}.", "duration_s")
        moved = any(key.startswith(mine) for replica in group.replicas for key in replica.changes)
        scenes = group.scenes if moved else [group.scene] * len(group)
        for number, scene in enumerate(scenes):
            key = (repr(traffic_block(scene).parameters), scene.duration_s) if moved else ()
            if key not in known:
                found = separations(scene, self.p.step_s)
                wanted = [s for s in found if self.p.target in (None, s.name)]
                known[key] = read(wanted)
            values[:, number] = known[key]
        return values


class ClosestApproach(_Encounter):
    """Closest approach, and how long before it the target was detected and declared.

    Where there are several targets, the one that comes closest counts.
    """

    def results(self) -> list[Result]:
        """Return distance, time, and times from detection and declaration."""
        found = [
            Result("closest_approach_m", NUMBER, "smallest slant range, m"),
            Result("closest_approach_time_s", NUMBER, "when that is, s"),
        ]
        for name in [*self.sensors, ANY]:
            found += [
                Result(f"detection_to_closest_s.{name}", NUMBER, "from first detection to it, s"),
                Result(f"declaration_to_closest_s.{name}", NUMBER, "from declaration to it, s"),
            ]
        return found

    def measure(self, group: Group) -> Mapping[str, FloatArray]:
        """Return all of it for every replica."""
        distance, time_s = self.of_flights(group, _closest, 2)
        found: dict[str, FloatArray] = {
            "closest_approach_m": distance,
            "closest_approach_time_s": time_s,
        }
        for name, (declared_s, _, first_s) in declarations(group, self.p, self.sensors).items():
            seen_s = np.where(np.isfinite(first_s), first_s, np.nan)
            found[f"detection_to_closest_s.{name}"] = time_s - seen_s
            found[f"declaration_to_closest_s.{name}"] = time_s - declared_s
        return found


class WellClear(_Encounter):
    """Loss of well clear and near mid-air collision, and the warning before the loss."""

    def results(self) -> list[Result]:
        """Return both events, when well clear is lost, and the warning per sensor."""
        found = [
            Result("well_clear_lost", EVENT, "within 2000 ft and 250 ft (ASTM F3442)"),
            Result("nmac", EVENT, "within 500 ft and 100 ft"),
            Result("well_clear_loss_time_s", NUMBER, "when well clear is lost, s"),
        ]
        found += [
            Result(f"warning_time_s.{name}", NUMBER, "from declaration to the loss, s")
            for name in [*self.sensors, ANY]
        ]
        return found

    def measure(self, group: Group) -> Mapping[str, FloatArray]:
        """Return all of it for every replica."""
        lost_s, collision_s = self.of_flights(group, _losses, 2)
        found: dict[str, FloatArray] = {
            "well_clear_lost": (~np.isnan(lost_s)).astype(float),
            "nmac": (~np.isnan(collision_s)).astype(float),
            "well_clear_loss_time_s": lost_s,
        }
        for name, (declared_s, _, _) in declarations(group, self.p, self.sensors).items():
            found[f"warning_time_s.{name}"] = lost_s - declared_s
        return found


def _closest(flights: list[RelativeFlight]) -> tuple[float, ...]:
    """Return smallest range (m) and its time (s)."""
    best = (float("inf"), float("nan"))
    for flight in flights:
        best = min(best, closest(flight))
    return best if np.isfinite(best[0]) else (float("nan"), float("nan"))


def _losses(flights: list[RelativeFlight]) -> tuple[float, ...]:
    """Return when well clear is first lost and when a collision first threatens, s."""
    if not flights:
        return float("nan"), float("nan")
    first = np.array([first_inside(flight, WELL_CLEAR_M, NMAC_M) for flight in flights])
    lost_s, collision_s = np.fmin.reduce(first).tolist()
    return lost_s, collision_s
