"""Tables with one row per encounter, read as columns (CSV or Parquet)."""

import csv
import io
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from components.encounters.encounter_set import LARGEST_WEIGHT
from dsa_des.arrays.types import AnyArray, BoolArray, FloatArray
from dsa_des.errors import UsageError, did_you_mean, shown_value
from dsa_des.files.input_files import (
    InputFileError,
    is_folder,
    read_input_bytes,
    read_input_text,
    resolve_home,
)

#: Names of a column that says which encounter a row is, for messages.
_NAMES = ("encounter", "encounter_id", "id")
_MOST = 20


@dataclass(frozen=True)
class EncounterTable:
    """Columns of texts, and where each row stands.

    Parameters
    ----------
    path : Path
    columns : dict of str to list
        Texts, or numbers where the file has types; None where a cell is empty.
    lines : list of int
        The line of each row in the file, from 1; for Parquet its row.
    """

    path: Path
    columns: dict[str, list[object]]
    lines: list[int]

    def column(self, name: str, option: str) -> list[object]:
        """Return a column, or raise UsageError with the nearest name."""
        if name not in self.columns:
            raise UsageError(
                f"{self.path}: {option} {name}: there is no such column"
                f"{did_you_mean(name, self.columns)}"
            )
        return self.columns[name]

    def place(self, row: int) -> str:
        """Return how a row is named in a message."""
        name = next((n for n in _NAMES if n in self.columns), None)
        told = f"encounter {self.columns[name][row]}" if name else f"encounter {row + 1}"
        return f"{told} (line {self.lines[row]})"


def read_table(text: str) -> EncounterTable:
    """Read a table by the name that a user wrote.

    Raises
    ------
    UsageError
        If it cannot be read, has no rows, or a row is cut short.
    """
    try:
        path = resolve_home(text)
        if is_folder(path):
            return _study(path)
        if path.suffix.lower() == ".parquet":
            return _parquet(path, read_input_bytes(path))
        content = read_input_text(path)
    except InputFileError as error:
        raise UsageError(f"{text}: {error}") from None
    reader = csv.reader(io.StringIO(content))
    try:
        rows = [(reader.line_num, row) for row in reader if any(cell.strip() for cell in row)]
    except csv.Error as error:
        raise UsageError(f"{path}: line {reader.line_num}: {error}") from None
    if len(rows) < 2:
        raise UsageError(f"{path}: a row of column names and one row per encounter are needed")
    names = [name.strip() for name in rows[0][1]]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise UsageError(f"{path}: line {rows[0][0]}: the column {twice!r} stands there twice")
    for line, row in rows[1:]:
        if len(row) != len(names):
            raise UsageError(
                f"{path}: line {line}: has {len(row)} values, but there are {len(names)} columns"
            )
    columns: dict[str, list[object]] = {
        name: [row[place].strip() or None for _, row in rows[1:]]
        for place, name in enumerate(names)
    }
    return EncounterTable(path, columns, [line for line, _ in rows[1:]])


def _study(path: Path) -> EncounterTable:
    """Return the runs of a study's folder; those without result are left out."""
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


def _parquet(path: Path, content: bytes) -> EncounterTable:
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


def numbers(
    table: EncounterTable, name: str, option: str, *, flag: bool
) -> tuple[FloatArray, dict[int, str]]:
    """Return a column as numbers, and row → what is wrong with it.

    Parameters
    ----------
    table : EncounterTable
    name, option : str
        The column, and the option that names it.
    flag : bool
        Whether it must be 0 or 1; otherwise a finite number of 0 or more.
    """
    cells = table.column(name, option)
    values = np.array([_number(cell) for cell in cells])
    with np.errstate(invalid="ignore"):
        zero_one = (values == 0.0) | (values == 1.0)
        good = zero_one if flag else (values >= 0.0) & (values <= LARGEST_WEIGHT)
    most = f"must be a number of 0 or more, {LARGEST_WEIGHT:g} at most"
    allowed = "must be 0 or 1" if flag else most
    wrong = {
        row: f"{name} is missing: {allowed}"
        if cells[row] is None
        else f"{name} = {shown_value(cells[row])}: {allowed}"
        for row in np.flatnonzero(~good).tolist()
    }
    return values, wrong


def _number(cell: object) -> float:
    if isinstance(cell, str):
        low = cell.lower()
        if low in ("true", "false"):
            return float(low == "true")
        try:
            return math.nan if "_" in cell else float(cell)
        except ValueError:
            return math.nan
    return float(cell) if isinstance(cell, int | float) else math.nan


def kept_rows(table: EncounterTable, wrong: Sequence[dict[int, str]], skip: bool) -> BoolArray:
    """Return which rows are good, or raise UsageError with what is wrong with the others.

    Parameters
    ----------
    table : EncounterTable
    wrong : sequence of dict
        Row → what is wrong with it.
    skip : bool
        Whether damaged rows are left out.
    """
    found: dict[int, list[str]] = {}
    for some in wrong:
        for row, said in some.items():
            found.setdefault(row, []).append(said)
    kept: AnyArray = np.ones(len(table.lines), dtype=np.bool_)
    kept[list(found)] = False
    if found and (not skip or not kept.any()):
        rows = sorted(found)
        lines = [f"{table.path}: {table.place(row)}: {'; '.join(found[row])}" for row in rows]
        more = [f"and {len(rows) - _MOST} more"] if len(rows) > _MOST else []
        raise UsageError(*lines[:_MOST], *more)
    return kept
