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
from dsa_des.arrays.types import FloatArray
from dsa_des.scene.scene import Scene
from dsa_des.studies.metric import EVENT, NUMBER, SHARE, Group, Result, recorded_by

_ROWS = ("block", "target", "time_s", "true_range_m")


class FirstDetection(TargetMetric):
    """Time and true slant range of the first detection, per sensor and of the fusion."""

    Parameters = SensorMetricParameters
    tables = {"detections": _ROWS}

    def __init__(self, parameters: Any, scene: Scene) -> None:
        super().__init__(parameters, scene)
        fusions = recorded_by(scene, FUSED)
        self.names = sensors_of(scene, parameters.sensors, [FUSED] if fusions else [])
        if FUSED in self.names:
            self.tables = {**self.tables, FUSED: _ROWS}

    def results(self) -> list[Result]:
        """Return three results per sensor."""
        found = []
        for name in self.names:
            who = "the fusion" if name == FUSED else name
            found += [
                Result(f"detected.{name}", EVENT, f"whether {who} reports the target at all"),
                Result(f"first_detection_time_s.{name}", NUMBER, f"first report by {who}, s"),
                Result(f"first_detection_range_m.{name}", NUMBER, "true slant range then, m"),
            ]
        return found

    def measure(self, group: Group) -> Mapping[str, FloatArray]:
        """Return the first report of every replica."""
        found: dict[str, FloatArray] = {}
        for name in self.names:
            time_s, range_m = first_report(group, name, self.p.target)
            found[f"detected.{name}"] = (~np.isnan(time_s)).astype(float)
            found[f"first_detection_time_s.{name}"] = time_s
            found[f"first_detection_range_m.{name}"] = range_m
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
