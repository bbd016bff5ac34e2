"""Array tools that metrics share: rows of a group of replicas, chosen and reduced by replica."""

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
from dsa_des.studies.metric import Metric, recorded_by

FUSED = "fused"


class TargetParameters(Parameters):
    """What most metrics can be told."""

    target: str | None = Field(
        default=None, description="Name of the target that counts; by default any of them."
    )


class SensorMetricParameters(TargetParameters):
    """A target, and whose reports count."""

    sensors: tuple[str, ...] | None = Field(
        default=None, description="Blocks that are measured; by default all that there are."
    )


class TargetMetric(Metric):
    """A metric that can be told which target counts."""

    def check(self, blocks: Mapping[str, Component]) -> None:
        """Refuse a target that the traffic does not have."""
        sources = [block for block in blocks.values() if isinstance(block, TrafficSource)]
        names = [target.name for source in sources for target in source.targets]
        if sources and self.p.target is not None and self.p.target not in names:
            hint = did_you_mean(self.p.target, names)
            raise ValueError(f"target: there is no {self.p.target!r}{hint}")


def sensors_of(scene: Scene, chosen: Sequence[str] | None, extra: Sequence[str] = ()) -> list[str]:
    """Return the sensors to measure: those chosen, or all, and `extra` names.

    Raises
    ------
    ValueError
        If one of those chosen is not there.
    """
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
    place = np.flatnonzero(rows)
    found: dict[str, Any] = {}
    for name in ("replica", *names):
        values: Any = columns[name]
        text = isinstance(values, Text)
        found[name] = Text(values.codes[place], values.names) if text else values[place]
    return found


def first_rows(columns: Columns, rows: IntArray, count: int) -> IntArray:
    """Return the row of each replica's first report, -1 where it has none.

    Of several rows of one instant the one with the smallest true range counts.

    Parameters
    ----------
    columns : mapping
        With ``replica``, ``tick`` and ``true_range_m``, in recorded order.
    rows : (n,)
        The rows to look at, ascending.
    count : int
        Number of replicas.
    """
    table: Any = columns
    if len(rows) == 0:
        return np.full(count, -1, dtype=np.int64)
    replica = table["replica"][rows]
    starts = np.flatnonzero(np.append(True, replica[1:] != replica[:-1]))
    tick, place, found_at = table["tick"], starts, [starts]
    while len(place := place[place + 1 < len(rows)]):  # those of the same instant follow
        ahead = rows[place + 1]
        same = (replica[place + 1] == replica[place]) & (tick[ahead] == tick[rows[place]])
        place = place[same] + 1
        found_at.append(place)
    rows = rows[np.sort(np.concatenate(found_at))]
    ranges = table["true_range_m"][rows]
    order = np.lexsort((np.where(np.isnan(ranges), np.inf, ranges), table["replica"][rows]))
    numbers, place = np.unique(table["replica"][rows][order], return_index=True)
    found = np.full(count, -1, dtype=np.int64)
    found[numbers] = rows[order][place]
    return found


def taken(columns: Columns, name: str, rows: IntArray) -> FloatArray:
    """Return a column at some rows, NaN where the row is -1."""
    values: Any = columns[name]
    found = np.full(len(rows), np.nan)
    found[rows >= 0] = values[rows[rows >= 0]]
    return found


def with_trials(name: str, successes: AnyArray, trials: AnyArray) -> dict[str, FloatArray]:
    """Return a share and its trials; NaN where there was no trial."""
    from dsa_des.studies.metric import TRIALS

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
