"""Rows of a group of replicas: chosen, reduced by replica, and censored by a run's start."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from pydantic import Field

from components.traffic.source import TrafficSource
from dsa_des.arrays.types import AnyArray, BoolArray, FloatArray, IntArray
from dsa_des.block.component import Component, Parameters
from dsa_des.block.message import Columns, Text
from dsa_des.errors import did_you_mean
from dsa_des.scene.scene import Scene
from dsa_des.studies.metric import NUMBER, TRIALS, Group, Metric, Result, blocks_recording

#: How the two ends of a run are called.
START, END = "the start", "the end of the run"
#: What is said of what did not happen within the run.
NEVER = "never"


def is_in_scan(time: FloatArray | int, scan: FloatArray | int) -> BoolArray:
    """Return which events lie in the first (or last) scan, which may have cut them off."""
    return np.equal(time, scan)


def censoring_text(at: AnyArray, values: FloatArray | None = None) -> AnyArray:
    """Return what a study's column says of values: ``at the start``, ``never`` or nothing.

    `at` is where each is cut off, empty where it is not; values are NaN where it did not happen, if
    that is worth saying.
    """
    result = np.array([f"at {where}" if where else None for where in at.tolist()], dtype=object)
    if values is not None:
        result[np.isnan(values)] = NEVER
    return result


FUSED = "fused"
#: Columns of the sensors' scans that `scan_time_s` needs.
SCANS = {"scans": ("block", "time_s")}


class PlatformParameters(Parameters):
    """Parameters of metrics of flights."""

    platform: str | None = Field(
        default=None,
        description="Name of the aircraft from which the others are seen; by default the ownship.",
    )


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
        if getattr(self.p, "platform", None):
            names += [source.roster.own_name for source in sources]
        target = getattr(self.p, "target", None)
        if sources and target is not None and target not in names:
            raise ValueError(f"target: there is no {target!r}{did_you_mean(target, names)}")


def numbers(meanings: Mapping[str, str]) -> list[Result]:
    """Return results that are numbers of 0 or more, by name with what they mean."""
    return [Result(name, NUMBER, meaning, least=0.0) for name, meaning in meanings.items()]


def sensors_of(scene: Scene, chosen: Sequence[str] | None, extra: Sequence[str] = ()) -> list[str]:
    """Return the sensors to measure: those chosen, or all, and `extra` names."""
    known = [*blocks_recording(scene, "detections"), *extra]
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


def is_of_target(columns: Columns, target: str | None) -> BoolArray:
    """Return which rows are of the target (of any target: false alarms belong to none)."""
    if target is not None:
        return is_named(columns["target"], target)
    column = columns["target"]
    assert isinstance(column, Text)
    return np.asarray(column.codes >= 0)


def select_rows(columns: Columns, rows: BoolArray, *names: str) -> dict[str, Any]:
    """Return the chosen rows of ``replica`` and the named columns."""
    kept = np.flatnonzero(rows)
    result: dict[str, Any] = {}
    for name in ("replica", *names):
        values: Any = columns[name]
        text = isinstance(values, Text)
        result[name] = Text(values.codes[kept], values.names) if text else values[kept]
    return result


def first_of_targets(columns: Columns, rows: IntArray, count: int) -> IntArray:
    """Return the row of each replica's first report of each target, (count, names), -1 for none.

    Names are those of the column; rows to look at and columns are in recorded order.
    """
    table: Any = columns
    many = len(table["target"].names)
    result = np.full(count * many, -1, dtype=np.int64)
    of = table["replica"][rows] * many + table["target"].codes[rows]
    of, first = np.unique(of, return_index=True)
    result[of] = rows[first]
    return result.reshape(count, many)


def earliest(time_s: FloatArray, range_m: FloatArray) -> IntArray:
    """Return which target comes first in each replica, of several at one instant the nearest.

    Times and ranges (replicas, targets) are NaN for what does not happen; -1 where nothing does.
    """
    none = np.isnan(time_s)
    if none.shape[1] == 0:
        return np.full(len(none), -1, dtype=np.int64)
    first_s = np.where(none, np.inf, time_s)
    at_once = first_s == first_s.min(axis=1, keepdims=True)
    nearest = np.where(at_once & ~np.isnan(range_m), range_m, np.inf)
    # One without a range comes after those with one, and before those of another instant.
    nearest = np.where(at_once, np.minimum(nearest, np.finfo(float).max), np.inf)
    return np.where(none.all(axis=1), -1, nearest.argmin(axis=1))


def values_of_target(values: AnyArray, target: IntArray) -> AnyArray:
    """Return the value (replicas, targets) of one target of each replica; of one of -1 none."""
    return _append_missing(values)[np.arange(len(values)), target]


def values_of_targets(values: AnyArray, target: IntArray) -> AnyArray:
    """Return values (replicas, targets) of some targets; of one that is -1 there are none."""
    return _append_missing(values)[:, target]


def _append_missing(values: AnyArray) -> AnyArray:
    """Return values (replicas, targets) with those of no target last: NaN, or 0 and False."""
    none = np.full((len(values), 1), np.nan if values.dtype.kind == "f" else 0, values.dtype)
    return np.concatenate([values, none], axis=1)


def column_at_rows(columns: Columns, name: str, rows: IntArray) -> FloatArray:
    """Return a column at some rows, of any shape, NaN where the row is -1."""
    values: Any = columns[name]
    result = np.full(rows.shape, np.nan)
    result[rows >= 0] = values[rows[rows >= 0]]
    return result


def share_columns(name: str, successes: AnyArray, trials: AnyArray) -> dict[str, FloatArray]:
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
    time_s, start, end = group.cached(("scans_of", name), lambda: _scans_of(group, name))
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


def is_at_start(group: Group, name: str, time_s: FloatArray, scans: int = 1) -> BoolArray:
    """Return whether what takes so many scans of a sensor was seen as early as a start lets it.

    Times are those of replicas, or of replicas and their targets.
    """
    return is_in_scan(time_s.T, scan_time_s(group, name, scans)).T


def start_or_never(cut: BoolArray, values: FloatArray) -> AnyArray:
    """Return the column that says where values are left-censored, by the start of the run."""
    return censoring_text(np.where(cut, START, ""), values)
