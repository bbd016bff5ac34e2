"""Running one chunk of a study: from cells and replicas to the bytes of one Parquet file.

It is a pure function of the study and the chunk; whoever runs it, where and when, the bytes are
the same.
"""

import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from dsa_des.errors import SceneError
from dsa_des.replicas import Failed, Recorded, Replica, run_replicas
from dsa_des.scene import Scene
from dsa_des.strangers import is_ours_to_obey, told
from dsa_des.studies.metric import SHARE, TRIALS, Group, Metric, wanted_by
from dsa_des.studies.study import Chunk, Study
from dsa_des.types import FloatArray


@dataclass(frozen=True)
class Done:
    """The result of a chunk: the bytes of its part, how many runs it holds, how many failed."""

    name: str
    content: bytes
    runs: int
    failed: int


def schema_of(study: Study) -> pa.Schema:
    """Return the columns of a study's parts."""
    scene = study.scene(0)
    metrics = [spec.build(scene) for spec in study.metrics]
    fields = [("cell", pa.int64()), ("replica", pa.int64()), ("seed", pa.int64())]
    fields += [(a.column, pa.float64() if a.numeric else pa.string()) for a in study.axes]
    for draw in study.draws:
        numeric = not any(isinstance(value, str) for value in draw.values)
        column = draw_column(draw.key)
        fields.append((column, pa.float64() if numeric else pa.string()))
    for metric in metrics:
        for result in metric.results():
            fields.append((result.name, pa.float64()))
            if result.kind == SHARE:
                fields.append((result.name + TRIALS, pa.float64()))
    fields += [("error", pa.string()), ("command", pa.string())]
    return pa.schema(fields)


def draw_column(key: str) -> str:
    """Return the column of a drawn value."""
    return f"draw.{key.removeprefix('blocks.')}"


def run_chunk(study: Study, chunk: Chunk) -> Done:
    """Run a chunk; a run that fails is a row with its error and the command that repeats it."""
    schema = schema_of(study)
    tables = [_run_cell(study, schema, *part) for part in chunk.runs]
    table = pa.concat_tables(tables).combine_chunks()
    return Done(chunk.name, _parquet(table), table.num_rows, _failed(table))


def failed_chunk(study: Study, chunk: Chunk, error: str) -> Done:
    """Return the part of a chunk that nobody could run: every run of it failed with `error`."""
    schema = schema_of(study)
    tables = []
    for cell, start, end in chunk.runs:
        rows = _leading(study, cell, range(start, end))
        rows["error"] = [error] * (end - start)
        tables.append(_table(study, schema, cell, rows, {}))
    table = pa.concat_tables(tables).combine_chunks()
    return Done(chunk.name, _parquet(table), table.num_rows, table.num_rows)


def _parquet(table: pa.Table) -> bytes:
    buffer = io.BytesIO()
    pq.write_table(table, buffer, compression="zstd")
    return buffer.getvalue()


def _failed(table: pa.Table) -> int:
    return table.num_rows - int(table["error"].null_count)


def _leading(study: Study, cell: int, numbers: Sequence[int]) -> dict[str, list[Any]]:
    replicas = [study.replica(number) for number in numbers]
    rows: dict[str, list[Any]] = {
        "cell": [cell] * len(numbers),
        "replica": list(numbers),
        "seed": [replica.seed for replica in replicas],
        "error": [None] * len(numbers),
    }
    labels = study.labels(cell)
    for axis in study.axes:
        label = labels[axis.column]
        rows[axis.column] = [label if axis.numeric else str(label)] * len(numbers)
    for draw in study.draws:
        values = [replica.changes[draw.key] for replica in replicas]
        text = any(isinstance(value, str) for value in draw.values)
        rows[draw_column(draw.key)] = [str(v) if text else float(v) for v in values]
    return rows


def _table(
    study: Study,
    schema: pa.Schema,
    cell: int,
    rows: dict[str, list[Any]],
    values: Mapping[str, FloatArray],
) -> pa.Table:
    count = len(rows["cell"])
    rows["command"] = [
        None if error is None else study.command(cell, number)
        for error, number in zip(rows["error"], rows["replica"], strict=True)
    ]
    arrays = []
    for field in schema:
        if field.name in rows:
            arrays.append(pa.array(rows[field.name], type=field.type))
        else:
            column = values.get(field.name, np.full(count, np.nan))
            arrays.append(pa.array(column, type=field.type, from_pandas=True))
    return pa.Table.from_arrays(arrays, schema=schema)


def _run_cell(study: Study, schema: pa.Schema, cell: int, start: int, end: int) -> pa.Table:
    numbers = range(start, end)
    rows = _leading(study, cell, numbers)
    try:
        scene = study.scene(cell)
        metrics = [spec.build(scene) for spec in study.metrics]
    except (SceneError, ValueError) as error:
        rows["error"] = [str(error)] * len(numbers)
        return _table(study, schema, cell, rows, {})
    replicas = [study.replica(number) for number in numbers]
    outcomes = run_replicas(scene, replicas, wanted=wanted_by(metrics))
    good = [k for k, outcome in enumerate(outcomes) if isinstance(outcome, Recorded)]
    for k, outcome in enumerate(outcomes):
        if isinstance(outcome, Failed):
            rows["error"][k] = outcome.error
    values: dict[str, FloatArray] = {}
    found, errors = _measured(scene, metrics, [(replicas[k], outcomes[k]) for k in good])
    for name, column in found.items():
        values[name] = np.full(len(numbers), np.nan)
        values[name][good] = column
    for k, text in errors.items():
        rows["error"][good[k]] = text
    return _table(study, schema, cell, rows, values)


def _measured(
    scene: Scene, metrics: Sequence[Metric], runs: Sequence[tuple[Replica, Any]]
) -> tuple[dict[str, FloatArray], dict[int, str]]:
    """Return result → values over the runs, and the error of every run that gave none."""
    if not runs:
        return {}, {}
    group = Group(
        scene, [replica for replica, _ in runs], [run for _, run in runs], wanted_by(metrics)
    )
    found: dict[str, FloatArray] = {}
    for metric in metrics:
        try:
            found.update(metric.measure(group))
        except BaseException as error:
            if is_ours_to_obey(error):
                raise
            if len(runs) == 1:
                return {}, {0: f"metric {type(metric).__name__}: {told(error)}"}
            return _one_by_one(scene, metrics, runs)
    return found, {}


def _one_by_one(
    scene: Scene, metrics: Sequence[Metric], runs: Sequence[tuple[Replica, Any]]
) -> tuple[dict[str, FloatArray], dict[int, str]]:
    """Measure each run by itself, so that one that breaks a metric leaves the others alone."""
    found: dict[str, FloatArray] = {}
    errors: dict[int, str] = {}
    for k, run in enumerate(runs):
        values, wrong = _measured(scene, metrics, [run])
        if wrong:
            errors[k] = wrong[0]
        for name, column in values.items():
            found.setdefault(name, np.full(len(runs), np.nan))[k] = column[0]
    return found, errors
