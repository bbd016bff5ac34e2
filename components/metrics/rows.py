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


def is_at_boundary_scan(time: FloatArray | int, scan: FloatArray | int) -> BoolArray:
    """Return a mask of the times that equal a given scan's, at which the run may cut them off."""
    return np.equal(time, scan)


def censoring_text(at: AnyArray, values: FloatArray | None = None) -> AnyArray:
    """Return censoring texts: ``at`` and the place if cut off, ``never`` for NaN, else None.

    `at` is where each is cut off, empty where it is not; values are NaN where it did not happen, if
    that is worth saying.
    """
    result = np.array([f"at {where}" if where else None for where in at.tolist()], dtype=object)
    if values is not None:
        result[np.isnan(values)] = NEVER
    return result


FUSED = "fused"
#: Columns of the sensors' scans that `nth_scan_time_by_replica_s` needs.
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
    """A metric of one named target, or of any target if none is named."""

    def check(self, blocks: Mapping[str, Component]) -> None:
        """Raise ValueError if the parameters name a target that the traffic does not have."""
        sources = [block for block in blocks.values() if isinstance(block, TrafficSource)]
        names = [target.name for source in sources for target in source.targets]
        if getattr(self.p, "platform", None):
            names += [source.roster.own_name for source in sources]
        target = getattr(self.p, "target", None)
        if sources and target is not None and target not in names:
            raise ValueError(f"target: there is no {target!r}{did_you_mean(target, names)}")


def nonnegative_result_definitions(meanings: Mapping[str, str]) -> list[Result]:
    """Return the definitions of results that are numbers >= 0, from names and descriptions."""
    return [Result(name, NUMBER, meaning, least=0.0) for name, meaning in meanings.items()]


def sensors_to_measure(
    scene: Scene, chosen: Sequence[str] | None, extra: Sequence[str] = ()
) -> list[str]:
    """Return the names of the sensors to measure: the chosen ones, else all and the `extra`."""
    known = [*blocks_recording(scene, "detections"), *extra]
    for name in chosen or ():
        if name not in known:
            raise ValueError(f"sensors: {name!r} reports nothing{did_you_mean(name, known)}")
    return known if chosen is None else list(chosen)


def is_named(column: Any, name: str) -> BoolArray:
    """Return a mask of the rows (True) of a text column that hold the given name."""
    assert isinstance(column, Text)
    if name not in column.names:
        return np.zeros(len(column), dtype=bool)
    return np.asarray(column.codes == column.names.index(name))


def is_of_target(columns: Columns, target: str | None) -> BoolArray:
    """Return which rows are of a target, with None of any (mask); False for false alarms."""
    if target is not None:
        return is_named(columns["target"], target)
    column = columns["target"]
    assert isinstance(column, Text)
    return np.asarray(column.codes >= 0)


def select_rows(columns: Columns, rows: BoolArray, *names: str) -> dict[str, Any]:
    """Return ``replica`` and the named columns at the rows where the mask is True."""
    kept = np.flatnonzero(rows)
    result: dict[str, Any] = {}
    for name in ("replica", *names):
        values: Any = columns[name]
        text = isinstance(values, Text)
        result[name] = Text(values.codes[kept], values.names) if text else values[kept]
    return result


def first_report_rows_of_targets(columns: Columns, rows: IntArray, count: int) -> IntArray:
    """Return each target's first row in each replica, (replicas, targets); -1 without one.

    Names are those of the column; rows to look at and columns are in recorded order.
    """
    table: Any = columns
    many = len(table["target"].names)
    result = np.full(count * many, -1, dtype=np.int64)
    of = table["replica"][rows] * many + table["target"].codes[rows]
    of, first = np.unique(of, return_index=True)
    result[of] = rows[first]
    return result.reshape(count, many)


def earliest_target_by_replica(time_s: FloatArray, range_m: FloatArray) -> IntArray:
    """Return each replica's earliest target (index), the nearest of several; -1 if all NaN.

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


def pick_target_by_replica(values: AnyArray, target: IntArray) -> AnyArray:
    """Return each replica's value of its own given target, (replicas,); NaN or 0 for target -1."""
    return _append_missing(values)[np.arange(len(values)), target]


def pick_target_columns(values: AnyArray, target: IntArray) -> AnyArray:
    """Return given targets' columns, (replicas, given targets); NaN or 0 where a target is -1."""
    return _append_missing(values)[:, target]


def _append_missing(values: AnyArray) -> AnyArray:
    """Return the values with one more column, for a target -1: NaN, or 0 or False."""
    none = np.full((len(values), 1), np.nan if values.dtype.kind == "f" else 0, values.dtype)
    return np.concatenate([values, none], axis=1)


def column_at_rows(columns: Columns, name: str, rows: IntArray) -> FloatArray:
    """Return a column at some rows, of any shape, NaN where the row is -1."""
    values: Any = columns[name]
    result = np.full(rows.shape, np.nan)
    result[rows >= 0] = values[rows[rows >= 0]]
    return result


def share_and_trials_columns(
    name: str, successes: AnyArray, trials: AnyArray
) -> dict[str, FloatArray]:
    """Return a share (NaN without trials) and its number of trials under two column names."""
    with np.errstate(invalid="ignore", divide="ignore"):
        share = np.where(trials > 0, successes / trials, np.nan)
    return {name: share, name + TRIALS: trials.astype(float)}


def alphabetical_name_ranks(column: Any) -> IntArray:
    """Return each row's alphabetical rank of its name, else -1, so codes do not set the order."""
    assert isinstance(column, Text)
    rank = np.empty(len(column.names) + 1, dtype=np.int64)
    rank[sorted(range(len(column.names)), key=column.names.__getitem__)] = np.arange(
        len(column.names)
    )
    rank[-1] = -1
    return np.asarray(rank[column.codes])


def nth_scan_time_by_replica_s(group: Group, name: str, number: int) -> FloatArray:
    """Return the time of scan `number` (from 1) in each replica, s; NaN if it has fewer scans."""
    time_s, start, end = group.cached(
        ("scans_of", name), lambda: _scan_times_and_bounds(group, name)
    )
    at = start + number - 1
    result = np.full(len(group), np.nan)
    result[at < end] = time_s[at[at < end]]
    return result


def _scan_times_and_bounds(group: Group, name: str) -> tuple[FloatArray, IntArray, IntArray]:
    """Return a sensor's scan times, and the start and end index of each replica's in them."""
    columns: Any = group.tables["scans"]
    rows = np.flatnonzero(is_named(columns["block"], name))
    replica, numbers = columns["replica"][rows], np.arange(len(group))
    ends = np.searchsorted(replica, numbers), np.searchsorted(replica, numbers, side="right")
    return columns["time_s"][rows], *ends


def is_at_earliest_possible_scan(
    group: Group, name: str, time_s: FloatArray, scans: int = 1
) -> BoolArray:
    """Return a mask of the times that equal the time of a sensor's scan `scans` (from 1).

    Times are those of replicas, or of replicas and their targets.
    """
    return is_at_boundary_scan(time_s.T, nth_scan_time_by_replica_s(group, name, scans)).T


def left_censoring_text(cut: BoolArray, values: FloatArray) -> AnyArray:
    """Return censoring texts: ``at the start`` where `cut`, ``never`` for NaN, else None."""
    return censoring_text(np.where(cut, START, ""), values)
