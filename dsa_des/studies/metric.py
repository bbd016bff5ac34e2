"""Metrics, which a study measures, registered in the entry-point group ``dsa_des.metrics``.

A metric reads the recorded tables of a *group* of replicas at once: every table has one more
column, ``replica``, with the number of the replica each row belongs to. It is written over arrays,
so ten thousand replicas cost little more than one.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar, TypeVar

import numpy as np

from dsa_des.arrays.types import AnyArray, BoolArray, FloatArray
from dsa_des.block.component import Component, Parameters
from dsa_des.block.entry_points import entry_points_of
from dsa_des.block.message import Columns, Text
from dsa_des.block.registry import ClassText
from dsa_des.block.shadowed_packages import NotImportable, import_named_object, load_entry_point
from dsa_des.errors import did_you_mean
from dsa_des.replicas.changed_scene import Replica
from dsa_des.replicas.drawn_columns import ReplicaScenes, replica_scenes
from dsa_des.replicas.replicas import Recorded
from dsa_des.results.record import (
    CLASS,
    EVENT,
    FRACTION,
    KEY,
    NUMBER,
    RATIO,
    SHARE,
    TRIALS,
    ChangeWords,
    RatioOf,
    Result,
)
from dsa_des.scene.scene import Scene

#: What authors of metrics import from here.
__all__ = [
    "CLASS",
    "EVENT",
    "FRACTION",
    "KEY",
    "METRICS",
    "NUMBER",
    "RATIO",
    "SHARE",
    "TRIALS",
    "ChangeWords",
    "Group",
    "Metric",
    "RatioOf",
    "Result",
    "blocks_recording",
    "check_tables_recordable",
    "check_tables_recorded",
    "expected_column",
    "find_metric",
    "measure_one_by_one",
    "missing_values",
    "needed_columns",
]  # fmt: skip

METRICS = "dsa_des.metrics"
_T = TypeVar("_T")


class Group:
    """Replicas of one scene and their recorded tables, from which metrics are computed.

    Parameters
    ----------
    scene : Scene
        Without the changes of single replicas.
    replicas : sequence of Replica
    recorded : sequence of Recorded
        One per replica.
    wanted : mapping
        Tables and columns that are there.
    """

    def __init__(
        self,
        scene: Scene,
        replicas: Sequence[Replica],
        recorded: Sequence[Recorded],
        wanted: Mapping[str, Any],
    ) -> None:
        self.scene = scene
        self.replicas = replicas
        self.duration_s: FloatArray = np.array([run.duration_s for run in recorded])
        #: Which of them a block ended before their time.
        self.ended_early: BoolArray = np.array([run.ended_early for run in recorded], dtype=bool)
        #: Table name → columns, with ``replica``; rows are in order of replica and time.
        self.tables: dict[str, Columns] = {
            table: _concatenate_columns(table, wanted[table], recorded) for table in sorted(wanted)
        }

        self._known: dict[Any, Any] = {}

    def __len__(self) -> int:
        return len(self.replicas)

    def cached(self, key: Any, make: Callable[[], _T]) -> _T:
        """Return the result of `make`, called once per group and key for metrics to share."""
        if key not in self._known:
            self._known[key] = make()
        result: _T = self._known[key]
        return result

    @cached_property
    def scenes(self) -> Sequence[Scene]:
        """The scene of each replica, with that replica's changes applied."""
        return replica_scenes(self.scene, self.replicas)

    def parameters_of(self, block: str) -> Sequence[Any]:
        """Return a block's parameters in every replica, one entry per replica."""

        def parameters() -> Sequence[Any]:
            if isinstance(self.scenes, ReplicaScenes):
                return self.scenes.parameters_of(block)
            return [scene.blocks[block].parameters for scene in self.scenes]

        return self.cached(("parameters", block), parameters)


def _concatenate_columns(table: str, columns: Any, recorded: Sequence[Recorded]) -> Columns:
    parts = [part for part in _recorded_parts(table, recorded) if len(part["tick"])]
    joined: Columns = {"replica": _concatenate([part["replica"] for part in parts])}
    for name in columns:
        if any(name not in part for part in parts):
            continue  # a recording of before the column; a metric asks whether it is there
        if parts:
            joined[name] = _concatenate([part[name] for part in parts])
            continue
        text = any(isinstance(run.tables.get(table, {}).get(name), Text) for run in recorded)
        none = np.empty(0, dtype=np.int64)
        joined[name] = Text(none, ()) if text or name == "block" else np.empty(0)
    return joined


def _recorded_parts(table: str, recorded: Sequence[Recorded]) -> Iterator[Columns]:
    """Yield one table's recorded columns and ``replica``, by single runs or whole lock steps."""
    start = 0
    while start < len(recorded):
        shared = recorded[start].shared
        runs = recorded[start : start + (1 if shared is None else shared.replicas)]
        alike = all(run.shared is shared and run.number == k for k, run in enumerate(runs))
        if shared is not None and alike and len(runs) == shared.replicas:
            columns: Any = shared.tables.get(table)
            if columns:
                yield {**columns, "replica": columns["replica"] + start if start else
                       columns["replica"]}  # fmt: skip
            start += len(runs)
            continue
        if part := recorded[start].tables.get(table):
            yield {**part, "replica": np.full(len(part["tick"]), start, dtype=np.int64)}
        start += 1


def _concatenate(pieces: Sequence[Any]) -> Any:
    if len(pieces) == 1:
        return pieces[0]
    if pieces and isinstance(pieces[0], Text):
        return _join_texts(pieces)
    return np.concatenate(pieces) if pieces else np.empty(0, dtype=np.int64)


def _join_texts(pieces: Sequence[Text]) -> Text:
    names: dict[str, int] = {}
    lookups: dict[tuple[str, ...], Any] = {}
    codes = []
    for piece in pieces:
        if piece.names not in lookups:
            known = [names.setdefault(name, len(names)) for name in piece.names]
            lookups[piece.names] = np.array([*known, -1], dtype=np.int64)
        codes.append(lookups[piece.names][piece.codes])
    return Text(np.concatenate(codes), tuple(names))


class Metric:
    """Base class of what is measured of every run of a study; subclass and register it.

    Parameters
    ----------
    parameters : Parameters
        Validated values of the metric's table in the study.
    scene : Scene
        One scene of the study; wires and block names are those of all.

    Raises
    ------
    ValueError
        If the scene lacks what the metric needs.
    """

    #: Model of the metric's own keys in the study.
    Parameters: ClassVar[type[Parameters]] = Parameters
    #: Recorded tables it reads, and which of their columns.
    tables: Mapping[str, tuple[str, ...]] = {}
    #: Names of numbers that tell runs apart before they are run, which `foresee` gives besides.
    #: Those that `expected_column` names are the chances that it expects of an event.
    geometry: tuple[str, ...] = ()
    #: Scores that tell how near a run comes to `scored_events` → levels that may be chosen by a
    #: pilot, falling; the last is the event itself.
    scores: Mapping[str, FloatArray] = {}

    def __init__(self, parameters: Any, scene: Scene) -> None:
        self.p = parameters
        self.scene = scene

    def results(self) -> list[Result]:
        """Return the result columns that this metric produces."""
        raise NotImplementedError

    def measure(self, group: Group) -> Mapping[str, AnyArray]:
        """Return result name → values, shape (replicas,); NaN where a run has no value.

        Columns that `Result.cut_off` names, and classes, hold texts, or None. Ratios have none.
        """
        raise NotImplementedError

    def foresee(self, group: Group) -> Mapping[str, AnyArray]:
        """Return result or geometry name → values known of every replica without running it.

        The group has recorded nothing. Results are those that `measure` would give, to the bit.
        """
        raise NotImplementedError

    def scored_events(self) -> Sequence[str]:
        """Return the names of the events to which `reached_s` tells how near each run came."""
        return ()

    def reached_s(
        self, group: Group, event: str, score: str, levels: Sequence[float]
    ) -> FloatArray:
        """Return when each replica first reached each level of a score, s, (levels, replicas).

        NaN where it never did. Levels fall, the last one of `scores` is the event itself, and what
        is reached by an instant depends on nothing later.
        """
        raise NotImplementedError

    def unit_weights(self, group: Group) -> FloatArray:
        """Return the weight of each replica, (replicas,): how often its encounter happens."""
        return np.ones(len(group))

    def check(self, blocks: Mapping[str, Component]) -> None:
        """Raise ValueError for faults that show only once the blocks are set up.

        Called before a study runs, never during it.
        """

    def analytic_answers(self, scene: Scene) -> Mapping[str, float]:
        """Return result → analytic answer for a scene, for those results that have one."""
        return {}


def expected_column(event: str) -> str:
    """Return ``expected.EVENT``, the name in `Metric.geometry` of an event's expected chance."""
    return f"expected.{event}"


def find_metric(name: str, beside: Sequence[Path] = ()) -> type[Metric]:
    """Return the metric class of a name, or of ``module:Class`` or ``./file.py:Class``."""
    if isinstance(name, ClassText):
        return _require_metric(name, name.cls)
    point = entry_points_of(METRICS).get(name)
    if point is None and ":" not in name:
        hint = did_you_mean(name, entry_points_of(METRICS))
        raise ValueError(f"unknown metric{hint} (or module:Class)")
    try:
        result = (
            import_named_object(name, "metrics", beside)
            if point is None
            else load_entry_point(point, "metrics")
        )
    except NotImportable as error:
        raise ValueError(str(error)) from error.__cause__
    return _require_metric(name, result)


def _require_metric(name: str, result: Any) -> type[Metric]:
    if not (isinstance(result, type) and issubclass(result, Metric)):
        raise ValueError(f"{name} is not a dsa_des.studies.metric.Metric")
    return result


def blocks_recording(scene: Scene, table: str) -> list[str]:
    """Return the blocks of a scene that can record rows of a table, sorted by name."""
    return [
        name for name, cls in sorted(scene.classes.items()) if table in _tables_recorded_by(cls)
    ]


def _tables_recorded_by(cls: type[Component]) -> set[str]:
    """Return the names of the tables that a block class records or may record."""
    messages = [*(output.message for output in cls.outputs.values()), *cls.also_records]
    return {table for message in messages for table in message.recorded}


def check_tables_recordable(metric: type[Metric], scene: Scene) -> None:
    """Raise ValueError unless some block of the scene records each table the metric reads."""
    for table in metric.tables:
        if not blocks_recording(scene, table):
            known = set().union(*(_tables_recorded_by(cls) for cls in scene.classes.values()))
            raise ValueError(
                f"needs a block whose output records {table!r}; this scene's blocks record "
                f"{', '.join(sorted(known)) or 'nothing'}"
            )


def check_tables_recorded(metric: Metric, blocks: Mapping[str, Component]) -> None:
    """Raise ValueError unless blocks that are set up record each table the metric reads."""
    recorded = {
        table
        for block in blocks.values()
        for message in block.records()
        for table in message.recorded
    }
    for table in sorted(set(metric.tables) - recorded):
        asked = [
            f"; [{name}] {table} = true asks for it"
            for name, section in metric.scene.sections.items()
            if table in type(section).model_fields
        ]
        raise ValueError(f"needs the table {table!r}, which this scene does not record"
                         + "".join(asked))  # fmt: skip


def needed_columns(metrics: Sequence[Metric]) -> dict[str, tuple[str, ...]]:
    """Return table → sorted columns that the metrics need, always including ``tick``."""
    wanted: dict[str, set[str]] = {}
    for metric in metrics:
        for table, columns in metric.tables.items():
            wanted.setdefault(table, {"tick"}).update(columns)
    return {table: tuple(sorted(columns)) for table, columns in sorted(wanted.items())}


def missing_values(count: int, *, text: bool) -> AnyArray:
    """Return an array of `count` missing values: None for texts, NaN for numbers."""
    return np.full(count, None, dtype=object) if text else np.full(count, np.nan)


def measure_one_by_one(
    measure: Callable[[Sequence[Any]], tuple[dict[str, AnyArray], dict[int, str]]],
    runs: Sequence[Any],
) -> tuple[dict[str, AnyArray], dict[int, str]]:
    """Measure each run alone, in case one fails; return the values, and run index → error."""
    result: dict[str, AnyArray] = {}
    errors: dict[int, str] = {}
    for k, run in enumerate(runs):
        values, wrong = measure([run])
        if wrong:
            errors[k] = wrong[0]
        for name, column in values.items():
            nothing = missing_values(len(runs), text=column.dtype == object)
            result.setdefault(name, nothing)[k] = column[0]
    return result, errors
