"""First detections, declarations of m in n scans, and shares of looks of each sensor
(``first_detection``, ``declaration``, ``detection_share``)."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple, Self

import numpy as np
from pydantic import Field, model_validator

from components.metrics.rows import (
    FUSED,
    SCANS,
    SensorMetricParameters,
    TargetMetric,
    column_at_rows,
    earliest_target_by_replica,
    first_report_rows_of_targets,
    is_at_earliest_possible_scan,
    is_named,
    is_of_target,
    left_censoring_text,
    nth_scan_time_by_replica_s,
    pick_target_by_replica,
    pick_target_columns,
    sensors_to_measure,
    share_and_trials_columns,
)
from dsa_des.arrays.types import AnyArray, BoolArray, FloatArray, IntArray
from dsa_des.replicas.outage_times import blocks_with_outages, outage_times_of_replicas
from dsa_des.scene.scene import Scene
from dsa_des.studies.metric import (
    EVENT,
    FRACTION,
    NUMBER,
    SHARE,
    ChangeWords,
    Group,
    Result,
    blocks_recording,
)

ANY = "any"
#: Columns of detections that `first_declarations_by_sensor` needs.
DECLARED = {"detections": ("block", "target", "time_s", "true_range_m", "declared", "scan")}
_ROWS = ("block", "target", "time_s", "true_range_m")


class FirstDetection(TargetMetric):
    """Time and true slant range of the first detection, per sensor and of the fusion."""

    Parameters = SensorMetricParameters
    tables = {"detections": _ROWS, **SCANS}

    def __init__(self, parameters: Any, scene: Scene) -> None:
        super().__init__(parameters, scene)
        fusions = blocks_recording(scene, FUSED)
        self.names = sensors_to_measure(scene, parameters.sensors, [FUSED] if fusions else [])
        self.fusion = fusions[0] if fusions else None
        #: Delay (s) from each block to the fusion.
        self.delay_s: dict[str, float] = {}
        if FUSED in self.names:
            self.tables = {**self.tables, FUSED: (*_ROWS, "sensors")}
            wires = [wire for wire in scene.wires if wire.target in fusions]
            self.delay_s = {wire.source: float(wire.total_delay_s) for wire in wires}

    def results(self) -> list[Result]:
        """Return definitions per sensor: if, when and at what range it first reports the target."""
        results = []
        for name in self.names:
            label = "the fusion" if name == FUSED else name
            block = self.fusion if name == FUSED else name
            time, cut = f"first report by {label}, s", f"first_detection_cut_off.{name}"
            results += [
                Result(
                    f"detected.{name}", EVENT, f"whether {label} reports the target at all",
                    told=ChangeWords(label, "no longer sees any target", "now sees a target"),
                    block=block,
                ),
                Result(
                    f"first_detection_time_s.{name}", NUMBER, time, cut,
                    ChangeWords(label, "sees a target earlier", "sees a target later"), block,
                    least=0.0,
                ),
                Result(
                    f"first_detection_range_m.{name}", NUMBER, "true slant range then, m", cut,
                    ChangeWords(label, "first sees it nearer", "first sees it farther away"), block,
                    least=0.0,
                ),
            ]  # fmt: skip
        return results

    def measure(self, group: Group) -> Mapping[str, AnyArray]:
        """Return by replica, for each sensor: whether it reports (1 or 0), when (s) and at what
        range (m) first, and whether that is cut off (``at the start``, ``never``, else None).
        """
        values: dict[str, AnyArray] = {}
        for name in self.names:
            time_s, range_m = first_report_time_and_range(group, name, self.p.target)
            values[f"detected.{name}"] = (~np.isnan(time_s)).astype(float)
            values[f"first_detection_time_s.{name}"] = time_s
            values[f"first_detection_range_m.{name}"] = range_m
            cut = (
                self._is_first_fusion_at_start(group)
                if name == FUSED
                else is_at_earliest_possible_scan(group, name, time_s)
            )
            values[f"first_detection_cut_off.{name}"] = left_censoring_text(cut, time_s)
        return values

    def _is_first_fusion_at_start(self, group: Group) -> BoolArray:
        """Return by replica whether its first fused report rests on a sensor's first scan."""
        columns: Any = group.tables[FUSED]
        rows = np.flatnonzero(is_of_target(columns, self.p.target))
        first = first_report_row_by_replica(columns, rows, len(group))
        sensors = columns["sensors"]
        code = np.where(first >= 0, sensors.codes[first], -1) if len(rows) else first
        result = np.zeros(len(group), dtype=bool)
        for number, names in enumerate(sensors.names):
            for name in names.split("+"):
                # Lateness on the way may vary, but not by a whole scan.
                seen_s = column_at_rows(columns, "time_s", first) - self.delay_s.get(name, 0.0)
                begun = ~np.isnan(nth_scan_time_by_replica_s(group, name, 1))
                again_s = nth_scan_time_by_replica_s(group, name, 2)
                result |= (code == number) & begun & ~(seen_s >= again_s)
        return result


def first_report_time_and_range(group: Group, name: str, target: str | None) -> list[FloatArray]:
    """Return time (s), true range (m) of replicas' first report by a sensor or `fused`, or NaN.

    Of several targets reported at that instant the nearest counts.
    """
    columns = group.tables[FUSED if name == FUSED else "detections"]
    rows = is_of_target(columns, target)
    if name != FUSED:
        rows &= is_named(columns["block"], name)
    first = first_report_row_by_replica(columns, np.flatnonzero(rows), len(group))
    return [
        column_at_rows(columns, "time_s", first),
        column_at_rows(columns, "true_range_m", first),
    ]


def first_report_row_by_replica(columns: Any, rows: IntArray, count: int) -> IntArray:
    """Return the row of each replica's first report of any target, -1 where it has none."""
    each = first_report_rows_of_targets(columns, rows, count)
    when_s, range_m = (column_at_rows(columns, name, each) for name in ("time_s", "true_range_m"))
    which = earliest_target_by_replica(when_s, range_m)
    return np.where(which < 0, -1, pick_target_by_replica(each, which))


class DetectionShare(TargetMetric):
    """Share of a sensor's looks at targets in its reach in which it detects them.

    Of a sensor that fails, or that changes switch off, also the share of the run that it was out.
    """

    Parameters = SensorMetricParameters
    tables = {"detections": ("block", "target"), "scans": ("block", "evaluated")}

    def __init__(self, parameters: Any, scene: Scene) -> None:
        super().__init__(parameters, scene)
        if parameters.target is not None:
            raise ValueError("target: looks are counted over all targets; leave it out")
        self.names = sensors_to_measure(scene, parameters.sensors)

    def results(self) -> list[Result]:
        """Return a share's definition per sensor, and the time out for those that may fail."""
        meaning = "detections per look at a target in reach"
        shares = [Result(f"detection_share.{name}", SHARE, meaning) for name in self.names]
        out = sorted(set(self.names).intersection(blocks_with_outages(self.scene)))
        meaning = "share of the run in which it was out"
        return [*shares, *(Result(f"out_share.{name}", FRACTION, meaning) for name in out)]

    def measure(self, group: Group) -> Mapping[str, FloatArray]:
        """Return by replica each sensor's share of looks that detect and, where sensors may fail,
        the share of time for which it was out of service.
        """
        scans, detections = group.tables["scans"], group.tables["detections"]
        values: dict[str, FloatArray] = {}
        for name in self.names:
            looks = is_named(scans["block"], name)
            hits = is_named(detections["block"], name) & is_of_target(detections, None)
            rows: Any = scans
            trials = np.bincount(
                rows["replica"][looks], weights=rows["evaluated"][looks], minlength=len(group)
            )
            rows = detections
            successes = np.bincount(rows["replica"][hits], minlength=len(group))
            values |= share_and_trials_columns(f"detection_share.{name}", successes, trials)
        for name, spans in outage_times_of_replicas(
            group.scene, group.replicas, group.duration_s
        ).items():
            if name in self.names:
                out_s = np.array([(each[:, 1] - each[:, 0]).sum() for each in spans])
                values[f"out_share.{name}"] = out_s / group.duration_s
        return values


class DeclarationParameters(SensorMetricParameters):
    """Parameters of declaration metrics."""

    m: int | None = Field(
        default=None, ge=1, description="Detections that declare; by default the sensor's rule."
    )
    n: int | None = Field(
        default=None, ge=1, le=1000, description="Consecutive scans that they are counted in."
    )

    @model_validator(mode="after")
    def _check_m_and_n(self) -> Self:
        if (self.m is None) != (self.n is None):
            raise ValueError("m and n belong together: give both or neither")
        if (self.m or 0) > (self.n or 0):
            raise ValueError(f"m is {self.m}: it must be at most n, {self.n}")
        return self


class Declaration(TargetMetric):
    """Time and true slant range of the first declaration, per sensor and of any of them.

    Without `m` and `n` the sensors' own rules count (``declare_m``, ``declare_n``; a sensor
    without a rule declares what it detects).
    """

    Parameters = DeclarationParameters
    tables = {**DECLARED, **SCANS}

    def __init__(self, parameters: Any, scene: Scene) -> None:
        super().__init__(parameters, scene)
        self.sensors = sensors_to_measure(scene, parameters.sensors)
        self.names = [*self.sensors, ANY]

    def results(self) -> list[Result]:
        """Return definitions by sensor: whether, when, at what range, how long after detection."""
        results = []
        for name in self.names:
            cut = f"declaration_cut_off.{name}"
            label = "any of the sensors" if name == ANY else name
            results += [
                Result(
                    f"declared.{name}", EVENT, "whether the target is declared",
                    told=ChangeWords(label, "no longer declares any target",
                    "now declares a target"),
                ),
                Result(
                    f"declaration_time_s.{name}", NUMBER, "first declaration, s", cut,
                    ChangeWords(label, "declares a target earlier", "declares a target later"),
                    least=0.0,
                ),
                Result(
                    f"declaration_range_m.{name}", NUMBER, "true slant range then, m", cut,
                    least=0.0,
                ),
                Result(
                    f"declaration_delay_s.{name}", NUMBER, "from first detection to declaration, s",
                    least=0.0,
                ),
            ]  # fmt: skip
        return results

    def measure(self, group: Group) -> Mapping[str, AnyArray]:
        """Return by replica whether, when (s), at what range (m) and how long after the first
        detection (s) each sensor first declares a target.
        """
        values: dict[str, AnyArray] = {}
        for name, each in first_declarations_by_sensor(group, self.p, self.sensors).items():
            first = each.pick_target_of_replicas(
                earliest_target_by_replica(each.time_s, each.range_m)
            )
            values[f"declared.{name}"] = (~np.isnan(first.time_s)).astype(float)
            values[f"declaration_time_s.{name}"] = first.time_s
            values[f"declaration_range_m.{name}"] = first.range_m
            values[f"declaration_delay_s.{name}"] = first.time_s - first.seen_s
            cut = left_censoring_text(first.at_start, first.time_s)
            values[f"declaration_cut_off.{name}"] = cut
        return values

    def analytic_answers(self, scene: Scene) -> Mapping[str, float]:
        """Return scan period × (m - 1), s: from first detection to declaration if all detect."""
        values: dict[str, float] = {}
        for name in self.sensors:
            parameters = scene.blocks[name].parameters
            clock = scene.blocks[name].cls.clock_of(parameters)
            m = detections_needed_to_declare(self.p.m, scene, name)
            if clock is not None:
                values[f"declaration_delay_s.{name}"] = float(clock.period_s * (m - 1))
        return values


class Declared(NamedTuple):
    """The first declaration of each target by a sensor, and its first detection.

    Of (replicas, targets), or of one target of each replica. NaN where there is none; ``at_start``
    where it is as early as the start of the run lets it.
    """

    time_s: FloatArray
    range_m: FloatArray
    at_start: BoolArray
    seen_s: FloatArray
    seen_at_start: BoolArray

    def pick_target_of_replicas(self, target: IntArray) -> "Declared":
        """Return one target's first declaration in each replica (target index; -1: NaN)."""
        return Declared(*(pick_target_by_replica(values, target) for values in self))


def first_declarations_by_sensor(
    group: Group,
    parameters: DeclarationParameters,
    sensors: list[str],
    targets: Sequence[str] | None = None,
) -> dict[str, Declared]:
    """Return each target's first declarations by sensor name, and by any sensor under `any`.

    Targets are those named, or those of the recorded column in its order.
    """
    key = ("declarations", parameters.m, parameters.n, parameters.target, tuple(sensors))
    known = group.cached(key, lambda: _first_declarations(group, parameters, sensors))
    if targets is None:
        return known
    columns: Any = group.tables["detections"]
    index = {name: k for k, name in enumerate(columns["target"].names)}
    wanted = np.array([index.get(name, -1) for name in targets], dtype=np.int64)
    return {
        name: Declared(*(pick_target_columns(values, wanted) for values in each))
        for name, each in known.items()
    }


def _first_declarations(
    group: Group, parameters: DeclarationParameters, sensors: list[str]
) -> dict[str, Declared]:
    columns: Any = group.tables["detections"]
    known = is_of_target(columns, parameters.target)
    count = len(group)
    result: dict[str, Declared] = {}
    for name in sensors:
        rows = np.flatnonzero(known & is_named(columns["block"], name))
        if parameters.m is None or parameters.n is None:
            declared = columns["declared"][rows].astype(bool)
        else:
            declared = _completes_m_of_n(
                columns["replica"][rows],
                columns["target"].codes[rows],
                columns["scan"][rows],
                parameters.m,
                parameters.n,
            )
        first = first_report_rows_of_targets(columns, rows[declared], count)
        time_s = column_at_rows(columns, "time_s", first)
        seen_s = column_at_rows(
            columns, "time_s", first_report_rows_of_targets(columns, rows, count)
        )
        scans = detections_needed_to_declare(parameters.m, group.scene, name)
        result[name] = Declared(
            time_s,
            column_at_rows(columns, "true_range_m", first),
            is_at_earliest_possible_scan(group, name, time_s, scans),
            seen_s,
            is_at_earliest_possible_scan(group, name, seen_s),
        )
    if result:
        result[ANY] = _earliest_of_sensors(list(result.values()))
    return result


def detections_needed_to_declare(m: int | None, scene: Scene, name: str) -> int:
    """Return how many detections declare: `m` if given, else the sensor's ``declare_m``, or 1."""
    return int(m or getattr(scene.blocks[name].parameters, "declare_m", None) or 1)


def _earliest_of_sensors(each: list[Declared]) -> Declared:
    """Return each replica's and target's earliest declaration and detection by any sensor."""
    time_s, range_m, at_start, seen_s, seen_at_start = map(np.array, zip(*each, strict=True))

    def of_first(time_s: AnyArray, *values: AnyArray) -> Iterator[AnyArray]:
        sensor = np.argmin(np.where(np.isnan(time_s), np.inf, time_s), axis=0)[np.newaxis]
        return (np.take_along_axis(one, sensor, axis=0)[0] for one in (time_s, *values))

    return Declared(*of_first(time_s, range_m, at_start), *of_first(seen_s, seen_at_start))


def _completes_m_of_n(replica: IntArray, target: IntArray, scan: IntArray, m: int, n: int) -> Any:
    """Return a mask, True for detections that complete m within n consecutive scans."""
    order = np.lexsort((scan, target, replica))
    declared = np.zeros(len(order), dtype=bool)
    if len(order) >= m:
        r, t, s = replica[order], target[order], scan[order]
        last, first = slice(m - 1, None), slice(None, len(order) - m + 1)
        together = (r[last] == r[first]) & (t[last] == t[first]) & (s[last] - s[first] < n)
        declared[order[m - 1 :]] = together
    return declared
