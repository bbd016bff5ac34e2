"""Running a study: rounds of chunks, parts on disk, and stopping where results are good enough."""

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from dsa_des.errors import SceneError, UsageError
from dsa_des.replicas.changed_scene import replica_scene
from dsa_des.replicas.replicas import reason_against_lock_step
from dsa_des.results.folder import NotWritten, StudyFolder
from dsa_des.results.record import CRASHED
from dsa_des.results.rows import Rows, StoredRows
from dsa_des.results.tables import Expected, Tables
from dsa_des.studies.chunk import ChunkResult, join_chunk_results, make_chunk_result
from dsa_des.studies.executors import Executor
from dsa_des.studies.foreseen_runs import allocations_of_round
from dsa_des.studies.study import Chunk, Study
from dsa_des.studies.study_digest import record_of, result_columns_of_study, write_explained


@dataclass
class Progress:
    """How many runs of a study there are, and how many are done, failed or crashed."""

    runs: int = 0
    #: Without result; of these `crashed` because their process died.
    failed: int = 0
    crashed: int = 0
    total: int = 0


class Stopped(Exception):
    """A study was interrupted, or its results could not be written; it can be resumed."""


def study_lock_step_refusal(study: Study) -> str | None:
    """Return why the first or last cell's replicas cannot run in lock step; None if they can."""
    if study.replicas < 2:
        return None
    for cell in sorted({0, len(study.cells) - 1}):
        replicas = [study.replica(number, cell) for number in range(2)]
        try:
            reason = reason_against_lock_step(study.scene(cell), replicas)
        except SceneError:  # its rows say so
            continue
        if reason is not None:
            return reason
    return None


def run_study(
    study: Study,
    folder: StudyFolder,
    executor: Executor,
    report: Callable[[Progress], None] = lambda progress: None,
) -> Progress:
    """Run all runs that a study's folder lacks, call `report` after each chunk, return counts."""
    progress = Progress(total=len(study.cells) * study.replicas)
    cells = list(study.cells)
    starts = [0, *study.round_ends[:-1]]
    try:
        write_explained(study, folder)
    except OSError as error:
        raise Stopped(f"results cannot be written: {error.strerror or error}") from error
    try:
        for number, first in enumerate(starts):
            if number and study.stop_when is not None:
                satisfied = _satisfied_cells(study, folder, number)
                left = [cell for cell in cells if cell not in satisfied]
                done_with = len(cells) - len(left)
                progress.total -= done_with * (study.replicas - first)
                cells = left
            plans = allocations_of_round(study, folder, number, first, cells)
            chunks = list(study.chunks(number, cells, plans))
            _run_round(study, folder, executor, chunks, number, report, progress)
        _remove_rounds_from(folder, len(starts))
    except KeyboardInterrupt:
        raise Stopped("interrupted") from None
    return progress


def _run_round(
    study: Study,
    folder: StudyFolder,
    executor: Executor,
    chunks: list[Chunk],
    number: int,
    report: Callable[[Progress], None],
    progress: Progress,
) -> None:
    """Run what a round lacks: parts that are missing, and runs whose process crashed."""
    planned = {chunk.name for chunk in chunks}
    for name in folder.part_names():  # of a round that other cells took part in
        if _round_number(name) == number and name not in planned and folder.part(name) is not None:
            folder.remove_part(name)
    missing: list[Chunk] = []
    kept: dict[str, ChunkResult] = {}
    for chunk in chunks:
        rows = folder.part(chunk.name)
        if rows is None or not _has_runs_of_chunk(rows, chunk):
            missing.append(chunk)
            continue
        failure_counts = folder.failure_counts([chunk.name])
        there = make_chunk_result(chunk.name, rows, failure_counts)
        progress.failed += there.failed - there.crashed
        progress.runs += there.runs - there.crashed
        if there.crashed:
            crashed = np.asarray(pc.equal(rows["status"], CRASHED))
            missing.append(
                replace(chunk, runs=_run_ranges_in_rows(rows.filter(crashed)), whole=False)
            )
            if there.crashed < there.runs:
                kept[chunk.name] = make_chunk_result(
                    chunk.name, rows.filter(~crashed), failure_counts
                )
    report(progress)
    try:
        for done in executor.run(study, folder.parts_destination, missing):
            whole = (
                join_chunk_results(done.name, [kept[done.name], done])
                if done.name in kept
                else done
            )
            if whole.content:
                folder.parts_destination.write(whole.name, whole.content)
            progress.runs += done.runs
            progress.failed += done.failed
            progress.crashed += done.crashed
            report(progress)
    except NotWritten as error:
        raise Stopped(f"results cannot be written: {error}") from error


def _round_number(name: str) -> int:
    return int(name.split("-")[1])


def _remove_rounds_from(folder: StudyFolder, first: int) -> None:
    """Remove the study's parts of round `first` and of all later rounds."""
    for name in folder.part_names():
        if _round_number(name) >= first and folder.part(name) is not None:
            folder.remove_part(name)


def _has_runs_of_chunk(rows: pa.Table, chunk: Chunk) -> bool:
    wanted = [np.arange(start, end) for _, start, end in chunk.runs]
    cells = np.repeat([cell for cell, _, _ in chunk.runs], [len(one) for one in wanted])
    return bool(
        np.array_equal(rows["cell"].to_numpy(), cells)
        and np.array_equal(rows["replica"].to_numpy(), np.concatenate(wanted))
    )


def _run_ranges_in_rows(rows: pa.Table) -> tuple[tuple[int, int, int], ...]:
    runs: list[tuple[int, int, int]] = []
    for cell, replica in zip(rows["cell"].to_pylist(), rows["replica"].to_pylist(), strict=True):
        if runs and runs[-1][0] == cell and runs[-1][2] == replica:
            runs[-1] = (cell, runs[-1][1], replica + 1)
        else:
            runs.append((cell, replica, replica + 1))
    return tuple(runs)


def _satisfied_cells(study: Study, folder: StudyFolder, number: int) -> set[int]:
    """Return the cells with a narrow enough confidence interval after rounds before `number`."""
    stop = study.stop_when
    assert stop is not None
    result = next(item for item in result_columns_of_study(study) if item.name == stop.metric)
    # What a killed attempt left of later rounds must not decide: it would not have been there.
    rows = Rows(StoredRows(folder, before_round=number), ["cell"], [])
    matches = set()
    for (cell,), chosen in rows.row_indices_by_axis_values():
        estimate, _ = rows.estimate(result, chosen, study.confidence, study.interval)
        if not np.isnan(estimate.half_width) and estimate.half_width <= stop.half_width:
            matches.add(int(cell))
    return matches


#: Replicas whose random draws an analytic answer is averaged over.
_EXPECTED_OVER = 64


def result_tables_of_study(study: Study, folder: StudyFolder) -> Tables:
    """Return the tables of a study's results, with the analytic answers of its scenes."""
    return Tables(record_of(study), folder, _mean_analytic_answers(study))


def _mean_analytic_answers(study: Study) -> Expected:
    """Return (result, axis values) → analytic answer, averaged over draws and encounters."""
    sums: dict[tuple[str, tuple[Any, ...]], list[float]] = {}
    many = min(study.replicas, _EXPECTED_OVER) if study.draws else 1
    for cell in study.cells:
        labels = study.labels(cell)
        at = tuple(
            float(labels[axis.column]) if axis.is_numeric else str(labels[axis.column])
            for axis in study.axes
            if axis.column not in study.over
        )
        try:
            scene = study.scene(cell)
            metrics = [spec.build(scene) for spec in study.metrics]
            for number in range(many):
                own = replica_scene(scene, study.replica(number, cell))
                for metric in metrics:
                    for name, value in metric.analytic_answers(own).items():
                        sums.setdefault((name, at), []).append(value)
        except (SceneError, ValueError):
            continue
        if not sums:  # no metric of this study knows any
            return {}
    return {key: sum(values) / len(values) for key, values in sums.items()}


def rerun_and_draw_replica(
    study: Study, folder: StudyFolder, cell: int, replica: int
) -> list[Path]:
    """Run one replica of a cell again and draw it as ``dsa-des run`` does."""
    from dsa_des.running.recorded_run import record_run

    if cell >= len(study.cells) or replica >= study.replicas:
        return []
    scene = replica_scene(study.scene(cell), study.replica(replica, cell))
    target = folder.path / f"run-cell-{cell}-replica-{replica}"
    if target.is_symlink():
        raise UsageError(f"{target}: is a link; the figures of a run are in a folder")
    record_run(scene, target)
    return sorted(target.glob("*.png"))


class Clock:
    """Measures the rate and the time left of a study that is running."""

    def __init__(self) -> None:
        self._started = time.monotonic()
        self._already: int | None = None

    def progress_text(self, progress: Progress) -> str:
        """Return ``1200 of 10000 runs, 310/s, 28 s left, 2 failed``."""
        if self._already is None:
            self._already = progress.runs
        spent = time.monotonic() - self._started
        done = progress.runs - self._already
        words = [f"{progress.runs} of {progress.total} runs"]
        if done and spent > 0:
            rate = done / spent
            left = (progress.total - progress.runs) / rate
            words += [f"{rate:.3g}/s", f"{left:.0f} s left"]
        if progress.failed:
            words.append(f"{progress.failed} failed")
        if progress.crashed:
            words.append(f"{progress.crashed} of them crashed")
        return ", ".join(words)
