"""Time and place of a target's first detection, and the share of looks (``first_detection``,
``detection_share``)."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from components.metrics.rows import (
    FUSED,
    SensorMetricParameters,
    TargetMetric,
    first_rows,
    is_named,
    of_target,
    sensors_of,
    taken,
    with_trials,
)
from components.metrics.run_ends import SCANS, at_start, scan_time_s, start_or_never
from dsa_des.arrays.types import AnyArray, BoolArray, FloatArray
from dsa_des.scene.scene import Scene
from dsa_des.studies.metric import EVENT, NUMBER, SHARE, Group, Result, Told, recorded_by

_ROWS = ("block", "target", "time_s", "true_range_m")


class FirstDetection(TargetMetric):
    """Time and true slant range of the first detection, per sensor and of the fusion."""

    Parameters = SensorMetricParameters
    tables = {"detections": _ROWS, **SCANS}

    def __init__(self, parameters: Any, scene: Scene) -> None:
        super().__init__(parameters, scene)
        fusions = recorded_by(scene, FUSED)
        self.names = sensors_of(scene, parameters.sensors, [FUSED] if fusions else [])
        self.fusion = fusions[0] if fusions else None
        #: Delay (s) from each block to the fusion.
        self.delay_s: dict[str, float] = {}
        if FUSED in self.names:
            self.tables = {**self.tables, FUSED: (*_ROWS, "sensors")}
            wires = [wire for wire in scene.wires if wire.target in fusions]
            self.delay_s = {wire.source: float(wire.total_delay_s) for wire in wires}

    def results(self) -> list[Result]:
        """Return three results per sensor."""
        found = []
        for name in self.names:
            who = "the fusion" if name == FUSED else name
            block = self.fusion if name == FUSED else name
            time, cut = f"first report by {who}, s", f"first_detection_cut_off.{name}"
            found += [
                Result(
                    f"detected.{name}", EVENT, f"whether {who} reports the target at all",
                    told=Told(who, "no longer sees any target", "now sees a target"), block=block,
                ),
                Result(
                    f"first_detection_time_s.{name}", NUMBER, time, cut,
                    Told(who, "sees a target earlier", "sees a target later"), block,
                ),
                Result(
                    f"first_detection_range_m.{name}", NUMBER, "true slant range then, m", cut,
                    Told(who, "first sees it nearer", "first sees it farther away"), block,
                ),
            ]  # fmt: skip
        return found

    def measure(self, group: Group) -> Mapping[str, AnyArray]:
        """Return the first report of every replica."""
        found: dict[str, AnyArray] = {}
        for name in self.names:
            time_s, range_m = first_report(group, name, self.p.target)
            found[f"detected.{name}"] = (~np.isnan(time_s)).astype(float)
            found[f"first_detection_time_s.{name}"] = time_s
            found[f"first_detection_range_m.{name}"] = range_m
            cut = self._fused_at_start(group) if name == FUSED else at_start(group, name, time_s)
            found[f"first_detection_cut_off.{name}"] = start_or_never(cut, time_s)
        return found

    def _fused_at_start(self, group: Group) -> BoolArray:
        """Return whether a replica's first fused report is of what a sensor's first scan saw."""
        columns: Any = group.tables[FUSED]
        rows = np.flatnonzero(of_target(columns, self.p.target))
        first = first_rows(columns, rows, len(group))
        sensors = columns["sensors"]
        code = np.where(first >= 0, sensors.codes[first], -1) if len(rows) else first
        found = np.zeros(len(group), dtype=bool)
        for number, names in enumerate(sensors.names):
            for name in names.split("+"):
                # Lateness on the way may vary, but not by a whole scan.
                seen_s = taken(columns, "time_s", first) - self.delay_s.get(name, 0.0)
                begun = ~np.isnan(scan_time_s(group, name, 1))
                again_s = scan_time_s(group, name, 2)
                found |= (code == number) & begun & ~(seen_s >= again_s)
        return found


def first_report(group: Group, name: str, target: str | None) -> list[FloatArray]:
    """Return time (s) and true range (m) of a sensor's first report, or the fusion's ("fused").

    Of several targets reported at that instant the nearest counts.
    """
    columns = group.tables[FUSED if name == FUSED else "detections"]
    rows = of_target(columns, target)
    if name != FUSED:
        rows &= is_named(columns["block"], name)
    first = first_rows(columns, np.flatnonzero(rows), len(group))
    return [taken(columns, "time_s", first), taken(columns, "true_range_m", first)]


class DetectionShare(TargetMetric):
    """Share of the looks at targets inside a sensor's reach that detect."""

    Parameters = SensorMetricParameters
    tables = {"detections": ("block", "target"), "scans": ("block", "evaluated")}

    def __init__(self, parameters: Any, scene: Scene) -> None:
        super().__init__(parameters, scene)
        if parameters.target is not None:
            raise ValueError("target: looks are counted over all targets; leave it out")
        self.names = sensors_of(scene, parameters.sensors)

    def results(self) -> list[Result]:
        """Return one share per sensor."""
        meaning = "detections per look at a target in reach"
        return [Result(f"detection_share.{name}", SHARE, meaning) for name in self.names]

    def measure(self, group: Group) -> Mapping[str, FloatArray]:
        """Count looks and detections of every replica."""
        scans, detections = group.tables["scans"], group.tables["detections"]
        found: dict[str, FloatArray] = {}
        for name in self.names:
            looks = is_named(scans["block"], name)
            hits = is_named(detections["block"], name) & of_target(detections, None)
            rows: Any = scans
            trials = np.bincount(
                rows["replica"][looks], weights=rows["evaluated"][looks], minlength=len(group)
            )
            rows = detections
            successes = np.bincount(rows["replica"][hits], minlength=len(group))
            found |= with_trials(f"detection_share.{name}", successes, trials)
        return found
