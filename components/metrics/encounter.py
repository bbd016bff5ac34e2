"""The outcome of an encounter and the warning before it (``closest_approach``, ``well_clear``,
``alert_times``).

Loss of well clear is by default that of ASTM F3442 for small unmanned aircraft, 2000 ft
horizontally and 250 ft vertically; a near mid-air collision is 500 ft and 100 ft.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import networkx as nx
import numpy as np
from pydantic import Field

from components.arguments.units import FOOT_M
from components.metrics.detection import (
    ANY,
    DECLARED,
    DeclarationParameters,
    first_declarations_by_sensor,
)
from components.metrics.flown_flights import FlownMetric, make_run_by_run_reader
from components.metrics.losses import find_closest_approach, loss_nmac_and_start_times_s
from components.metrics.rows import (
    END,
    SCANS,
    START,
    PlatformParameters,
    TargetParameters,
    censoring_text,
    earliest_target_by_replica,
    is_at_boundary_scan,
    is_named,
    pick_target_by_replica,
    sensors_to_measure,
)
from components.metrics.separation import RelativeFlight, only_traffic_block
from components.well_clear.volume import PRESETS, Volume
from dsa_des.arrays.types import AnyArray, BoolArray, FloatArray
from dsa_des.replicas.outage_times import (
    blocks_with_outages,
    outage_times_of_replicas,
    was_out_between,
)
from dsa_des.scene.scene import Scene
from dsa_des.studies.metric import EVENT, NUMBER, RATIO, Group, RatioOf, Result, blocks_recording

#: By what an approach may be censored, see
#: `components.flights.closest_approach.describe_censoring_end`.
_ENDS = ("", START, END, "the start of its flight", "the end of its flight")
#: The end of a run that a block ended before its time.
_EARLY_END = "the early end of the run"
_NOWHERE = (float("inf"), float("nan"), "")
_BEFORE = ("detection", "declaration")
_CUT_OFF, _LOSS_CUT_OFF = "closest_approach_cut_off", "well_clear_loss_cut_off"
_WELL_CLEAR, _NMAC = PRESETS["astm_f3442"], PRESETS["nmac"]

#: Of metrics of losses; ``step_s`` of None looks between samples too.
STEP: Any = Field(
    default=None, gt=0, le=10,
    description="Take distances at this spacing only, s. By default entries between samples "
    "count too, to 1 ms.",
)  # fmt: skip


def distance_field_m(default_m: float, description: str) -> Any:
    """Return the pydantic field of a distance in m, with a default and a description."""
    return Field(default=default_m, gt=0, le=1e6, description=description)


class EncounterParameters(DeclarationParameters, PlatformParameters):
    """Parameters of encounter metrics."""

    step_s: float = Field(
        default=0.1, gt=0, le=10, description="Spacing of the times at which distances are taken."
    )


class SizeParameters(PlatformParameters):
    """What counts as a loss of well clear, and as a near mid-air collision."""

    horizontal_m: float = distance_field_m(
        _WELL_CLEAR.horizontal_m, "Horizontal distance below which well clear is lost, m."
    )
    vertical_m: float = distance_field_m(
        _WELL_CLEAR.vertical_m, "Difference in height below which well clear is lost, m."
    )
    tau_s: float = Field(
        default=0.0, ge=0, le=600,
        description="Modified tau below which well clear is lost too, s (DO-365: 35). 0: distances "
        "alone.",
    )  # fmt: skip
    nmac_horizontal_m: float = distance_field_m(
        _NMAC.horizontal_m, "Horizontal distance of a near mid-air collision, m."
    )
    nmac_vertical_m: float = distance_field_m(
        _NMAC.vertical_m, "Difference in height of a near mid-air collision, m."
    )

    @property
    def well_clear_and_nmac_sizes_m(self) -> tuple[tuple[float, float], ...]:
        """Radius and half height (m) of the well-clear cylinder, then of the NMAC cylinder."""
        return (
            (self.horizontal_m, self.vertical_m),
            (self.nmac_horizontal_m, self.nmac_vertical_m),
        )

    def cylinders_m(self, kind: str = "") -> dict[str, tuple[float, float]]:
        """Return (radius, half height) in m by event name plus `kind`: NMAC, and loss of well clear
        unless modified tau defines it.
        """
        lost, nmac = self.well_clear_and_nmac_sizes_m
        clear = {} if self.tau_s else {f"well_clear_lost{kind}": lost}
        return {**clear, f"nmac{kind}": nmac}

    def loss_nmac_and_start_times_s(self, runs: Sequence[list[RelativeFlight]]) -> FloatArray:
        """Return times (3, runs), s: first loss of well clear, first NMAC, and 0; NaN if never."""
        return loss_nmac_and_start_times_s(self.well_clear_and_nmac_sizes_m, runs, self.tau_s)


class WellClearParameters(EncounterParameters, SizeParameters):
    """Parameters of loss of well clear."""

    step_s: float | None = STEP  # type: ignore[assignment]


class _Encounter(FlownMetric):
    Parameters = EncounterParameters
    tables = {**DECLARED, **SCANS}

    def __init__(self, parameters: Any, scene: Scene) -> None:
        super().__init__(parameters, scene)
        self.sensors = self.select_on_platform(sensors_to_measure(scene, parameters.sensors))
        #: Sensors, and any of them, where there is one.
        self.reports = [*self.sensors, ANY] if self.sensors else []


class ClosestApproach(_Encounter):
    """Closest approach, and how long before it the target was detected and declared.

    Where there are several targets, the one that comes closest counts, with its own detection and
    declaration.
    """

    def results(self) -> list[Result]:
        """Return distance, time, and times from detection and declaration."""
        results = [
            Result("closest_approach_m", NUMBER, "smallest slant range, m", _CUT_OFF, least=0.0),
            Result("closest_approach_time_s", NUMBER, "when that is, s", _CUT_OFF, least=0.0),
        ]
        for name in self.reports:
            seen, declared = (f"{what}_to_closest_cut_off.{name}" for what in _BEFORE)
            results += [
                Result(
                    f"detection_to_closest_s.{name}", NUMBER, "from first detection to it, s", seen
                ),
                Result(
                    f"declaration_to_closest_s.{name}", NUMBER, "from declaration to it, s",
                    declared,
                ),
            ]  # fmt: skip
        return results

    def measure(self, group: Group) -> Mapping[str, AnyArray]:
        """Return replicas' closest approach (m), time (s), how long detected, declared before."""
        names, each = self.evaluate_each_flight(
            group, make_run_by_run_reader(_closest_approach_of_first), to_the_end=True
        )
        nearest = earliest_target_by_replica(each[0], each[0])
        distance, time_s = (
            pick_target_by_replica(each[0], nearest),
            pick_target_by_replica(each[1], nearest),
        )
        code = np.where(nearest < 0, 0.0, pick_target_by_replica(each[2], nearest))
        at = np.array([*_ENDS, _EARLY_END])[code.astype(int)]
        at[(at == END) & group.ended_early] = _EARLY_END
        values: dict[str, AnyArray] = {
            "closest_approach_m": distance,
            "closest_approach_time_s": time_s,
            _CUT_OFF: censoring_text(at, distance),
        }
        for name, known in first_declarations_by_sensor(group, self.p, self.sensors, names).items():
            first = known.pick_target_of_replicas(nearest)
            parts = ((first.seen_s, first.seen_at_start), (first.time_s, first.at_start))
            for what, (when_s, cut) in zip(_BEFORE, parts, strict=True):
                value = time_s - when_s
                values[f"{what}_to_closest_s.{name}"] = value
                values[f"{what}_to_closest_cut_off.{name}"] = censoring_text(
                    np.where(cut, START, at), value
                )
        return values


class WellClear(_Encounter):
    """Loss of well clear and near mid-air collision, and the warning before the loss.

    Where well clear of several targets is lost, each loss is set against the declaration of the
    same target, and the shortest warning counts; there is none where one of them is not declared.
    """

    Parameters = WellClearParameters

    def cylinders_m(self) -> Mapping[str, tuple[float, float]]:
        """Return (radius, half height) in m by event: NMAC, and loss of well clear unless modified
        tau defines it.
        """
        cylinders: dict[str, tuple[float, float]] = self.p.cylinders_m()
        return cylinders

    def results(self) -> list[Result]:
        """Return definitions: both events, time well clear is lost, and warning per sensor."""
        tau = f", or modified tau of {self.p.tau_s:g} s" if self.p.tau_s else ""
        results = [
            Result(
                "well_clear_lost",
                EVENT,
                _cylinder_text(self.p.well_clear_and_nmac_sizes_m[0], _WELL_CLEAR) + tau,
            ),
            Result("nmac", EVENT, _cylinder_text(self.p.well_clear_and_nmac_sizes_m[1], _NMAC)),
            Result(
                "well_clear_loss_time_s",
                NUMBER,
                "when well clear is lost, s",
                _LOSS_CUT_OFF,
                least=0.0,
            ),
        ]
        results += [
            Result(
                f"warning_time_s.{name}", NUMBER, "from declaration to the loss, s",
                f"warning_cut_off.{name}",
            )
            for name in self.reports
        ]  # fmt: skip
        return results

    def measure(self, group: Group) -> Mapping[str, AnyArray]:
        """Return by replica event flags, first loss of well clear, warning times by sensor (s)."""
        names, each = self.evaluate_each_flight(
            group, self.p.loss_nmac_and_start_times_s, to_the_end=True
        )
        lost_s, collision_s, begun_s = each
        lost_at_start = is_at_boundary_scan(lost_s, begun_s)
        values: dict[str, AnyArray] = {
            "well_clear_lost": (~np.isnan(lost_s)).any(axis=1).astype(float),
            "nmac": (~np.isnan(collision_s)).any(axis=1).astype(float),
            "well_clear_loss_time_s": _least_over_targets(lost_s),
            _LOSS_CUT_OFF: censoring_text(np.where(lost_at_start.any(axis=1), START, "")),
        }
        for name, first in first_declarations_by_sensor(group, self.p, self.sensors, names).items():
            warning_s = lost_s - first.time_s
            worst = _least_over_targets(warning_s, ~np.isnan(lost_s))
            at_start = (first.at_start | lost_at_start) & (warning_s == worst[:, np.newaxis])
            values[f"warning_time_s.{name}"] = worst
            values[f"warning_cut_off.{name}"] = censoring_text(
                np.where(at_start.any(axis=1), START, "")
            )
        return values


def _block_and_upstream_that_may_fail(scene: Scene, block: str) -> list[str]:
    """Return the blocks that may fail among a block and all it receives from, even indirectly.

    What steers the traffic is not: no alert is made of it.
    """
    graph = scene.graph.copy()
    graph.remove_edges_from(list(graph.in_edges(only_traffic_block(scene).name)))
    return sorted({block, *nx.ancestors(graph, block)}.intersection(blocks_with_outages(scene)))


def _least_over_targets(values: FloatArray, counts: BoolArray | None = None) -> FloatArray:
    """Return each replica's smallest value over its targets, (replicas,); NaN if there is none.

    Of those that count it is NaN if one of them has none.
    """
    result = np.where(~np.isnan(values) if counts is None else counts, values, np.inf)
    least: FloatArray = result.min(axis=1, initial=np.inf)
    return np.where(np.isposinf(least), np.nan, least)


def _cylinder_text(sizes_m: tuple[float, float], standard: Volume) -> str:
    """Return a cylinder's description by radius and half height, in feet if the standard's."""
    horizontal_m, vertical_m = sizes_m
    name = " (ASTM F3442)" if standard is _WELL_CLEAR else ""
    if (horizontal_m, vertical_m) == (standard.horizontal_m, standard.vertical_m):
        feet = horizontal_m / FOOT_M, vertical_m / FOOT_M
        return f"within {feet[0]:.0f} ft and {feet[1]:.0f} ft{name}"
    return f"within {horizontal_m:g} m and {vertical_m:g} m"


def _closest_approach_of_first(flights: list[RelativeFlight]) -> tuple[float, ...]:
    """Return the first flight's least range (m), its time (s), index of censoring in `_ENDS`."""
    range_m, time_s, end = find_closest_approach(flights[0]) if flights else _NOWHERE
    if not np.isfinite(range_m):
        return float("nan"), float("nan"), 0.0
    return range_m, time_s, float(_ENDS.index(end))


class AlertTimeParameters(TargetParameters, SizeParameters):
    """Parameters of alert times."""

    level: int = Field(default=2, ge=1, description="Alerts of this level or above count.")
    late_s: float = Field(
        default=15.0, ge=0, description="An alert is late if the loss comes sooner after it, s."
    )
    surprise_s: float = Field(
        default=5.0, ge=0, description="A level is a surprise sooner after the one below it, s."
    )
    step_s: float | None = STEP
    steered: bool = Field(
        default=False,
        description="Take the flights with the ownship's manoeuvres, not as planned.",
    )


class AlertTimes(FlownMetric):
    """When alerts come before well clear is lost, and which are late, missed or for nothing.

    Where the ownship is steered, losses are by default those of what it would have flown: an alert
    that was heeded is no nuisance.

    Of each block that records alerts, so that one fed by the truth and one fed by tracks stand side
    by side. An alert of an aircraft is *missed* if well clear of that aircraft is lost and none
    came before, *late* if it came less than `late_s` before the loss or is missed, a *nuisance* if
    well clear of it is never lost, and a *surprise* if the level below had not been on for
    `surprise_s` when it came. A run has what any of its aircraft has; of several times to a loss
    the shortest counts, and there is none where one was missed.

    Where blocks of the scene may be out, an alert is *missed while out* if it is missed and one of
    the blocks that it is made of was out within the last `late_s` before the loss.
    """

    Parameters = AlertTimeParameters
    tables = {"alerts": ("block", "target", "time_s", "level")}

    def __init__(self, parameters: Any, scene: Scene) -> None:
        super().__init__(parameters, scene, steered=parameters.steered)
        traffic = only_traffic_block(scene).name
        #: Whether losses are of what was flown, so that a run that ended early has no later ones.
        self._as_flown = parameters.steered or all(w.target != traffic for w in scene.wires)
        self._blocks = self.select_on_platform(blocks_recording(scene, "alerts"))
        #: Which blocks may be out behind each of them that has any.
        self._behind = {
            name: of
            for name in self._blocks
            if (of := _block_and_upstream_that_may_fail(scene, name))
        }

    def results(self) -> list[Result]:
        """Return the definitions of alert times and of alert events for each alerting block."""
        results = []
        for name in self._blocks:
            results += [
                Result(
                    f"first_alert_time_s.{name}", NUMBER, "first alert of the level, s", least=0.0
                ),
                Result(f"first_alert_range_m.{name}", NUMBER, "slant range then, m", least=0.0),
                Result(f"alert_to_loss_s.{name}", NUMBER, "from it to loss of well clear, s"),
                Result(f"alert_to_nmac_s.{name}", NUMBER, "to a near mid-air collision, s"),
                Result(f"alert_missed.{name}", EVENT, "well clear lost without an alert before"),
                Result(f"alert_late.{name}", EVENT, "alert missed or shortly before the loss"),
                Result(f"alert_nuisance.{name}", EVENT, "alert, and well clear is never lost"),
                Result(f"alert_surprise.{name}", EVENT, "alert hardly after the level below it"),
            ]
            if name in self._behind:
                missed, of_out = f"alert_missed.{name}", f"alert_missed_while_out.{name}"
                said = f"missed, and {' or '.join(self._behind[name])} was out when it was due"
                share = RatioOf(missed, of_out, share=True)
                results += [
                    Result(of_out, EVENT, said),
                    Result(f"missed_while_out_share.{name}", RATIO, "share of the missed that were "
                           "while something was out", ratio=share),
                ]  # fmt: skip
        return results

    def measure(self, group: Group) -> Mapping[str, AnyArray]:
        """Return replicas' alert times (s), ranges (m); missed, late, nuisance, surprise flags."""
        names, (lost_s, nmac_s, _) = self.evaluate_each_flight(
            group, self.p.loss_nmac_and_start_times_s, to_the_end=self._as_flown
        )
        columns = group.tables["alerts"]
        lost, met = ~np.isnan(lost_s), ~np.isnan(nmac_s)
        values: dict[str, AnyArray] = {}
        for name in self._blocks:
            mine = is_named(columns["block"], name)
            first_s, below_s = (
                _first_times_by_target_s(
                    columns, mine & (columns["level"] >= level), len(group), names
                )
                for level in (self.p.level, self.p.level - 1)
            )
            alerted = ~np.isnan(first_s)
            before = alerted & lost & (np.nan_to_num(first_s) <= np.nan_to_num(lost_s))
            lead_s = np.where(before, lost_s - first_s, np.nan)
            missed = lost & ~before
            range_m = self.slant_ranges_at_times_m(group, first_s, to_the_end=self._as_flown)
            values[f"first_alert_time_s.{name}"] = _least_over_targets(first_s)
            values[f"first_alert_range_m.{name}"] = pick_target_by_replica(
                range_m, earliest_target_by_replica(first_s, range_m)
            )
            values[f"alert_to_loss_s.{name}"] = _least_over_targets(lead_s, lost)
            values[f"alert_to_nmac_s.{name}"] = _least_over_targets(nmac_s - first_s, met)
            sudden = alerted & (first_s - below_s < self.p.surprise_s) & (self.p.level > 1)
            for what, event in {
                "missed": missed,
                "late": missed | (before & (np.nan_to_num(lead_s) < self.p.late_s)),
                "nuisance": alerted & ~lost,
                "surprise": sudden,
            }.items():
                values[f"alert_{what}.{name}"] = event.any(axis=1).astype(float)
            if name in self._behind:
                out = group.cached(
                    outage_times_of_replicas,
                    lambda: outage_times_of_replicas(group.scene, group.replicas, group.duration_s),
                )
                due = was_out_between(out, self._behind[name], lost_s - self.p.late_s, lost_s)
                event = (missed & due).any(axis=1)
                values[f"alert_missed_while_out.{name}"] = event.astype(float)
        return values


def _first_times_by_target_s(
    columns: Mapping[str, Any], rows: BoolArray, replicas: int, targets: Sequence[str]
) -> FloatArray:
    """Return the earliest time of chosen rows, (replicas, targets), s; NaN without one.

    Of each replica and target, (replicas, targets).
    """
    index = {name: number for number, name in enumerate(targets)}
    of_name = [index.get(name, -1) for name in columns["target"].names]
    target = np.array([*of_name, -1], dtype=np.int64)[columns["target"].codes]
    rows = rows & (target >= 0)
    first = np.full(replicas * len(targets), np.inf)
    of = columns["replica"][rows] * len(targets) + target[rows]
    np.minimum.at(first, of, columns["time_s"][rows])
    return np.where(np.isfinite(first), first, np.nan).reshape(replicas, len(targets))
