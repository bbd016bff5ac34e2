"""A recorded operator (``operator.recorded``) and the tables of its decisions."""

import csv
import io
import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError

from components.messages.decisions import CLIMB, KINDS, TURN, OperatorDecision
from components.operator.human import MOST_CLIMB_M, MOST_TURN_RAD, Console, ConsoleParameters
from dsa_des.block.component import ScenePath
from dsa_des.block.wake import Wake
from dsa_des.errors import did_you_mean
from dsa_des.files.input_files import InputFileError, read_input_bytes, read_input_text
from dsa_des.text.safe_text import escape_unprintable, shorten

_NAMES = ("time_s", "decision", "target", "turn_rad", "climb_m", "wall_time_s")
_MOST_PROBLEMS = 5


def _zero_if_empty(value: Any) -> Any:
    """Return 0.0 for an empty cell (None or an empty text), else the value."""
    return 0.0 if value is None or value == "" else value


def _nan_if_empty(value: Any) -> Any:
    return math.nan if value is None or value == "" else value


def _none_to_blank(value: Any) -> Any:
    return "" if value is None else value


class _DecisionRow(BaseModel):
    model_config = ConfigDict(extra="ignore")

    time_s: float = Field(ge=0, allow_inf_nan=False)
    decision: Literal["shown", "looked", "verified", "rejected", "turn", "climb"]
    target: Annotated[str, BeforeValidator(_none_to_blank)] = ""
    turn_rad: Annotated[
        float, BeforeValidator(_zero_if_empty), Field(ge=-MOST_TURN_RAD, le=MOST_TURN_RAD)
    ] = 0.0
    climb_m: Annotated[
        float, BeforeValidator(_zero_if_empty), Field(ge=-MOST_CLIMB_M, le=MOST_CLIMB_M)
    ] = 0.0
    wall_time_s: Annotated[float, BeforeValidator(_nan_if_empty)] = math.nan

    def to_decision(self) -> OperatorDecision:
        kind = KINDS.index(self.decision)
        turn_rad = self.turn_rad if kind == TURN else 0.0
        climb_m = self.climb_m if kind == CLIMB else 0.0
        return OperatorDecision(kind, self.target, turn_rad, climb_m, self.wall_time_s)


def read_decisions(path: Path) -> list[tuple[float, OperatorDecision]]:
    """Return the decisions of a table with their times, as (time in s, decision) in order.

    The path is a run's ``decisions.parquet``, its folder, or a CSV file with the columns ``time_s``
    and ``decision``, and where they are needed ``target``, ``turn_rad``, ``climb_m`` and
    ``wall_time_s``. Raises ValueError if it cannot be read, or a row holds what no operator can
    decide.
    """
    if path.is_dir():
        path = path / "decisions.parquet"
    try:
        rows = _read_parquet_rows(path) if path.suffix == ".parquet" else _read_csv_rows(path)
    except InputFileError as error:
        raise ValueError(f"{path}: {error}") from None
    result: list[tuple[float, OperatorDecision]] = []
    problems: list[str] = []
    for where, row in rows:
        try:
            read = _DecisionRow.model_validate(row)
        except ValidationError as error:
            problems += [
                _located_message(where, problem) for problem in error.errors(include_url=False)
            ]
            continue
        if result and read.time_s < result[-1][0]:
            problems.append(f"{where}: time_s is {read.time_s:g}: it must not go back")
        result.append((read.time_s, read.to_decision()))
    if problems:
        more = len(problems) - _MOST_PROBLEMS
        said = problems[:_MOST_PROBLEMS] + ([f"and {more} more"] if more > 0 else [])
        raise ValueError(f"{path}: " + "; ".join(said))
    return result


def _read_csv_rows(path: Path) -> Iterable[tuple[str, Mapping[str, Any]]]:
    reader = csv.DictReader(io.StringIO(read_input_text(path)))
    _check_names(path, reader.fieldnames or [])
    return [(f"line {reader.line_num}", row) for row in reader]


def _read_parquet_rows(path: Path) -> Iterable[tuple[str, Mapping[str, Any]]]:
    content = read_input_bytes(path)
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        table = pq.read_table(pa.BufferReader(content))
    except (pa.ArrowException, OSError) as error:
        raise ValueError(f"{path}: is no Parquet file that can be read ({error})") from error
    _check_names(path, table.column_names)
    return [(f"row {number}", row) for number, row in enumerate(table.to_pylist(), start=1)]


def _check_names(path: Path, names: Iterable[str]) -> None:
    known = [name for name in names if name is not None]
    for needed in _NAMES[:2]:
        if needed not in known:
            near = did_you_mean(needed, known)
            raise ValueError(f"{path}: has no column {needed!r}: it is no table of decisions{near}")


def _located_message(where: str, problem: Any) -> str:
    name = ".".join(str(part) for part in problem["loc"])
    value = shorten(escape_unprintable(str(problem["input"])), 60)
    return f"{where}: {name} is {value!r}: {problem['msg'].lower()}"


class RecordedParameters(ConsoleParameters):
    """Parameters of a recorded operator."""

    decisions: ScenePath = Field(
        description="Table of decisions: a run's folder, its decisions.parquet, or a CSV file."
    )


class RecordedOperator(Console):
    """Repeats a table of decisions, each at the first scan not before its time.

    With the scan rate and the wires of the console that the table was recorded at, everything
    comes out as it did then, byte by byte.
    """

    Parameters = RecordedParameters
    windowed = True
    rewindable = True

    def setup(self) -> None:
        """Read the table."""
        super().setup()
        result = read_decisions(self.p.decisions)
        per_s = self.context.ticks_per_s
        self._ticks = np.array([round(time_s * per_s) for time_s, _ in result], dtype=np.int64)
        self._decided = tuple(decision for _, decision in result)
        self._next = 0

    def due_decisions(self, wake: Wake) -> Sequence[tuple[int, OperatorDecision]]:
        """Return the recorded decisions due since the last scan, as (tick of scan, decision)."""
        scans = wake.ticks[wake.scans >= 0]
        if len(scans) == 0 or self._next == len(self._decided):
            return []
        first = self._next
        self._next = int(np.searchsorted(self._ticks, scans[-1], side="right"))
        at = scans[np.searchsorted(scans, self._ticks[first : self._next])]
        return list(zip(at.tolist(), self._decided[first : self._next], strict=True))

    def warnings(self) -> list[str]:
        """Return a warning on each decision that comes after the end of the run."""
        end = float(self.context.duration_s * self.context.ticks_per_s)
        late = int(np.count_nonzero(self._ticks >= end))
        return [f"decisions: {late} of {len(self._ticks)} come after the end"] if late else []
