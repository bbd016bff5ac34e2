"""Recorded columns as Arrow data, and Parquet files of them."""

from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from dsa_des.arrays.column_values import (
    Columns,
    Instants,
    Schema,
    Text,
    instants_to_seconds,
    is_shared_nan_column,
    shared_nan_column,
)
from dsa_des.arrays.types import AnyArray, IntArray
from dsa_des.block.message import slice_columns
from dsa_des.record.table_metadata import Notes

# A row group has at most so many rows and values: 2 MB of a table are all that waits to be written.
# Groups of 8k rows of 25 columns are written as fast as of 64k, of 2k rows 1.4 times slower.
ROW_GROUP, _GROUP_VALUES = 65536, 2**18

#: Times hardly differ from row to row, which lz4 alone does not see: encoded so, they take half of
#: the time and a quarter of the space.
_ENCODINGS = {"tick": "DELTA_BINARY_PACKED", "time_s": "BYTE_STREAM_SPLIT"}

#: Columns that every row has, whatever their kind.
_LEADING = frozenset({"block", "time_s"})

# Up to so many names it is faster to look for one after the other.
_FEW_NAMES = 8

_TYPES = {
    "int64": pa.int64(),
    "float64": pa.float64(),
    "bool": pa.bool_(),
    "text": pa.string(),
}


def arrow_schema(schema: Schema) -> pa.Schema:
    """Return the Arrow schema of columns of given kinds; whole numbers and flags are not null."""
    return pa.schema([_arrow_field(name, kind, _TYPES[kind]) for name, kind in schema.items()])


def _arrow_field(name: str, kind: str, arrow_type: pa.DataType) -> pa.Field:
    # Where there can be no null, Parquet spares a level for each value: two thirds of the time.
    return pa.field(name, arrow_type, nullable=kind in ("float64", "text") and name not in _LEADING)


def to_arrow(columns: Columns, schema: Schema) -> pa.RecordBatch:
    """Return recorded columns as a record batch; NaN and code -1 become null."""
    arrays = [_arrow_array(columns[name], kind) for name, kind in schema.items()]
    return pa.RecordBatch.from_arrays(arrays, schema=arrow_schema(schema))


def _arrow_array(values: Any, kind: str) -> pa.Array:
    if isinstance(values, Text):
        return _dictionary_array(values.codes, values.names).cast(pa.string())
    values = instants_to_seconds(values)
    if kind == "float64":
        if is_shared_nan_column(values):
            return pa.nulls(len(values), _TYPES[kind])
        missing = np.isnan(values)
        count = np.count_nonzero(missing)
        if count == len(values):
            return pa.nulls(count, _TYPES[kind])
        return _array_with_nulls(values, missing if count else None)
    dtype = np.dtype(bool) if kind == "bool" else np.dtype(np.int64)
    return _array_with_nulls(np.asarray(values).astype(dtype, casting="safe", copy=False))


def _array_with_nulls(values: AnyArray, missing: AnyArray | None = None) -> pa.Array:
    """Return an Arrow array of the same values, null where `missing` is True.

    ``pa.array`` imports pandas where that is installed, a fifth of a short run's time.
    """
    held = np.packbits(values, bitorder="little") if values.dtype == bool else values
    valid = None if missing is None else np.packbits(~missing, bitorder="little")
    buffers = [None if part is None else pa.py_buffer(np.ascontiguousarray(part))
               for part in (valid, held)]  # fmt: skip
    return pa.Array.from_buffers(pa.from_numpy_dtype(values.dtype), len(values), buffers)


def _dictionary_array(codes: AnyArray, names: tuple[str, ...]) -> pa.DictionaryArray:
    missing = codes < 0
    indices = _array_with_nulls(codes, missing if missing.any() else None)
    encoded = [name.encode() for name in names]
    ends = np.cumsum([0, *map(len, encoded)], dtype=np.int32)
    buffers = [None, pa.py_buffer(ends), pa.py_buffer(b"".join(encoded))]
    words = pa.Array.from_buffers(pa.string(), len(names), buffers)
    return pa.DictionaryArray.from_arrays(indices, words, safe=False)


def _encode_by_appearance(text: Text) -> pa.DictionaryArray:
    """Return text as an Arrow dictionary array; its dictionary has used names, first seen first.

    What the dictionary of a row group holds then follows from its rows alone.
    """
    first = _first_row_of_each_code(text.codes, len(text.names))
    used = np.flatnonzero(first < len(text.codes))
    used = used[np.argsort(first[used])]
    names = tuple(text.names[i] for i in used.tolist())
    if np.array_equal(used, np.arange(len(used))):
        return _dictionary_array(text.codes, names)
    code_of = np.full(len(text.names) + 1, -1, dtype=np.int32)  # the last entry is that of null
    code_of[used] = np.arange(len(used))
    return _dictionary_array(code_of[text.codes], names)


def _first_row_of_each_code(codes: AnyArray, names: int) -> IntArray:
    """Return each code's first row index; the number of rows for a code that does not occur."""
    count = len(codes)
    if count and names <= _FEW_NAMES:
        hits_of = [codes == name for name in range(names)]
        rows = [int(hits.argmax()) if hits.any() else count for hits in hits_of]
        return np.array(rows, dtype=np.int64)
    first = np.full(names + 1, count)  # the last entry is that of null
    first[codes[::-1]] = np.arange(count - 1, -1, -1)
    return first[:-1]


def rows_per_group(schema: Schema) -> int:
    """Return the rows per Parquet row group: a power of two set by the number of columns only."""
    return min(ROW_GROUP, 1 << (_GROUP_VALUES // max(1, len(schema))).bit_length() - 1)


class ParquetSink:
    """Writes each table to ``FOLDER/TABLE.parquet`` in row groups of a fixed size.

    The size is fixed so that the bytes do not depend on how the rows arrived.
    """

    def __init__(self, folder: Path, notes: Notes | None = None) -> None:
        self._folder, self._notes = folder, notes
        self._schemas: Mapping[str, Schema] = {}
        self._writers: dict[str, pq.ParquetWriter] = {}
        self._pieces: dict[str, list[Columns]] = {}
        self._counts: dict[str, int] = {}

    def open(self, schemas: Mapping[str, Schema]) -> None:
        """Create one file per table."""
        self._schemas = schemas
        for table, schema in schemas.items():
            text = [name for name, kind in schema.items() if kind == "text"]
            self._writers[table] = pq.ParquetWriter(
                self._folder / f"{table}.parquet",
                _writer_schema(schema),
                compression="lz4",
                use_dictionary=text,
                write_batch_size=rows_per_group(schema),
                column_encoding=_ENCODINGS,
                write_statistics=["tick"],
                store_schema=False,
            )
            if self._notes is not None:
                said = self._notes.parquet_metadata(table, arrow_schema(schema))
                self._writers[table].add_key_value_metadata(said)
            self._pieces[table] = []
            self._counts[table] = 0

    def write(self, table: str, columns: Columns) -> None:
        """Add rows to a table; row groups that are full are written to the file."""
        self._pieces[table].append(columns)
        self._counts[table] += len(columns["tick"])
        if self._counts[table] >= rows_per_group(self._schemas[table]):
            self._flush(table, whole=True)

    def _flush(self, table: str, *, whole: bool) -> None:
        pieces, count = self._pieces[table], self._counts[table]
        if not pieces:
            return
        size = rows_per_group(self._schemas[table])
        full = count // size * size if whole else count
        columns = {name: _concatenate([piece[name] for piece in pieces]) for name in pieces[0]}
        for start in range(0, full, size):
            rows = slice(start, min(start + size, full))
            self._writers[table].write_table(self._row_group_table(table, columns, rows))
        self._counts[table] = count - full
        rest = slice(full, count)
        self._pieces[table] = [slice_columns(columns, rest)] if full < count else []

    def _row_group_table(self, table: str, columns: Columns, rows: slice) -> pa.Table:
        arrays = []
        for name, kind in self._schemas[table].items():
            values = columns[name]
            if isinstance(values, Text):
                part = Text(values.codes[rows], values.names)
                arrays.append(_encode_by_appearance(part))
            else:
                arrays.append(_arrow_array(values[rows], kind))
        return pa.Table.from_arrays(arrays, schema=_writer_schema(self._schemas[table]))

    def close(self) -> None:
        """Write the rows that are left and close the files."""
        for table, writer in self._writers.items():
            self._flush(table, whole=False)
            writer.close()

    def close_after_failure(self) -> None:
        """Close files still open after a failure, ignoring errors; their content is lost.

        A writer that could not write would try again when it is collected, and complain then.
        """
        for writer in self._writers.values():
            with suppress(OSError, pa.ArrowException):
                writer.close()
            writer.is_open = False


def _writer_schema(schema: Schema) -> pa.Schema:
    """Return the Parquet writer's Arrow schema, with text columns dictionary-encoded."""
    text = pa.dictionary(pa.int32(), pa.string())
    return pa.schema(
        [_arrow_field(n, k, text if k == "text" else _TYPES[k]) for n, k in schema.items()]
    )


def _concatenate(parts: list[Any]) -> Any:
    if len(parts) == 1:
        return parts[0]
    if all(is_shared_nan_column(part) for part in parts):
        return shared_nan_column(sum(len(part) for part in parts))
    if isinstance(parts[0], Text):
        # A recorder only ever adds names: the last piece knows them all.
        return Text(np.concatenate([part.codes for part in parts]), parts[-1].names)
    if all(isinstance(part, Instants) for part in parts):
        return Instants(np.concatenate([p.ticks for p in parts]), parts[0].ticks_per_s)
    parts = [instants_to_seconds(part) for part in parts]
    return np.concatenate(parts)
