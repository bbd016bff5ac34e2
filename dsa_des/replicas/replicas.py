"""Many runs of one scene that differ by their seed and by a few values."""

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np

from dsa_des.block.message import Columns, slice_columns
from dsa_des.errors import BlockFailure, SceneError
from dsa_des.record.failure_counts import (
    FailureCounts,
    FailuresByRun,
    sum_counts_over_runs,
    sum_failure_counts,
)
from dsa_des.record.recording import Recorder
from dsa_des.record.sinks import ColumnSink
from dsa_des.replicas.changed_scene import Replica, replica_scene
from dsa_des.replicas.drawn_columns import replica_scenes, scenes_from_drawn_columns
from dsa_des.replicas.lock_step_size import RunSize, surely_fit_in_memory
from dsa_des.replicas.lockstep import NotInLockStep, Replicas, make_lockstep_simulation
from dsa_des.running.simulation import Simulation
from dsa_des.scene.scene import Scene

#: Which columns of which tables are recorded; None records everything.
Wanted = Mapping[str, Collection[str]] | None


@dataclass(frozen=True)
class Shared:
    """What runs in lock step recorded together: by table, columns in order of ``replica``."""

    tables: dict[str, Columns]
    replicas: int
    failure_counts: FailuresByRun


@dataclass(frozen=True)
class Recorded:
    """What one run recorded: its tables, its duration and how often blocks failed.

    `report` returns the sections that blocks add to the summary; `ended_early` says whether a block
    ended the run before its time; `shared` is the recording of which the tables of this `number`
    are a part, and says what blocks could not do; of a run by itself `failure_counts` does.
    """

    tables: dict[str, Columns]
    ticks_per_s: int
    duration_s: float
    report: Callable[[], dict[str, Any]]
    ended_early: bool = False
    shared: Shared | None = None
    number: int = 0
    failure_counts: FailureCounts = field(default_factory=dict)


@dataclass(frozen=True)
class Failed:
    """Why a run gave no result."""

    error: str


def run_replicas(
    scene: Scene,
    replicas: Sequence[Replica],
    *,
    wanted: Wanted = None,
    runs: int | None = None,
    most: int | None = None,
) -> list[Recorded | Failed]:
    """Run replicas, in lock step if possible; return recordings or failures that stop no other.

    `wanted` columns are recorded, by default all; `runs` is how many there are of the scene, where
    these are some of them. At most so many as `most` run together, by default those that memory
    holds. What is returned is in the order of `replicas`, and each is identical to
    a run of its own.
    """
    failed, scenes = _failures_and_valid_scenes(scene, replicas)
    ran: list[Recorded | Failed] = []
    runs = len(replicas) if runs is None else runs
    for part in _split_by_memory(scenes, wanted, most):
        together: Sequence[Recorded | Failed] | None = _run_together(part, wanted, runs)
        ran += together or [_run_alone(one, wanted, runs) for one in part]
    outcomes = iter(ran)
    return [next(outcomes) if one is None else one for one in failed]


def _failures_and_valid_scenes(
    scene: Scene, replicas: Sequence[Replica]
) -> tuple[list[Recorded | Failed | None], Sequence[Scene]]:
    """Return `Failed` per invalid replica, None for others, and the scenes of those others."""
    together = scenes_from_drawn_columns(scene, replicas)
    if together is not None:
        return [None] * len(replicas), together
    failed: list[Recorded | Failed | None] = []
    scenes: list[Scene] = []
    for replica in replicas:
        try:
            scenes.append(replica_scene(scene, replica))
            failed.append(None)
        except SceneError as error:
            failed.append(Failed(str(error)))
    return failed, scenes


def _split_by_memory(
    scenes: Sequence[Scene], wanted: Wanted, most: int | None
) -> Iterator[Sequence[Scene]]:
    """Yield the scenes in consecutive parts that fit into memory together."""
    if most is None:
        together = len(scenes) < 2 or surely_fit_in_memory(scenes[0], len(scenes))
        most = (
            max(1, len(scenes))
            if together
            else RunSize.estimate(scenes[0], wanted or {}).largest_run_count
        )
    for start in range(0, len(scenes), most):
        yield scenes[start : start + most]


def reason_against_lock_step(scene: Scene, replicas: Sequence[Replica]) -> str | None:
    """Return why replicas cannot run in lock step, as far as a trial setup shows it; else None."""
    try:
        together = Replicas(replica_scenes(scene, replicas))
        Simulation(together.scene, timeline=together)
        together.rehearse()
    except NotInLockStep as reason:
        return str(reason)
    except (SceneError, BlockFailure):  # a failing replica says so itself
        return None
    return None


def _run_together(scenes: Sequence[Scene], wanted: Wanted, runs: int) -> list[Recorded] | None:
    """Run scenes in lock step and return recordings; None if it is impossible or one fails."""
    if len(scenes) < 2:
        return None
    sink = ColumnSink()
    recorder = Recorder([sink], wanted=wanted, runs=runs)
    try:
        simulation = make_lockstep_simulation(scenes, recorder=recorder)
        outcome = simulation.run()
    except (NotInLockStep, SceneError, BlockFailure):
        return None
    shared = Shared(sink.tables(), len(scenes), outcome.failures_by_run)
    recorder.sinks.clear()  # what ran refers to itself, and would keep the rows for long
    parts = _split_by_replica(shared.tables, len(scenes))
    ended = simulation.runs.ended_by
    durations_s = [
        int(tick) / simulation.ticks_per_s if n in ended else outcome.duration_s
        for n, tick in enumerate(simulation.runs.ends)
    ]
    return [
        Recorded(
            tables,
            simulation.ticks_per_s,
            duration_s,
            partial(_report_of_single_run, scenes, n),
            n in ended,
            shared,
            n,
        )
        for n, (tables, duration_s) in enumerate(zip(parts, durations_s, strict=True))
    ]


def _split_by_replica(tables: dict[str, Columns], count: int) -> list[dict[str, Columns]]:
    """Return each run's tables, cut out of a common recording sorted by replica."""
    parts: list[dict[str, Columns]] = [{} for _ in range(count)]
    for table, columns in tables.items():
        starts = np.searchsorted(columns["replica"], np.arange(count + 1)).tolist()  # type: ignore[arg-type]
        own = {name: values for name, values in columns.items() if name != "replica"}
        for number, part in enumerate(parts):
            part[table] = slice_columns(own, slice(starts[number], starts[number + 1]))
    return parts


def _report_of_single_run(scenes: Sequence[Scene], number: int) -> dict[str, Any]:
    return Simulation(scenes[number]).run().report


def _run_alone(scene: Scene, wanted: Wanted, runs: int) -> Recorded | Failed:
    try:
        sink = ColumnSink()
        simulation = Simulation(scene, recorder=Recorder([sink], wanted=wanted, runs=runs))
        outcome = simulation.run()
    except (SceneError, BlockFailure) as error:
        return Failed(str(error))
    return Recorded(
        sink.tables(), simulation.ticks_per_s, outcome.duration_s, lambda: outcome.report,
        simulation.runs.early, failure_counts=outcome.failure_counts,
    )  # fmt: skip


def failure_counts_of_runs(outcomes: Iterable[Recorded | Failed]) -> FailureCounts:
    """Return all runs' failure counts, summed: block → what was missing → (failures, cases)."""
    parts: list[FailureCounts] = []
    together: dict[int, tuple[Shared, list[int]]] = {}
    for one in outcomes:
        if isinstance(one, Recorded):
            parts.append(one.failure_counts)
            if (shared := one.shared) is not None:
                together.setdefault(id(shared), (shared, []))[1].append(one.number)
    return sum_failure_counts(
        [
            *parts,
            *(
                sum_counts_over_runs(shared.failure_counts, runs)
                for shared, runs in together.values()
            ),
        ]
    )
