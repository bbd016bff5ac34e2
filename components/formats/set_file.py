"""Sets of encounters in Parquet files: written batch by batch, read strictly.

What is wrong with an encounter is said with the file and the encounter's number; a damaged one can
be left out and counted instead.
"""

import json
from collections.abc import Iterable
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from components.formats.encounter_set import (
    EVENTS,
    FAMILY,
    LARGEST_WEIGHT,
    LISTS,
    STATE,
    TRACKS,
    EncounterSet,
)
from dsa_des.arrays.types import AnyArray, FloatArray, IntArray
from dsa_des.errors import OutputError, did_you_mean, shortened_repr
from dsa_des.files.input_files import InputFileError, cache_file_reads, readable_file_status
from dsa_des.files.output_file import stream_file
from dsa_des.files.output_names import system_error_text

if TYPE_CHECKING:
    import pyarrow as pa


_META = b"dsa_des.encounters"
_KEYS = ("encounter", "weight", "aircraft")
#: Columns that a set may have besides: geometry at the closest approach, and classes.
EXTRA = (
    "horizontal_miss_m", "vertical_miss_m", "closest_s", "course_deg", "bearing_deg", "geometry",
    FAMILY,
)  # fmt: skip
_LARGEST_BYTES = 16 * 2**30
_MOST_SAID = 20
_LARGEST = {
    "north_m": 5e6, "east_m": 5e6, "altitude_m": 1e5, "speed_mps": 2000.0, "time_s": 1e7,
    "climb_mps": 2000.0, "turn_rad_s": 100.0, "acceleration_mps2": 1e4, "heading_rad": 1e4,
}  # fmt: skip


def is_origin(value: object) -> bool:
    """Return whether a value is [latitude, longitude] in degrees, within ±89 and ±360."""
    return (
        isinstance(value, list | tuple)
        and len(value) == 2
        and all(isinstance(v, int | float) and not isinstance(v, bool) for v in value)
        and abs(value[0]) <= 89.0
        and abs(value[1]) <= 360.0
    )


class EncounterSetError(ValueError):
    """A set cannot be used; each line of the message names the file, and the encounter if one."""


@cache_file_reads(4)
def read_set(path: Path, skip_damaged: bool = False) -> EncounterSet:
    """Read a set of encounters from a file; with ``skip_damaged``, without the faulty ones."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        readable_file_status(path, _LARGEST_BYTES)
        table = pq.read_table(path)
    except InputFileError as error:
        raise EncounterSetError(f"{path}: {error}") from None
    except (pa.ArrowException, OSError) as error:
        raise EncounterSetError(
            f"{path}: is no whole Parquet file: it may be cut short ({str(error)[:200]})"
        ) from None
    return _SetReader(path, table).encounters(skip_damaged)


class _SetReader:
    def __init__(self, path: Path, table: "pa.Table") -> None:
        self.path, self.table = path, table
        names = set(table.column_names)
        self.kind = EVENTS if "climb_mps" in names or "speed_mps" in names else TRACKS
        self.flat = STATE if self.kind == EVENTS else ()
        self.lists = LISTS[self.kind]
        known = [*_KEYS, *self.flat, *self.lists, *EXTRA]
        for name in table.column_names:
            if name not in known:
                raise self.error_about_set(f"unknown variable {name!r}{did_you_mean(name, known)}")
        for name in (*_KEYS, *self.flat, *self.lists):
            if name not in names:
                raise self.error_about_set(
                    f"the column {name!r} is missing{did_you_mean(name, names)}"
                )
        if table.num_rows == 0:
            raise self.error_about_set("holds no encounter")

    def error_about_set(self, message: str) -> EncounterSetError:
        return EncounterSetError(f"{self.path}: {message}")

    def encounters(self, skip_damaged: bool) -> EncounterSet:
        whole = self.column("encounter")
        if not ((whole == np.floor(whole)) & (whole >= 0) & (whole <= 2**53)).all():
            raise self.error_about_set(
                "column 'encounter': must be whole numbers from 0 to 2^53, none missing"
            )
        if (np.diff(whole) < 0).any():
            raise self.error_about_set("rows must be in order of their encounters' numbers")
        rows_of, first = np.unique(whole.astype(np.int64), return_index=True)
        bounds = np.append(first, len(whole))
        starts, lists, wrong = self.starts_lists_and_faults()
        flat = {name: self.column(name) for name in self.flat}
        weights = self.column("weight")
        names = self.table["aircraft"].to_pylist()
        wrong = self.first_fault_by_row(starts, lists, flat, weights, names) | wrong
        said: dict[int, str] = {}
        for row in sorted(wrong):
            index = int(np.searchsorted(bounds, row, side="right")) - 1
            said.setdefault(index, wrong[row])
        for index in np.flatnonzero(np.diff(bounds) < 2).tolist():
            said.setdefault(index, "has one aircraft: an ownship and an intruder are needed")
        with np.errstate(invalid="ignore"):
            same = np.add.reduceat(
                np.abs(weights - np.repeat(weights[first], np.diff(bounds))), first
            )
        for index in np.flatnonzero(same > 0.0).tolist():
            said.setdefault(index, "its aircraft have different weights")
        if said and (not skip_damaged or len(said) == len(rows_of)):
            indices = sorted(said)
            lines = [f"{self.path}: encounter {rows_of[p]}: {said[p]}" for p in indices]
            more = [f"and {len(lines) - _MOST_SAID} more"] if len(lines) > _MOST_SAID else []
            raise EncounterSetError("\n".join([*lines[:_MOST_SAID], *more]))
        if not (weights > 0.0).any():
            raise self.error_about_set("all weights are 0")
        reference, extra = self.reference(), self.extra(first)
        result = EncounterSet(
            str(self.path), self.kind, rows_of, weights[first], bounds, tuple(map(str, names)),
            flat, starts, lists, reference, extra,
        )  # fmt: skip
        return result.drop(sorted(said)) if said else result

    def column(self, name: str) -> FloatArray:
        column = self.table[name]
        try:
            values: AnyArray = column.to_numpy(zero_copy_only=False)
            return np.asarray(values, dtype=np.float64)
        except (TypeError, ValueError):
            raise self.error_about_set(
                f"column {name!r}: holds {column.type}; numbers are needed"
            ) from None

    def starts_lists_and_faults(self) -> tuple[IntArray, dict[str, FloatArray], dict[int, str]]:
        """Return where rows' lists begin, the lists joined by column, and by row what is wrong."""
        import pyarrow as pa
        import pyarrow.compute as pc

        lists, wrong = {}, dict[int, str]()
        starts: IntArray | None = None
        for name in self.lists:
            column = self.table[name].combine_chunks()
            if not pa.types.is_list(column.type) and not pa.types.is_large_list(column.type):
                raise self.error_about_set(
                    f"column {name!r}: holds {column.type}; lists are needed"
                )
            lengths = np.asarray(pc.fill_null(pc.list_value_length(column), 0), dtype=np.int64)
            mine = np.concatenate([[0], np.cumsum(lengths)])
            try:
                flat = pc.list_flatten(column).to_numpy(zero_copy_only=False)
                values: FloatArray = np.asarray(flat, dtype=np.float64)
            except (TypeError, ValueError):
                raise self.error_about_set(
                    f"column {name!r}: holds {column.type}; numbers are needed"
                ) from None
            if starts is None:
                starts = mine
                for row in np.flatnonzero(lengths == 0).tolist():
                    wrong[row] = f"{name} is empty"
            elif not np.array_equal(starts, mine):
                wanted = np.diff(starts)
                for row in np.flatnonzero(wanted != lengths).tolist():
                    said = f"{name} has {lengths[row]} values, time_s has {wanted[row]}"
                    wrong.setdefault(row, said)
                # Such rows are left out, or an error; until then they are as long as the others.
                whole = np.full(int(starts[-1]), np.nan)
                same = wanted == lengths
                whole[np.repeat(same, wanted)] = values[np.repeat(same, lengths)]
                values = whole
            lists[name] = values
        assert starts is not None
        return starts, lists, wrong

    def first_fault_by_row(
        self,
        starts: IntArray,
        lists: dict[str, FloatArray],
        flat: dict[str, FloatArray],
        weights: FloatArray,
        names: list[Any],
    ) -> dict[int, str]:
        """Return by row the first thing that is wrong with it; faultless rows are left out."""
        problems: dict[int, str] = {}
        row_of = np.repeat(np.arange(len(starts) - 1), np.diff(starts))

        def note(rows: AnyArray, what: str) -> None:
            for row in np.unique(rows).tolist():
                problems.setdefault(row, what.format(aircraft=names[row]))

        with np.errstate(invalid="ignore"):
            note(np.flatnonzero(np.isnan(weights)), "weight is missing")
            good = (weights >= 0.0) & (weights <= LARGEST_WEIGHT)
            note(np.flatnonzero(~good), f"weight must be a number from 0 to {LARGEST_WEIGHT:g}")
        note(np.flatnonzero([not isinstance(n, str) or not n for n in names]), "has no name")
        time_s = lists["time_s"]
        for name, values in lists.items():
            note(row_of[~np.isfinite(values)], f"{{aircraft}}: {name} holds no number")
        note(row_of[time_s < 0.0], "{aircraft}: time_s is negative")
        backward = np.flatnonzero((np.diff(time_s) <= 0.0) & (row_of[1:] == row_of[:-1]))
        note(row_of[backward], "{aircraft}: times must rise")
        every = np.arange(len(names))
        columns = [
            *((row_of, n, v) for n, v in lists.items()),
            *((every, n, v) for n, v in flat.items()),
        ]
        for rows, name, values in columns:
            if name in _LARGEST:
                most = _LARGEST[name]
                note(rows[~(np.abs(values) <= most)],
                     f"{{aircraft}}: {name} must be a number within ±{most:g}")  # fmt: skip
        if self.kind == EVENTS:
            for name in ("heading_rad", "duration_s"):
                note(np.flatnonzero(~np.isfinite(flat[name])), f"{{aircraft}}: {name} is missing")
            note(
                np.flatnonzero(~(flat["speed_mps"] > 0.0)), "{aircraft}: speed_mps must be above 0"
            )
            bad = ~((flat["duration_s"] > 0.0) & (flat["duration_s"] <= 86_400.0))
            note(np.flatnonzero(bad), "{aircraft}: duration_s must lie in (0, 86400]")
            firsts = starts[:-1][np.diff(starts) > 0]
            late = firsts[time_s[firsts] != 0.0]
            note(row_of[late], "{aircraft}: the first event must be at time_s 0")
        return problems

    def reference(self) -> tuple[float, float]:
        try:
            meta = json.loads((self.table.schema.metadata or {}).get(_META, b"{}"))
        except (ValueError, RecursionError) as error:
            raise self.error_about_set(f"its metadata are no JSON ({str(error)[:200]})") from None
        if not isinstance(meta, dict):
            raise self.error_about_set("its metadata must be a table (a JSON object)")
        reference = meta.get("reference_deg", [0.0, 0.0])
        if not is_origin(reference):
            raise self.error_about_set(
                f"its metadata: reference_deg = {shortened_repr(reference)}: must be [latitude, "
                "longitude] in degrees, within ±89 and ±360"
            )
        return float(reference[0]), float(reference[1])

    def extra(self, first: IntArray) -> dict[str, AnyArray]:
        there = [name for name in EXTRA if name in self.table.column_names]
        return {
            name: np.array(self.table[name].to_pylist(), dtype=object)[first]
            if name == "geometry"
            else self.column(name)[first]
            for name in there
        }


def write_set(path: Path, about: dict[str, Any], parts: Iterable[EncounterSet]) -> None:
    """Write encounters part by part, numbers ascending throughout, completely or not at all.

    OutputError says why it cannot be written.
    """
    import pyarrow.parquet as pq

    try:
        with stream_file(path) as file, ExitStack() as stack:
            writer: Any = None
            for part in parts:
                table = _table_of(part)
                if writer is None:
                    said = {**about, "reference_deg": list(part.reference_deg), "kind": part.kind}
                    schema = table.schema.with_metadata({_META: json.dumps(said, sort_keys=True)})
                    writer = stack.enter_context(pq.ParquetWriter(file, schema))
                writer.write_table(table.replace_schema_metadata(writer.schema.metadata))
    except OSError as error:
        raise OutputError(f"{path}: cannot be written: {system_error_text(error)}") from error


def _table_of(some: EncounterSet) -> "pa.Table":
    import pyarrow as pa

    counts = np.diff(some.first_rows)
    columns: dict[str, Any] = {
        "encounter": np.repeat(some.numbers, counts),
        "weight": np.repeat(some.weights, counts),
        "aircraft": list(some.names),
        **some.state,
    }
    offsets = pa.array(some.starts, type=pa.int32())
    for name in LISTS[some.kind]:
        columns[name] = pa.ListArray.from_arrays(offsets, pa.array(some.lists[name]))
    for name, values in some.extra.items():
        columns[name] = np.repeat(values, counts)
    return pa.table(columns)
