"""Running chunks of a study: from cells and replicas to the bytes of a Parquet file of each.

They are a pure function of the study and the chunk; whichever worker runs it, when, and with which
others, the bytes are the same. Runs of one cell share lock steps whichever chunk they are of: a
chunk is what is written at once, and a lock step what memory holds.
"""

import gc
import json
import math
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from itertools import groupby
from operator import itemgetter
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from dsa_des.arrays.column_values import Text
from dsa_des.arrays.types import AnyArray, IntArray
from dsa_des.block.foreign_calls import error_text_with_type, is_stop_request
from dsa_des.errors import BlockFailure, SceneError
from dsa_des.files.sealed_files import sealable_parquet
from dsa_des.record.failure_counts import FailureCounts, sum_failure_counts
from dsa_des.replicas.changed_scene import Replica, replica_scene
from dsa_des.replicas.lock_step_size import FEW, MOST_BYTES, RunSize, surely_fit_in_memory
from dsa_des.replicas.replicas import Failed, Recorded, failure_counts_of_runs, run_replicas
from dsa_des.results.folder import failure_counts_of_part
from dsa_des.results.record import (
    CRASHED,
    DONE,
    FAILED,
    STANDS_FOR,
    draw_column,
    part_schema,
)
from dsa_des.scene.scene import Scene
from dsa_des.studies.allocation import Allocation
from dsa_des.studies.foreseen_runs import (
    geometry_names,
    predict_results_and_errors,
    sample_weights_and_predictions,
)
from dsa_des.studies.metric import Group, Metric, measure_one_by_one, missing_values, needed_columns
from dsa_des.studies.splitting import Nearness, SplitEvent, run_splitting_repetitions
from dsa_des.studies.study import Chunk, Study, format_set_value

#: After so many runs at once a worker looks for garbage, or the next ones stand beside it: blocks
#: know each other in circles, 80 MB of 500 runs.
_MANY_RUNS = 64
# New objects after which Python looks for garbage: the usual 700 take 4 % of a lock step.
_OBJECTS_AT_ONCE = 50_000


@dataclass(frozen=True)
class ChunkResult:
    """Name and counts of a chunk's runs, and the bytes of its part file until they are written.

    `failed` of them gave no result, and of those `crashed` because their process died.
    """

    name: str
    content: bytes
    runs: int
    failed: int
    crashed: int = 0
    #: What they took of the processor; in no file, for it is another each time.
    cpu_s: float = 0.0


def study_part_schema(study: Study) -> pa.Schema:
    """Return the Arrow schema of a study's part files."""
    scene = study.scene(0)
    metrics = [spec.build(scene) for spec in study.metrics]
    return part_schema(
        [(axis.column, axis.is_numeric) for axis in study.axes],
        [(draw_column(draw.key), draw.is_numeric) for draw in study.draws],
        [result for metric in metrics for result in metric.results()],
        geometry_names(metrics) if study.allocate else (),
    )


def run_chunk(study: Study, chunk: Chunk) -> ChunkResult:
    """Run a chunk and return its result; a failed run's row holds its error and repeat command."""
    (done,) = run_chunks(study, [chunk])
    return done


def run_chunks(study: Study, chunks: Sequence[Chunk]) -> list[ChunkResult]:
    """Run chunks of one round together and return their results, the same as if run alone."""
    with _delay_garbage_collection():
        return _run_chunks(study, chunks)


@contextmanager
def _delay_garbage_collection() -> Iterator[None]:
    """Make garbage collection rare inside the block, as objects of joint runs live to its end."""
    usual = gc.get_threshold()
    gc.set_threshold(max(usual[0], _OBJECTS_AT_ONCE) if usual[0] else 0, *usual[1:])
    try:
        yield
    finally:
        gc.set_threshold(*usual)


def _run_chunks(study: Study, chunks: Sequence[Chunk]) -> list[ChunkResult]:
    began_s = time.process_time()
    schema = study_part_schema(study)
    tables: list[list[pa.Table]] = [[] for _ in chunks]
    failure_counts: list[list[FailureCounts]] = [[] for _ in chunks]
    pieces = [
        (cell, k, start, end) for k, one in enumerate(chunks) for cell, start, end in one.runs
    ]
    for cell, of_cell in groupby(pieces, key=itemgetter(0)):
        mine = list(of_cell)
        numbers = [number for _, _, start, end in mine for number in range(start, end)]
        of = np.repeat([k for _, k, _, _ in mine], [end - start for *_, start, end in mine])
        plan = chunks[mine[0][1]].plans.get(cell)
        rows = _run_cell(study, schema, cell, numbers, plan, of, failure_counts)
        begin = 0
        for _, k, start, end in mine:
            tables[k].append(rows.slice(begin, end - start))
            begin += end - start
    done = [
        make_chunk_result(chunk.name, pa.concat_tables(parts), sum_failure_counts(said))
        for chunk, parts, said in zip(chunks, tables, failure_counts, strict=True)
    ]
    runs = sum(map(len, chunks))
    if runs >= _MANY_RUNS:
        gc.collect()
    each_s = (time.process_time() - began_s) / runs
    return [replace(one, cpu_s=each_s * one.runs) for one in done]


def crashed_chunk_result(study: Study, chunk: Chunk, tries: int) -> ChunkResult:
    """Return the result of a chunk whose process always died: a row with this error per run."""
    schema = study_part_schema(study)
    tables = []
    for cell, start, end in chunk.runs:
        rows = _run_identity_columns(study, cell, range(start, end))
        rows["error"] = [f"the process that ran it died, {tries} times"] * (end - start)
        rows["status"] = [CRASHED] * (end - start)
        tables.append(_chunk_table(study, schema, cell, rows, {}))
    return make_chunk_result(chunk.name, pa.concat_tables(tables), {})


def make_chunk_result(name: str, table: pa.Table, counts: FailureCounts) -> ChunkResult:
    """Return a chunk's result from the table of its rows and its blocks' failure counts."""
    table = table.combine_chunks()
    status = table["status"].to_pylist()
    failed = len(status) - status.count(DONE)
    about = json.dumps(counts).encode() if counts else b""
    return ChunkResult(
        name, sealable_parquet(table, about), table.num_rows, failed, status.count(CRASHED)
    )


def join_chunk_results(name: str, parts: Sequence[ChunkResult]) -> ChunkResult:
    """Return the results of parts of a chunk as one, in order of cell and replica."""
    tables = [pq.read_table(pa.BufferReader(part.content)) for part in parts]
    failure_counts = sum_failure_counts(map(failure_counts_of_part, tables))
    rows = pa.concat_tables([table.replace_schema_metadata(None) for table in tables])
    done = make_chunk_result(
        name, rows.sort_by([("cell", "ascending"), ("replica", "ascending")]), failure_counts
    )
    return replace(done, cpu_s=sum(part.cpu_s for part in parts))


def _run_identity_columns(study: Study, cell: int, numbers: Sequence[int]) -> dict[str, list[Any]]:
    replicas = [study.replica(number, cell) for number in numbers]
    rows: dict[str, list[Any]] = {
        "cell": [cell] * len(numbers),
        "replica": list(numbers),
        "seed": [replica.seed for replica in replicas],
        "error": [None] * len(numbers),
    }
    labels = study.labels(cell)
    for axis in study.axes:
        label = labels[axis.column]
        rows[axis.column] = [label if axis.is_numeric else str(label)] * len(numbers)
    for draw in study.draws:
        values = [replica.changes[draw.key] for replica in replicas]
        rows[draw_column(draw.key)] = [
            float(v) if draw.is_numeric else format_set_value(v) for v in values
        ]
    return rows


def _chunk_table(
    study: Study,
    schema: pa.Schema,
    cell: int,
    rows: dict[str, list[Any]],
    values: Mapping[str, AnyArray],
) -> pa.Table:
    count = len(rows["cell"])
    if "status" not in rows:
        rows["status"] = [DONE if error is None else FAILED for error in rows["error"]]
    rows["command"] = [
        None if error is None else study.command(cell, number)
        for error, number in zip(rows["error"], rows["replica"], strict=True)
    ]
    arrays = []
    for field in schema:
        if field.name in rows:
            arrays.append(pa.array(rows[field.name], type=field.type))
        else:
            column = values.get(field.name, missing_values(count, text=field.type == pa.string()))
            arrays.append(pa.array(column, type=field.type, from_pandas=True))
    return pa.Table.from_arrays(arrays, schema=schema)


def _run_cell(
    study: Study,
    schema: pa.Schema,
    cell: int,
    numbers: Sequence[int],
    plan: Allocation | None,
    of: IntArray,
    failure_counts: Sequence[list[FailureCounts]],
) -> pa.Table:
    """Run a cell's replicas, or those that a plan draws; return a table with a row for each.

    What blocks could not do is put to `failure_counts` of the chunk that each replica is `of`.
    """
    rows = _run_identity_columns(study, cell, numbers)
    try:
        scene = study.scene(cell)
        metrics = [spec.build(scene) for spec in study.metrics]
    except (SceneError, ValueError) as error:
        rows["error"] = [str(error)] * len(numbers)
        return _chunk_table(study, schema, cell, rows, {})
    replicas = [study.replica(number, cell) for number in numbers]
    key = str(study.path), cell
    if isinstance(metrics[0], SplitEvent):
        assert study.splitting is not None

        def measure(
            nearness: Nearness, runs: Sequence[Replica], number: IntArray
        ) -> tuple[dict[str, AnyArray], list[str | None]]:
            wrong: list[str | None] = [None] * len(runs)
            chunk_of, said = (
                np.append(of, len(failure_counts)),
                [*failure_counts, []],
            )  # that of the pilot is lost
            if len(runs) >= _MANY_RUNS:  # those of the stage before
                gc.collect()
            return _run_and_measure_replicas(
                scene, [nearness], runs, wrong, key, chunk_of[number], said
            ), wrong

        rows["error"], values = run_splitting_repetitions(
            study.splitting, metrics[0], numbers,
            lambda number: study.first_runs_of_repetition(number, cell),
            measure, known=repr((study.tables, study.base.data, study.seed, study.sets,
                                 study.swaps, cell)),
        )  # fmt: skip
        return _chunk_table(study, schema, cell, rows, values)
    if not study.allocate:
        values = _run_and_measure_replicas(
            scene, metrics, replicas, rows["error"], key, of, failure_counts
        )
        return _chunk_table(study, schema, cell, rows, values)
    known, errors = predict_results_and_errors(scene, metrics, replicas)
    for k, text in errors.items():
        rows["error"][k] = text
    results = [result for metric in metrics for result in metric.results()]
    shares, predicted = sample_weights_and_predictions(study, cell, numbers, plan, results, known)
    these = [k for k in np.flatnonzero(shares).tolist() if k not in errors]
    wrong: list[str | None] = [None] * len(these)
    some = [replicas[k] for k in these]
    flown = _run_and_measure_replicas(scene, metrics, some, wrong, key, of[these], failure_counts)
    for k, said in zip(these, wrong, strict=True):
        rows["error"][k] = said
    values = {}
    for name, column in flown.items():
        values[name] = missing_values(len(numbers), text=column.dtype == object)
        values[name][these] = column
    return _chunk_table(
        study, schema, cell, rows, values | known | predicted | {STANDS_FOR: shares}
    )


def _run_and_measure_replicas(
    scene: Scene,
    metrics: Sequence[Metric],
    replicas: Sequence[Replica],
    errors: list[str | None],
    key: tuple[str, int],
    of: IntArray,
    failure_counts: Sequence[list[FailureCounts]],
) -> dict[str, AnyArray]:
    """Run replicas, compute the metrics of each, and return result → values over the replicas.

    What went wrong is put among `errors`, what blocks could not do to its chunk's counts.
    """
    values: dict[str, AnyArray] = {}
    done, wanted = 0, needed_columns(metrics)
    if len(_size_of_a_run) > _MOST_KNOWN:
        _size_of_a_run.clear()
    if key not in _size_of_a_run and not surely_fit_in_memory(scene, len(replicas)):
        _size_of_a_run[key] = _expected_run_size(scene, replicas[0], wanted)
    while done < len(replicas):
        # What runs together is measured together: of what blocks make for a batch nothing is made
        # again for the metrics, however many runs the chunk holds.
        size = _size_of_a_run.get(key)
        most = len(replicas) if size is None else size.largest_run_count
        left = len(replicas) - done
        many = math.ceil(left / math.ceil(left / most))
        part = replicas[done : done + many]
        if done and many >= _MANY_RUNS:
            gc.collect()
        outcomes = _run_and_catch_failures(scene, part, wanted)
        for chunk in np.unique(of[done : done + many]).tolist():
            mine = np.flatnonzero(of[done : done + many] == chunk)
            failure_counts[chunk].append(failure_counts_of_runs(outcomes[k] for k in mine))
        recorded = [outcome for outcome in outcomes if isinstance(outcome, Recorded)]
        if recorded and size is not None:
            each = sum(map(_recorded_bytes, recorded)) / len(recorded)
            _size_of_a_run[key] = replace(size, recorded=each)
        good = [k for k, outcome in enumerate(outcomes) if isinstance(outcome, Recorded)]
        for k, outcome in enumerate(outcomes):
            if isinstance(outcome, Failed):
                errors[done + k] = outcome.error
        result, wrong = _measure_metrics(scene, metrics, [(part[k], outcomes[k]) for k in good])
        for name, column in result.items():
            nothing = missing_values(len(replicas), text=column.dtype == object)
            values.setdefault(name, nothing)[done + np.array(good)] = column
        for k, text in wrong.items():
            errors[done + good[k]] = text
        done += len(part)
        del outcomes, recorded
    return values


def _expected_run_size(scene: Scene, replica: Replica, wanted: Mapping[str, Any]) -> RunSize:
    """Return a run's likely memory size before any has run, or a cautious guess if that fails."""
    try:
        return RunSize.estimate(replica_scene(scene, replica), wanted)
    except (SceneError, BlockFailure):  # its row says why
        return RunSize(MOST_BYTES / FEW)


_MOST_KNOWN = 1000
#: By study and cell; what is recorded, from the runs before. It changes no result.
_size_of_a_run: dict[tuple[str, int], RunSize] = {}


def _recorded_bytes(run: Recorded) -> int:
    columns = [column for table in run.tables.values() for column in table.values()]
    return sum(c.codes.nbytes if isinstance(c, Text) else c.nbytes for c in columns)


def _run_and_catch_failures(
    scene: Scene, replicas: Sequence[Replica], wanted: Mapping[str, Any]
) -> list[Recorded | Failed]:
    """Run replicas and return their records or `Failed`; after an error all run one by one."""
    try:
        return run_replicas(scene, replicas, wanted=wanted, most=len(replicas))
    except (Exception, SystemExit) as error:  # a block that wants to leave does not end the study
        if len(replicas) == 1:
            return [Failed(f"{type(error).__name__}: {error}")]
    return [_run_and_catch_failures(scene, [replica], wanted)[0] for replica in replicas]


def _measure_metrics(
    scene: Scene, metrics: Sequence[Metric], runs: Sequence[tuple[Replica, Any]]
) -> tuple[dict[str, AnyArray], dict[int, str]]:
    """Return result → values over the runs, and run index → error for the runs without values."""
    if not runs:
        return {}, {}
    group = Group(
        scene, [replica for replica, _ in runs], [run for _, run in runs], needed_columns(metrics)
    )
    values: dict[str, AnyArray] = {}
    for metric in metrics:
        try:
            values.update(metric.measure(group))
        except BaseException as error:
            if is_stop_request(error):
                raise
            if len(runs) == 1:
                return {}, {0: f"metric {type(metric).__name__}: {error_text_with_type(error)}"}
            return measure_one_by_one(partial(_measure_metrics, scene, metrics), runs)
    return values, {}
