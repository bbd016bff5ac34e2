"""Rows of a group of replicas: chosen, reduced by replica, and censored by a run's start."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from pydantic import Field

from components.metrics.censored import START, in_scan, said
from components.traffic.source import TrafficSource
from dsa_des.arrays.types import AnyArray, BoolArray, FloatArray, IntArray
from dsa_des.block.component import Component, Parameters
from dsa_des.block.message import Columns, Text
from dsa_des.errors import did_you_mean
from dsa_des.scene.scene import Scene
from dsa_des.studies.metric import NUMBER, TRIALS, Group, Metric, Result, recorded_by

FUSED = "fused"
#: Columns of the sensors' scans that `scan_time_s` needs.
SCANS = {"scans": ("block", "time_s")}


class TargetParameters(Parameters):
    """Parameters of most metrics."""

    target: str | None = Field(
        default=None, description="Name of the target that counts; by default any of them."
    )


class SensorMetricParameters(TargetParameters):
    """A target, and whose reports count."""

    sensors: tuple[str, ...] | None = Field(
        default=None, description="Blocks that are measured; by default all that there are."
    )


class TargetMetric(Metric):
    """A metric of one target, where its parameters name one, or of any."""

    def check(self, blocks: Mapping[str, Component]) -> None:
        """Refuse a target that the traffic does not have."""
        sources = [block for block in blocks.values() if isinstance(block, TrafficSource)]
        names = [target.name for source in sources for target in source.targets]
        target = getattr(self.p, "target", None)
        if sources and target is not None and target not in names:
            raise ValueError(f"target: there is no {target!r}{did_you_mean(target, names)}")


def numbers(meanings: Mapping[str, str]) -> list[Result]:
    """Return results that are numbers of 0 or more, by name with what they mean."""
    return [Result(name, NUMBER, meaning, least=0.0) for name, meaning in meanings.items()]


def sensors_of(scene: Scene, chosen: Sequence[str] | None, extra: Sequence[str] = ()) -> list[str]:
    """Return the sensors to measure: those chosen, or all, and `extra` names."""
    known = [*recorded_by(scene, "detections"), *extra]
    for name in chosen or ():
        if name not in known:
            raise ValueError(f"sensors: {name!r} reports nothing{did_you_mean(name, known)}")
    return known if chosen is None else list(chosen)


def is_named(column: Any, name: str) -> BoolArray:
    """Return which rows of a text column hold a name."""
    assert isinstance(column, Text)
    if name not in column.names:
        return np.zeros(len(column), dtype=bool)
    return np.asarray(column.codes == column.names.index(name))


def of_target(columns: Columns, target: str | None) -> BoolArray:
    """Return which rows are of the target (of any target: false alarms belong to none)."""
    if target is not None:
        return is_named(columns["target"], target)
    column = columns["target"]
    assert isinstance(column, Text)
    return np.asarray(column.codes >= 0)


def chosen(columns: Columns, rows: BoolArray, *names: str) -> dict[str, Any]:
    """Return the chosen rows of ``replica`` and the named columns."""
    kept = np.flatnonzero(rows)
    result: dict[str, Any] = {}
    for name in ("replica", *names):
        values: Any = columns[name]
        text = isinstance(values, Text)
        result[name] = Text(values.codes[kept], values.names) if text else values[kept]
    return result


def first_rows(columns: Columns, rows: IntArray, count: int) -> IntArray:
    """Return the row of each replica's first report, -1 where it has none.

    Rows to look at and columns are in recorded order; of several rows of one instant the one with
    the smallest true range counts.
    """
    table: Any = columns
    if len(rows) == 0:
        return np.full(count, -1, dtype=np.int64)
    replica = table["replica"][rows]
    starts = np.flatnonzero(np.append(True, replica[1:] != replica[:-1]))
    tick, index, together = table["tick"], starts, [starts]
    while len(index := index[index + 1 < len(rows)]):  # those of the same instant follow
        ahead = rows[index + 1]
        same = (replica[index + 1] == replica[index]) & (tick[ahead] == tick[rows[index]])
        index = index[same] + 1
        together.append(index)
    rows = rows[np.sort(np.concatenate(together))]
    ranges = table["true_range_m"][rows]
    order = np.lexsort((np.where(np.isnan(ranges), np.inf, ranges), table["replica"][rows]))
    numbers, first = np.unique(table["replica"][rows][order], return_index=True)
    result = np.full(count, -1, dtype=np.int64)
    result[numbers] = rows[order][first]
    return result


def taken(columns: Columns, name: str, rows: IntArray) -> FloatArray:
    """Return a column at some rows, NaN where the row is -1."""
    values: Any = columns[name]
    result = np.full(len(rows), np.nan)
    result[rows >= 0] = values[rows[rows >= 0]]
    return result


def with_trials(name: str, successes: AnyArray, trials: AnyArray) -> dict[str, FloatArray]:
    """Return a share and its trials; NaN where there was no trial."""
    with np.errstate(invalid="ignore", divide="ignore"):
        share = np.where(trials > 0, successes / trials, np.nan)
    return {name: share, name + TRIALS: trials.astype(float)}


def name_ranks(column: Any) -> IntArray:
    """Return the alphabetical rank of each row's name, so that order rests on names alone."""
    assert isinstance(column, Text)
    rank = np.empty(len(column.names) + 1, dtype=np.int64)
    rank[sorted(range(len(column.names)), key=column.names.__getitem__)] = np.arange(
        len(column.names)
    )
    rank[-1] = -1
    return np.asarray(rank[column.codes])


def scan_time_s(group: Group, name: str, number: int) -> FloatArray:
    """Return when a sensor's scan `number` (from 1) is in every replica, s; NaN without so many."""
    time_s, start, end = group.once(("scans_of", name), lambda: _scans_of(group, name))
    at = start + number - 1
    result = np.full(len(group), np.nan)
    result[at < end] = time_s[at[at < end]]
    return result


def _scans_of(group: Group, name: str) -> tuple[FloatArray, IntArray, IntArray]:
    """Return the times of a sensor's scans, and where those of each replica start and end."""
    columns: Any = group.tables["scans"]
    rows = np.flatnonzero(is_named(columns["block"], name))
    replica, numbers = columns["replica"][rows], np.arange(len(group))
    ends = np.searchsorted(replica, numbers), np.searchsorted(replica, numbers, side="right")
    return columns["time_s"][rows], *ends


def at_start(group: Group, name: str, time_s: FloatArray, scans: int = 1) -> BoolArray:
    """Return whether what takes so many scans of a sensor was seen as early as a start lets it."""
    return in_scan(time_s, scan_time_s(group, name, scans))


def start_or_never(cut: BoolArray, values: FloatArray) -> AnyArray:
    """Return the column that says where values are left-censored, by the start of the run."""
    return said(np.where(cut, START, ""), values)
