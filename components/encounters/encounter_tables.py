"""Tables with one row per encounter, and ``dsa-des encounters risk``: the risk ratio of one."""

import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from components.formats.encounter_set import LARGEST_WEIGHT
from components.formats.text_rows import csv_table
from components.metrics.risk import RiskRatio, risk_ratio, risk_ratios_by_class
from dsa_des.arrays.types import AnyArray, BoolArray, FloatArray
from dsa_des.errors import UsageError, did_you_mean, shortened_repr
from dsa_des.files.input_files import (
    InputFileError,
    is_folder,
    read_input_bytes,
    read_input_text,
    resolve_home,
)
from dsa_des.terminal.tables import print_table
from dsa_des.terminal.terminal import console, say, say_json

#: Names of a column that says which encounter a row is, for messages.
_NAMES = ("encounter", "encounter_id", "id")
_MOST = 20


@dataclass(frozen=True)
class EncounterTable:
    """Table columns, one row per encounter: texts, or numbers if the file has types; None if empty.

    `lines` says where each row stands in the file, from 1.
    """

    path: Path
    columns: dict[str, list[object]]
    lines: list[int]

    def column(self, name: str, option: str) -> list[object]:
        """Return a column's cells; UsageError, with option and nearest column, if missing."""
        if name not in self.columns:
            raise UsageError(
                f"{self.path}: {option} {name}: there is no such column"
                f"{did_you_mean(name, self.columns)}"
            )
        return self.columns[name]

    def row_name(self, row: int) -> str:
        """Return the words by which an error message names a row: its encounter and its line."""
        name = next((n for n in _NAMES if n in self.columns), None)
        name_of_row = f"encounter {self.columns[name][row]}" if name else f"encounter {row + 1}"
        return f"{name_of_row} (line {self.lines[row]})"


def read_table(text: str) -> EncounterTable:
    """Return a CSV or Parquet file's or study folder's table; UsageError if it cannot be used."""
    try:
        path = resolve_home(text)
        if is_folder(path):
            return _read_study(path)
        if path.suffix.lower() == ".parquet":
            return _read_parquet(path, read_input_bytes(path))
        content = read_input_text(path)
    except InputFileError as error:
        raise UsageError(f"{text}: {error}") from None
    names, some = csv_table(content, lambda said, line: UsageError(f"{path}: line {line}: {said}"))
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise UsageError(f"{path}: line 1: the column {twice!r} stands there twice")
    rows = list(some)
    if not rows:
        raise UsageError(f"{path}: a row of column names and one row per encounter are needed")
    columns: dict[str, list[object]] = {
        name: [row[index] or None for _, row in rows] for index, name in enumerate(names)
    }
    return EncounterTable(path, columns, [line for line, _ in rows])


def _read_study(path: Path) -> EncounterTable:
    """Return the runs of a study's folder as a table, without the runs that failed."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    parts = sorted((path / "parts").glob("*.parquet"))
    if not parts:
        raise UsageError(f"{path}: is no folder of a study: there are no parts in it")
    try:
        table = pa.concat_tables([pq.read_table(p) for p in parts], promote_options="default")
    except (pa.ArrowException, OSError) as error:
        raise UsageError(f"{path}: a part is no whole Parquet file: {error}") from None
    lines = list(range(1, table.num_rows + 1))
    if "error" in table.column_names:
        good = np.asarray(table["error"].is_null())
        table = table.filter(good)
        lines = (np.flatnonzero(good) + 1).tolist()
    if not lines:
        raise UsageError(f"{path}: no run of the study has a result")
    return EncounterTable(path, {n: table[n].to_pylist() for n in table.column_names}, lines)


def _read_parquet(path: Path, content: bytes) -> EncounterTable:
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        table = pq.read_table(pa.BufferReader(content))
    except (pa.ArrowException, OSError) as error:
        raise UsageError(f"{path}: is no whole Parquet file: {error}") from None
    if table.num_rows == 0:
        raise UsageError(f"{path}: holds no row")
    columns = {name: table[name].to_pylist() for name in table.column_names}
    return EncounterTable(path, columns, list(range(1, table.num_rows + 1)))


def numbers_and_errors(
    table: EncounterTable, name: str, option: str, *, flag: bool
) -> tuple[FloatArray, dict[int, str]]:
    """Return a column as numbers (flags 0 or 1, else at least 0), and the error of each bad row."""
    cells = table.column(name, option)
    values = np.array([_number_or_nan(cell) for cell in cells])
    with np.errstate(invalid="ignore"):
        zero_one = (values == 0.0) | (values == 1.0)
        good = zero_one if flag else (values >= 0.0) & (values <= LARGEST_WEIGHT)
    most = f"must be a number of 0 or more, {LARGEST_WEIGHT:g} at most"
    allowed = "must be 0 or 1" if flag else most
    wrong = {
        row: f"{name} is missing: {allowed}"
        if cells[row] is None
        else f"{name} = {shortened_repr(cells[row])}: {allowed}"
        for row in np.flatnonzero(~good).tolist()
    }
    return values, wrong


def _number_or_nan(cell: object) -> float:
    if isinstance(cell, str):
        low = cell.lower()
        if low in ("true", "false"):
            return float(low == "true")
        try:
            return math.nan if "_" in cell else float(cell)
        except ValueError:
            return math.nan
    return float(cell) if isinstance(cell, int | float) else math.nan


def select_good_rows(
    table: EncounterTable, wrong: Sequence[dict[int, str]], skip: bool
) -> BoolArray:
    """Return which rows have no error (mask); UsageError on others unless they may be skipped."""
    problems: dict[int, list[str]] = {}
    for some in wrong:
        for row, said in some.items():
            problems.setdefault(row, []).append(said)
    kept: AnyArray = np.ones(len(table.lines), dtype=np.bool_)
    kept[list(problems)] = False
    if problems and (not skip or not kept.any()):
        rows = sorted(problems)
        lines = [f"{table.path}: {table.row_name(row)}: {'; '.join(problems[row])}" for row in rows]
        more = [f"and {len(rows) - _MOST} more"] if len(rows) > _MOST else []
        raise UsageError(*lines[:_MOST], *more)
    return kept


_CLASSES = 200


def show_risk(
    table: str,
    nominal: str,
    mitigated: str,
    weight: str | None,
    cluster: str | None,
    by: str | None,
    edges: str | None,
    confidence: float,
    method: str,
    resamples: int,
    seed: int,
    skip_damaged: bool,
    as_json: bool,
) -> None:
    """Print the risk ratio of a table of encounters and, on request, of their classes."""
    if edges is not None and by is None:
        raise UsageError("--edges belongs to --by COLUMN: which column has these edges?")
    content = read_table(table)
    n, wrong_n = numbers_and_errors(content, nominal, "--nominal", flag=True)
    m, wrong_m = numbers_and_errors(content, mitigated, "--mitigated", flag=True)
    w, wrong_w = np.ones(len(n)), dict[int, str]()
    if weight is not None:
        w, wrong_w = numbers_and_errors(content, weight, "--weight", flag=False)
    together = None
    if cluster is not None:
        together = np.array([str(cell) for cell in content.column(cluster, "--cluster")])
    labels, wrong_by = _class_labels_and_errors(content, by, edges)
    kept = select_good_rows(content, [wrong_n, wrong_m, wrong_w, wrong_by], skip_damaged)
    n, m, w, labels = n[kept], m[kept], w[kept], labels[kept]
    together = None if together is None else together[kept]
    options: dict[str, Any] = {
        "confidence": confidence, "method": method, "resamples": resamples, "seed": seed,
    }  # fmt: skip
    whole = risk_ratio(n, m, w, cluster=together, **options)
    if whole.reason:
        raise UsageError(f"{content.path}: there is no risk ratio: {whole.reason}")
    classes = {}
    if by is not None:
        classes = risk_ratios_by_class(n, m, w, labels, together, **options)
    skipped = int((~kept).sum())
    if as_json:
        result: dict[str, Any] = {"skipped": skipped, "confidence": confidence, **asdict(whole)}
        if by is not None:
            result["classes"] = {name: asdict(one) for name, one in classes.items()}
        say_json(result)
        return
    for line in _risk_lines(whole, confidence, skipped):
        say(line)
    if by is not None:
        _show_classes(by, classes, confidence)


def _class_labels_and_errors(
    content: EncounterTable, by: str | None, edges: str | None
) -> tuple[AnyArray, dict[int, str]]:
    """Return each row's class label, and for each row without one the words on its error."""
    if by is None:
        return np.zeros(len(content.lines), dtype=np.int64), {}
    if edges is None:
        each = [content.column(name.strip(), "--by") for name in by.split(",")]
        labels = np.array(
            [", ".join("" if cell is None else str(cell) for cell in row)
             for row in zip(*each, strict=True)]
        )  # fmt: skip
        if len(np.unique(labels)) > _CLASSES:
            raise UsageError(
                f"{content.path}: --by {by}: has more than {_CLASSES} values; give the edges of "
                "classes, --edges A,B,..."
            )
        return labels, {}
    bounds = _parse_edges(edges)
    cells = content.column(by, "--by")
    values, wrong = np.full(len(cells), np.nan), {}
    for row, cell in enumerate(cells):
        try:
            values[row] = float(cell)  # type: ignore[arg-type]
        except (TypeError, ValueError):
            wrong[row] = f"{by} is no number"
    # Numbered, so that classes stand in the order of their edges.
    inner = (f"{low:g} to {high:g}" for low, high in pairwise(bounds))
    names = [f"below {bounds[0]:g}", *inner, f"{bounds[-1]:g} and above"]
    index = np.searchsorted(bounds, np.nan_to_num(values), side="right")
    width = len(str(len(names)))
    return np.array([f"{k + 1:0{width}d}: {name}" for k, name in enumerate(names)])[index], wrong


def _parse_edges(text: str) -> FloatArray:
    try:
        bounds = np.array([float(part) for part in text.split(",")])
    except ValueError:
        bounds = np.array([math.nan])
    if not np.isfinite(bounds).all() or (np.diff(bounds) <= 0).any():
        raise UsageError(f"--edges {text}: must be rising numbers with commas between them")
    return bounds


def _risk_lines(risk: RiskRatio, confidence: float, skipped: int) -> list[str]:
    alone = risk.clusters == risk.encounters
    clusters = "" if alone else f" in {risk.clusters} clusters"
    shown = _number_format(risk)
    low, high = map(shown, risk.interval)
    lines = [
        f"{risk.encounters} encounters{clusters}, {risk.nominal_events} with the event "
        f"nominally, {risk.mitigated_events} mitigated ({risk.induced_events} of them induced)",
        f"probability nominal       {shown(risk.nominal_probability)}",
        f"probability mitigated     {shown(risk.mitigated_probability)}",
        f"risk ratio                {shown(risk.ratio)}",
        f"  unresolved              {shown(risk.unresolved)}",
        f"  induced                 {shown(risk.induced)}",
        f"{f'{100 * confidence:g} % interval':<26}{low} to {high} ({risk.method})",
        f"standard error            {risk.standard_error:.3g} (paired)",
        f"  nominal taken as known  {risk.unpaired_error:.3g}",
        f"effective sample size     {risk.effective_sample_size:.2f}",
    ]
    if risk.few:
        lines.append("few: fewer than 20 mitigated events, in effect, carry the interval")
    if skipped:
        lines.append(f"{skipped} damaged encounters were skipped")
    return lines


def _number_format(risk: RiskRatio) -> Callable[[float], str]:
    """Return a function that formats three significant digits, more if the interval is narrow."""
    half = (risk.interval[1] - risk.interval[0]) / 2
    digits = 3
    if risk.ratio > 0 and half > 0:
        digits = max(digits, 2 + math.floor(math.log10(risk.ratio)) - math.floor(math.log10(half)))
    return lambda value: f"{value:.{digits}g}"


def _show_classes(by: str, classes: dict[str, RiskRatio], confidence: float) -> None:
    rows = []
    for name, one in classes.items():
        counts = [name or "(none)", str(one.encounters), str(one.nominal_events)]
        counts.append(str(one.mitigated_events))
        if one.reason:
            rows.append([*counts, "-", "-", "-", "-", one.reason])
            continue
        low, high = one.interval
        shown = _number_format(one)
        values = (one.ratio, one.unresolved, one.induced)
        interval = f"{shown(low)} to {shown(high)}"
        rows.append([*counts, *map(shown, values), interval, "few" if one.few else ""])
    headings = [by, "encounters", "nominal", "mitigated", "ratio", "unresolved", "induced",
                f"{100 * confidence:g} % interval", "note"]  # fmt: skip
    print_table(console(), "", headings, rows, right=range(1, 7), below=8)
