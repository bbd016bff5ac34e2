"""Risk ratios over the runs of a study (``risk_ratio``): of all encounters, and class by class.

One run of a closed loop gives both flags of an encounter, without and with the manoeuvres that the
ownship was told (`components.metrics.risk`); beside them stand the encounter's weight and the
class of its geometry. The ratios themselves are taken over all runs of a cell.
"""

from collections.abc import Mapping
from functools import partial
from typing import Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from components.encounters.encounter_traffic import Encounter, ModelTraffic, SetTraffic
from components.formats.encounter_set import FAMILY, GEOMETRIES, geometry_class, pair_paths
from components.metrics.losses import nearest_course_and_bearing_deg, nearest_meeting_geometry
from components.metrics.risk import Mitigated, RiskParameters
from components.metrics.separation import only_traffic_block
from components.well_clear.missed_cylinder import (
    Missed,
    probability_of_induced_entry,
    widen_cylinders,
)
from components.well_clear.plane_pairs import Meetings, closest_meetings
from dsa_des.arrays.types import AnyArray, BoolArray, FloatArray
from dsa_des.scene.block_table import Block
from dsa_des.scene.scene import Scene
from dsa_des.studies.metric import (
    CLASS,
    EVENT,
    KEY,
    NUMBER,
    RATIO,
    Group,
    Metric,
    RatioOf,
    Result,
    expected_column,
)


def has_weights(scene: Scene) -> bool:
    """Return whether a scene's traffic is chosen from weighted encounters."""
    return hasattr(only_traffic_block(scene).parameters, "encounter")


def encounters_of_replicas(group: Group) -> list[Encounter]:
    """Return for each replica the set of its encounter and the encounter's index in that set."""
    block = only_traffic_block(group.scene)
    cls: Any = block.cls
    return group.cached(
        "encounters", lambda: cls.choose_encounters(group.parameters_of(block.name))
    )


class EncounterWeight(Metric):
    """Number and weight of the encounter of each run, for risk ratios over a study."""

    def __init__(self, parameters: Any, scene: Scene) -> None:
        super().__init__(parameters, scene)
        if not has_weights(scene):
            block = only_traffic_block(scene)
            raise ValueError(
                f"the traffic of the scene, {block.name!r}, has no encounters with weights: it "
                "needs traffic.encounters or traffic.encounter_model"
            )

    def results(self) -> list[Result]:
        """Return what this metric gives per run: number, weight and family of its encounter."""
        return [
            Result("encounter", KEY, "number of the encounter"),
            Result("encounter_weight", NUMBER, "how often it happens in the airspace"),
            Result("encounter_family", KEY, "encounter of which it is a copy, or itself"),
        ]

    def measure(self, group: Group) -> Mapping[str, AnyArray]:
        """Return number, weight and family of the encounter of every replica, by name."""
        numbers, weights, families = np.empty((3, len(group)))
        for row, (encounter_set, index) in enumerate(encounters_of_replicas(group)):
            numbers[row], weights[row] = encounter_set.numbers[index], encounter_set.weights[index]
            families[row] = encounter_set.extra.get(FAMILY, encounter_set.numbers)[index]
        return {
            "encounter": numbers, "encounter_weight": weights, "encounter_family": families,
        }  # fmt: skip

    def foresee(self, group: Group) -> Mapping[str, AnyArray]:
        """Return every replica's encounter number, weight, family, by name, before any flight."""
        return self.measure(group)


#: Sides from which an intruder closes in, by bearing from the ownship's course.
BEARINGS = ("ahead", "right", "behind", "left")
_CLASSES = {"geometry": GEOMETRIES, "bearing": BEARINGS}
_EVENTS = ("nmac", "well_clear_lost")
# Of needless manoeuvres.
_KEPT, _COMMANDED, _NEEDLESS = "well_clear_kept_nominal", "manoeuvred", "needless_manoeuvre"
# What is expected of manoeuvres before any is seen: the chance that an event stays, that one comes
# which the nominal flights just miss, and that a manoeuvre is flown where well clear is just kept.
# Wrong ones cost width, never truth (`dsa_des.studies.allocation`).
_STAYS, _INDUCED, _NEEDS = 0.2, 0.004, 0.1
# A conflict that is foreseen late surely stays. What is done about it in a hurry leads elsewhere
# more often than what is done in time, by these factors.
_LATE_S, _RUSHED, _IN_TIME = 35.0, 10.0, 0.3
_LEAST_SIZES = 0.01
# No sector of courses or bearings is so narrow, degrees.
_WIDE_DEG = 35.0


class RiskRatioParameters(RiskParameters):
    """Which events are counted, and for which classes of geometry there are separate ratios."""

    by: tuple[Literal["geometry", "bearing"], ...] = Field(
        default=("geometry",),
        description="Also a ratio for each class: by `geometry` (head-on, overtaking, crossing "
        "from the left or right) or by the `bearing` from which the intruder closes in (ahead, "
        "right, behind, left: sectors of 90°), as without manoeuvres.",
    )
    needless: bool = Field(
        default=False,
        description="Also the share of the encounters that stay well clear without manoeuvres in "
        "which the ownship gets a manoeuvre.",
    )


class RiskRatios(Mitigated):
    """Risk ratios of NMAC and of loss of well clear, and the runs' event flags behind them."""

    Parameters: ClassVar[Any] = RiskRatioParameters
    of_any_two = False
    geometry = (
        "closest_s", "horizontal_miss_m", "vertical_miss_m", "relative_speed_mps", "foreseen_s",
        "course_along", "course_across", "bearing_ahead", "bearing_right",
        "log_miss_in_nmac_sizes", "log_miss_in_well_clear_sizes",
        *(expected_column(name) for name in (*(f"{e}_mitigated" for e in _EVENTS), _NEEDLESS)),
    )  # fmt: skip

    def __init__(self, parameters: Any, scene: Scene) -> None:
        super().__init__(parameters, scene)
        self._weight = EncounterWeight((), scene) if has_weights(scene) else None
        self._climbs = any(map(may_climb, (scene.blocks[name] for name in self.delays_s)))

    def results(self) -> list[Result]:
        """Return event flags, encounter and weight, classes, and ratios overall and by class."""
        result = super().results()
        weight = cluster = None
        if self._weight is not None:
            result += self._weight.results()
            weight, cluster = "encounter_weight", "encounter_family"
        for by in self.p.by:
            result.append(Result(f"encounter_{by}", CLASS, f"class of its {by}"))
        for name in _EVENTS:
            flags = f"{name}_nominal", f"{name}_mitigated"
            said = "share of the risk that is left"
            of = RatioOf(*flags, weight, cluster)
            result.append(Result(f"{name}_risk_ratio", RATIO, said, ratio=of))
            result += [
                Result(
                    f"{name}_risk_ratio.{kind.replace(' ', '_')}", RATIO, f"{said}, {kind}",
                    ratio=RatioOf(*flags, weight, cluster, (f"encounter_{by}", kind)),
                )
                for by in self.p.by for kind in _CLASSES[by]
            ]  # fmt: skip
        if self.p.needless:
            said = "share with a manoeuvre of the encounters that stay well clear without any"
            result += [
                Result(_KEPT, EVENT, "without manoeuvres, well clear is kept"),
                Result(_COMMANDED, EVENT, "the ownship is told to manoeuvre"),
                Result(_NEEDLESS, EVENT, "it is told to, and well clear is kept without"),
                Result("needless_manoeuvre_share", RATIO, said,
                       ratio=RatioOf(_KEPT, _NEEDLESS, weight, cluster, share=True)),
            ]  # fmt: skip
        return result

    def measure(self, group: Group) -> Mapping[str, AnyArray]:
        """Return by name each replica's event flags, encounter, weight, classes; not the ratios."""
        result = dict(super().measure(group))
        result |= self._weights_and_classes(group, result)
        if self.p.needless:
            commanded = np.zeros(len(group))
            commanded[list(self.viewer_manoeuvres_by_replica(group))] = 1.0
            result |= {_COMMANDED: commanded, _NEEDLESS: result[_KEPT] * commanded}
        return result

    def unit_weights(self, group: Group) -> FloatArray:
        """Return each replica's encounter's weight, or the base class's if encounters have none."""
        if self._weight is None:
            return super().unit_weights(group)
        weights: FloatArray = self._weight.measure(group)["encounter_weight"]
        return weights

    def nominal_event_flags(self, group: Group) -> dict[str, AnyArray]:
        """Return both events' unmanoeuvred flags, from straight paths or, if needed, flights."""
        meeting = meetings_in_plane(group, self.p)
        if meeting is None:
            return super().nominal_event_flags(group)
        result = _nominal_event_flags(meeting)
        unsure = np.flatnonzero(meeting.unsure.any(axis=0))
        if len(unsure):
            for name, column in self.event_flags(group, steered=False, some=unsure).items():
                result[f"{name}_nominal"][unsure] = column
        return result

    def foresee(self, group: Group) -> Mapping[str, AnyArray]:
        """Return, by name, results that no manoeuvre changes, geometry of the closest approach, and
        guesses of the others.
        """
        meeting, sizes_m = meetings_in_plane(group, self.p), self.p.well_clear_and_nmac_sizes_m
        if meeting is None:
            result = self._nominal_flags_and_classes(group)
            geometry = partial(nearest_meeting_geometry, widen_cylinders(sizes_m))
            closest, *misses_m = np.split(
                self.evaluate_flights(group, geometry, steered=False), [7, 9]
            )
        else:
            closest, result = meeting.closest, self._meeting_flags_and_classes(meeting)
            misses_m = [meeting.beside_m, meeting.above_m]
            unsure = np.flatnonzero(meeting.unsure.any(axis=0) | self._is_class_unsure(meeting))
            if len(unsure):
                few = Group(group.scene, [group.replicas[k] for k in unsure.tolist()], (), {})
                for name, column in self._nominal_flags_and_classes(few).items():
                    result[name][unsure] = column
        if self._weight is not None:
            result |= self._weight.measure(group)
        if self.p.needless:
            result[_KEPT] = 1.0 - result["well_clear_lost_nominal"]
        *values, course_deg, bearing_deg = closest
        angles = np.radians([course_deg, bearing_deg])
        values += [part for angle in angles for part in (np.cos(angle), np.sin(angle))]
        result |= dict(zip(self.geometry, values, strict=False))
        clear, nmac = (
            np.maximum(values[1] / radius_m, values[2] / half_m) for radius_m, half_m in sizes_m
        )
        for name, sizes in (("well_clear", clear), ("nmac", nmac)):
            result[f"log_miss_in_{name}_sizes"] = np.log(np.maximum(sizes, _LEAST_SIZES))
        late = np.nan_to_num(np.exp(-((result["foreseen_s"] / _LATE_S) ** 2)))
        kept = 1.0 - result["well_clear_lost_nominal"]
        rushed = np.where(kept > 0.0, 1.0, _IN_TIME + (_RUSHED - _IN_TIME) * late)
        for k, event in enumerate(("well_clear_lost", "nmac")):
            there = result[f"{event}_nominal"] > 0.0
            missed = Missed(values[1], values[2], misses_m[0][k], misses_m[1][k])
            induced = (
                _INDUCED
                * rushed
                * probability_of_induced_entry(sizes_m[k], missed, climbs=self._climbs)
            )
            stays = _STAYS + (1.0 - _STAYS) * late
            result[expected_column(f"{event}_mitigated")] = np.where(there, stays, induced)
        alone = np.maximum(np.nan_to_num(clear, nan=np.inf), 1.0)
        result[expected_column(_NEEDLESS)] = kept * _NEEDS * alone**-8.0
        return result

    def _nominal_flags_and_classes(self, group: Group) -> dict[str, AnyArray]:
        """Return event flags and geometry classes of the replicas, flown without manoeuvres."""
        return {**super().nominal_event_flags(group), **self._nominal_classes(group)}

    def _meeting_flags_and_classes(self, meeting: Meetings) -> dict[str, AnyArray]:
        """Return event flags and geometry classes computed from straight paths in the plane."""
        return _nominal_event_flags(meeting) | self._class_columns(*meeting.closest[5:])

    def _is_class_unsure(self, meeting: Meetings) -> BoolArray:
        """Return which runs' geometry class the straight paths in the plane leave open (mask)."""
        if not self.p.by:
            return np.zeros_like(meeting.unsure_angles)
        low, high = meeting.angles_deg[:, 0], meeting.angles_deg[:, 1]
        unsure = meeting.unsure_angles | (high - low > _WIDE_DEG).any(axis=0)
        edges = zip(*(self._class_columns(*angles).values() for angles in (low, high)), strict=True)
        for one, other in edges:
            unsure |= one != other
        return unsure

    def _nominal_classes(self, group: Group) -> dict[str, AnyArray]:
        """Return the replicas' geometry classes, flown without manoeuvres; empty if not asked."""
        if not self.p.by:
            return {}
        return self._class_columns(
            *self.evaluate_flights(group, nearest_course_and_bearing_deg, steered=False)
        )

    def _class_columns(
        self, course_deg: FloatArray, bearing_deg: FloatArray
    ) -> dict[str, AnyArray]:
        """Return the classes by relative course and bearing, deg; None where no aircraft is met."""
        result: dict[str, AnyArray] = {}
        for by in self.p.by:
            named = geometry_class(course_deg) if by == "geometry" else bearing_sector(bearing_deg)
            column: AnyArray = named.astype(object)
            column[np.isnan(course_deg)] = None
            result[f"encounter_{by}"] = column
        return result

    def _weights_and_classes(
        self, group: Group, known: Mapping[str, AnyArray]
    ) -> dict[str, AnyArray]:
        """Return by name the replicas' weights and classes, and, if counted, 1 where they stay well
        clear unmanoeuvred.
        """
        result: dict[str, AnyArray] = {}
        if self.p.needless:
            result[_KEPT] = 1.0 - known["well_clear_lost_nominal"]
        if self._weight is not None:
            result |= self._weight.measure(group)
        return result | self._nominal_classes(group)


def _nominal_event_flags(meeting: Meetings) -> dict[str, AnyArray]:
    return {
        f"{name}_nominal": inside.astype(float)
        for name, inside in zip(("well_clear_lost", "nmac"), meeting.inside, strict=True)
    }


def may_climb(block: Block) -> bool:
    """Return whether a steering block may command other altitudes; True if not declared."""
    asked = getattr(block.cls, "may_climb", None)
    return asked is None or bool(asked(block.parameters))


def bearing_sector(bearing_deg: FloatArray) -> AnyArray:
    """Return each relative bearing's 90° sector as text: ahead, right, behind or left."""
    sector = np.floor((np.nan_to_num(bearing_deg) + 45.0) % 360.0 / 90.0).astype(int)
    result: AnyArray = np.array(BEARINGS)[sector]
    return result


def meetings_in_plane(group: Group, p: RiskRatioParameters) -> Meetings | None:
    """Return all runs' closest approaches on straight plane paths; None if the scene forbids it."""
    block, scene = only_traffic_block(group.scene), group.scene
    parameters = group.parameters_of(block.name)
    one = parameters[0]
    if (
        block.cls not in (SetTraffic, ModelTraffic)
        or one.scripted_ownship is not None
        or p.step_s is not None
        or p.tau_s > 0.0
        or p.platform is not None
        or any(r.changes.keys() - {f"blocks.{block.name}.encounter"} for r in group.replicas)
    ):
        return None
    paths, end_s = (
        pair_paths(encounters_of_replicas(group), one.dynamics),
        float(scene.duration_s or "inf"),
    )
    return closest_meetings(
        paths,
        len(group),
        end_s,
        p.well_clear_and_nmac_sizes_m,
        widen_cylinders(p.well_clear_and_nmac_sizes_m),
    )
