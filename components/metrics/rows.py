"""Array tools that metrics share: rows of a group of replicas, chosen and reduced by replica."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from pydantic import Field

from dsa_des.component import Parameters
from dsa_des.message import Columns, Text
from dsa_des.scene import Scene
from dsa_des.studies.metric import recorded_by
from dsa_des.types import AnyArray, BoolArray, FloatArray, IntArray

FUSED = "fused"


class TargetParameters(Parameters):
    """What most metrics can be told."""

    target: str | None = Field(
        default=None, description="Name of the target that counts; by default any of them."
    )


class SensorParameters(TargetParameters):
    """A target, and whose reports count."""

    sensors: tuple[str, ...] | None = Field(
        default=None, description="Blocks that are measured; by default all that there are."
    )


def sensors_of(scene: Scene, chosen: Sequence[str] | None, extra: Sequence[str] = ()) -> list[str]:
    """Return the sensors to measure: those chosen, or all, and `extra` names.

    Raises
    ------
    ValueError
        If one of those chosen is not there.
    """
    from dsa_des.errors import did_you_mean

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


def chosen(columns: Columns, rows: BoolArray) -> dict[str, Any]:
    """Return the chosen rows of every column."""
    return {
        name: Text(values.codes[rows], values.names) if isinstance(values, Text) else values[rows]
        for name, values in columns.items()
    }


def first_of(replica: IntArray, count: int, *values: FloatArray) -> list[FloatArray]:
    """Return each replica's first row of some values, NaN where it has none.

    Parameters
    ----------
    replica : (rows,)
        Ascending; rows of a replica are in order of time.
    count : int
        Number of replicas.
    values : (rows,)
    """
    numbers, place = np.unique(replica, return_index=True)
    found = []
    for column in values:
        full = np.full(count, np.nan)
        full[numbers] = column[place]
        found.append(full)
    return found


def nearest_first(columns: dict[str, Any]) -> IntArray:
    """Return the order of rows by replica, instant and true range (unknown ranges last)."""
    ranges = columns["true_range_m"]
    return np.lexsort((np.where(np.isnan(ranges), np.inf, ranges), columns["tick"],
                       columns["replica"]))  # fmt: skip


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
