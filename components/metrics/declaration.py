"""The time at which a target is declared: m detections in n scans (``declaration``)."""

from collections.abc import Mapping
from typing import Any, Self

import numpy as np
from pydantic import Field, model_validator

from components.metrics.rows import (
    SensorMetricParameters,
    TargetMetric,
    first_rows,
    is_named,
    of_target,
    sensors_of,
    taken,
)
from dsa_des.arrays.types import FloatArray, IntArray
from dsa_des.scene.scene import Scene
from dsa_des.studies.metric import EVENT, NUMBER, Group, Result

ANY = "any"


class DeclarationParameters(SensorMetricParameters):
    """Parameters of declaration metrics."""

    m: int | None = Field(
        default=None, ge=1, description="Detections that declare; by default the sensor's rule."
    )
    n: int | None = Field(
        default=None, ge=1, le=1000, description="Consecutive scans that they are counted in."
    )

    @model_validator(mode="after")
    def _rule(self) -> Self:
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
    tables = {"detections": ("block", "target", "time_s", "true_range_m", "declared", "scan")}

    def __init__(self, parameters: Any, scene: Scene) -> None:
        super().__init__(parameters, scene)
        self.sensors = sensors_of(scene, parameters.sensors)
        self.names = [*self.sensors, ANY]

    def results(self) -> list[Result]:
        """Return four results per sensor."""
        found = []
        for name in self.names:
            found += [
                Result(f"declared.{name}", EVENT, "whether the target is declared"),
                Result(f"declaration_time_s.{name}", NUMBER, "first declaration, s"),
                Result(f"declaration_range_m.{name}", NUMBER, "true slant range then, m"),
                Result(
                    f"declaration_delay_s.{name}", NUMBER, "from first detection to declaration, s"
                ),
            ]
        return found

    def measure(self, group: Group) -> Mapping[str, FloatArray]:
        """Return the first declaration of every replica."""
        found: dict[str, FloatArray] = {}
        for name, (time_s, range_m, first_s) in declarations(group, self.p, self.sensors).items():
            found[f"declared.{name}"] = (~np.isnan(time_s)).astype(float)
            found[f"declaration_time_s.{name}"] = time_s
            found[f"declaration_range_m.{name}"] = range_m
            found[f"declaration_delay_s.{name}"] = time_s - first_s
        return found

    def expected(self, scene: Scene) -> Mapping[str, float]:
        """Return scan period × (m - 1): the delay where every scan detects."""
        found: dict[str, float] = {}
        for name in self.sensors:
            parameters = scene.blocks[name].parameters
            clock = scene.blocks[name].cls.clock_of(parameters)
            m = self.p.m or getattr(parameters, "declare_m", None) or 1
            if clock is not None:
                found[f"declaration_delay_s.{name}"] = float(clock.period_s * (m - 1))
        return found


def declarations(
    group: Group, parameters: DeclarationParameters, sensors: list[str]
) -> dict[str, tuple[FloatArray, FloatArray, FloatArray]]:
    """Return sensor (or "any") → time (s) and true range (m) of the first declaration, and the
    time (s) of the first detection, per replica."""
    key = ("declarations", parameters.m, parameters.n, parameters.target, tuple(sensors))
    return group.once(key, lambda: _declarations(group, parameters, sensors))


def _declarations(
    group: Group, parameters: DeclarationParameters, sensors: list[str]
) -> dict[str, tuple[FloatArray, FloatArray, FloatArray]]:
    columns: Any = group.tables["detections"]
    known = of_target(columns, parameters.target)
    count = len(group)
    found: dict[str, tuple[FloatArray, FloatArray, FloatArray]] = {}
    for name in sensors:
        rows = np.flatnonzero(known & is_named(columns["block"], name))
        if parameters.m is None or parameters.n is None:
            declared = columns["declared"][rows].astype(bool)
        else:
            declared = _m_of_n(
                columns["replica"][rows],
                columns["target"].codes[rows],
                columns["scan"][rows],
                parameters.m,
                parameters.n,
            )
        first = first_rows(columns, rows[declared], count)
        found[name] = (
            taken(columns, "time_s", first),
            taken(columns, "true_range_m", first),
            taken(columns, "time_s", first_rows(columns, rows, count)),
        )
    each = list(found.values())
    times, ranges, firsts = (
        np.array([part[k] for part in each]).reshape(len(each), count) for k in range(3)
    )
    which = np.argmin(np.where(np.isnan(times), np.inf, times), axis=0)[np.newaxis]
    found[ANY] = (
        np.take_along_axis(times, which, axis=0)[0],
        np.take_along_axis(ranges, which, axis=0)[0],
        np.min(np.where(np.isnan(firsts), np.inf, firsts), axis=0),
    )
    return found


def _m_of_n(replica: IntArray, target: IntArray, scan: IntArray, m: int, n: int) -> Any:
    """Return at which detections a target has m of them within n consecutive scans."""
    order = np.lexsort((scan, target, replica))
    declared = np.zeros(len(order), dtype=bool)
    if len(order) >= m:
        r, t, s = replica[order], target[order], scan[order]
        last, first = slice(m - 1, None), slice(None, len(order) - m + 1)
        together = (r[last] == r[first]) & (t[last] == t[first]) & (s[last] - s[first] < n)
        declared[order[m - 1 :]] = together
    return declared
