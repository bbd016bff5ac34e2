"""The time at which a target is declared: m detections in n scans (``declaration``)."""

from collections.abc import Mapping
from dataclasses import dataclass
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
from components.metrics.run_ends import SCANS, at_start, start_or_never
from dsa_des.arrays.types import AnyArray, BoolArray, FloatArray, IntArray
from dsa_des.scene.scene import Scene
from dsa_des.studies.metric import EVENT, NUMBER, Group, Result, Told

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


#: Columns of detections that `declarations` needs.
DECLARED = {"detections": ("block", "target", "time_s", "true_range_m", "declared", "scan")}


class Declaration(TargetMetric):
    """Time and true slant range of the first declaration, per sensor and of any of them.

    Without `m` and `n` the sensors' own rules count (``declare_m``, ``declare_n``; a sensor
    without a rule declares what it detects).
    """

    Parameters = DeclarationParameters
    tables = {**DECLARED, **SCANS}

    def __init__(self, parameters: Any, scene: Scene) -> None:
        super().__init__(parameters, scene)
        self.sensors = sensors_of(scene, parameters.sensors)
        self.names = [*self.sensors, ANY]

    def results(self) -> list[Result]:
        """Return four results per sensor."""
        found = []
        for name in self.names:
            cut = f"declaration_cut_off.{name}"
            who = "any of the sensors" if name == ANY else name
            found += [
                Result(
                    f"declared.{name}", EVENT, "whether the target is declared",
                    told=Told(who, "no longer declares any target", "now declares a target"),
                ),
                Result(
                    f"declaration_time_s.{name}", NUMBER, "first declaration, s", cut,
                    Told(who, "declares a target earlier", "declares a target later"),
                ),
                Result(f"declaration_range_m.{name}", NUMBER, "true slant range then, m", cut),
                Result(
                    f"declaration_delay_s.{name}", NUMBER, "from first detection to declaration, s"
                ),
            ]  # fmt: skip
        return found

    def measure(self, group: Group) -> Mapping[str, AnyArray]:
        """Return the first declaration of every replica."""
        found: dict[str, AnyArray] = {}
        for name, first in declarations(group, self.p, self.sensors).items():
            found[f"declared.{name}"] = (~np.isnan(first.time_s)).astype(float)
            found[f"declaration_time_s.{name}"] = first.time_s
            found[f"declaration_range_m.{name}"] = first.range_m
            found[f"declaration_delay_s.{name}"] = first.time_s - first.seen_s
            cut = start_or_never(first.at_start, first.time_s)
            found[f"declaration_cut_off.{name}"] = cut
        return found

    def expected(self, scene: Scene) -> Mapping[str, float]:
        """Return scan period × (m - 1): the delay where every scan detects."""
        found: dict[str, float] = {}
        for name in self.sensors:
            parameters = scene.blocks[name].parameters
            clock = scene.blocks[name].cls.clock_of(parameters)
            m = needed(self.p.m, scene, name)
            if clock is not None:
                found[f"declaration_delay_s.{name}"] = float(clock.period_s * (m - 1))
        return found


@dataclass(frozen=True, eq=False)
class Declared:
    """The first declaration of a target by a sensor, per replica.

    Parameters
    ----------
    time_s, range_m : (replicas,)
        When it is and the true slant range then; NaN where there is none.
    seen_s : (replicas,)
        Time of the first detection; NaN where there is none.
    at_start, seen_at_start : (replicas,)
        Whether the declaration, or the detection, is as early as the start of the run lets it.
    """

    time_s: FloatArray
    range_m: FloatArray
    seen_s: FloatArray
    at_start: BoolArray
    seen_at_start: BoolArray


def declarations(
    group: Group, parameters: DeclarationParameters, sensors: list[str]
) -> dict[str, Declared]:
    """Return sensor (or "any") → its first declarations."""
    key = ("declarations", parameters.m, parameters.n, parameters.target, tuple(sensors))
    return group.once(key, lambda: _declarations(group, parameters, sensors))


def _declarations(
    group: Group, parameters: DeclarationParameters, sensors: list[str]
) -> dict[str, Declared]:
    columns: Any = group.tables["detections"]
    known = of_target(columns, parameters.target)
    count = len(group)
    found: dict[str, Declared] = {}
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
        time_s = taken(columns, "time_s", first)
        seen_s = taken(columns, "time_s", first_rows(columns, rows, count))
        scans = needed(parameters.m, group.scene, name)
        found[name] = Declared(
            time_s,
            taken(columns, "true_range_m", first),
            seen_s,
            at_start(group, name, time_s, scans),
            at_start(group, name, seen_s),
        )
    found[ANY] = _earliest(list(found.values()), count)
    return found


def needed(m: int | None, scene: Scene, name: str) -> int:
    """Return how many detections declare: `m`, or what the sensor's own rule says."""
    return int(m or getattr(scene.blocks[name].parameters, "declare_m", None) or 1)


def _earliest(each: list[Declared], count: int) -> Declared:
    """Return the first declaration, and the first detection, of any sensor."""

    def joined(name: str) -> AnyArray:
        return np.array([getattr(one, name) for one in each]).reshape(len(each), count)

    def first(time_s: AnyArray) -> Any:
        return np.argmin(np.where(np.isnan(time_s), np.inf, time_s), axis=0)[np.newaxis]

    declared, seen = first(joined("time_s")), first(joined("seen_s"))
    values = [
        np.take_along_axis(joined(name), which, axis=0)[0]
        for name, which in (("time_s", declared), ("range_m", declared), ("seen_s", seen),
                            ("at_start", declared), ("seen_at_start", seen))
    ]  # fmt: skip
    return Declared(*values)


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
