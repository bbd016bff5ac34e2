"""A run's tables as CSV, and as one MATLAB file."""

import io
import re
from typing import Any

import numpy as np

from components.export.recorded import RecordedTables
from dsa_des.errors import UsageError

_MATLAB_NAME = re.compile("[A-Za-z][A-Za-z0-9_]{0,62}")


def csv_files(run: RecordedTables) -> dict[str, bytes]:
    """Return a CSV file for each table; what is not measured is an empty cell."""
    import pyarrow.csv as pa_csv

    found = {}
    for name, table in run.tables.items():
        stream = io.BytesIO()
        pa_csv.write_csv(_plain(table), stream)
        found[f"{name}.csv"] = stream.getvalue()
    return found


def _plain(table: Any) -> Any:
    """Return a table without dictionaries, which CSV does not know."""
    import pyarrow as pa

    columns = [
        column.cast(column.type.value_type) if pa.types.is_dictionary(column.type) else column
        for column in table.columns
    ]
    return pa.table(columns, names=table.column_names)


def mat_bytes(run: RecordedTables) -> bytes:
    """Return a MATLAB file (level 5) with a struct for each table, a field for each column.

    Numbers are column vectors, NaN where nothing was measured; texts are cell arrays.

    Raises
    ------
    UsageError
        If a table or a column has a name that MATLAB cannot have.
    """
    from scipy.io import savemat

    for table, columns in run.tables.items():
        for name in (table, *columns.column_names):
            if _MATLAB_NAME.fullmatch(name) is None:
                raise UsageError(
                    f"{run.folder}: {table}.parquet: {name!r} cannot be the name of a table or a "
                    "column in MATLAB: a letter, then at most 62 letters, digits and underscores"
                )
    content = {name: _struct(table) for name, table in run.tables.items()}
    stream = io.BytesIO()
    savemat(stream, content, long_field_names=True, oned_as="column")
    # Its head holds the hour at which it was written: the same run gives the same bytes.
    head = b"MATLAB 5.0 MAT-file, written by dsa-des export".ljust(116)
    return head + stream.getvalue()[116:]


def _struct(table: Any) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for name in table.column_names:
        column = table[name]
        if str(column.type) in ("string", "large_string") or "dictionary" in str(column.type):
            texts = ["" if text is None else text for text in column.to_pylist()]
            found[name] = np.array(texts, dtype=object).reshape(-1, 1)
        else:
            found[name] = np.asarray(column.to_numpy(zero_copy_only=False))
    return found
