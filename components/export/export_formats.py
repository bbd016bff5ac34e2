"""``dsa-des export``: a run in another format, of which CSV and MATLAB are made here."""

import io
import math
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from components.display.recorded_run import RecordedTables, read_tables
from components.export.asterix_export import asterix_bytes
from components.export.czml import czml_text
from components.export.flight_files import STEP_S, daa_text, xyz_text
from components.export.kml import kml_text, scene_undulation_m
from components.export.mcap_export import mcap_bytes
from components.export.operator_answers import operator_csv
from dsa_des.errors import OutputError, UsageError
from dsa_des.files.output_file import check_file_writable, write_file
from dsa_des.files.output_names import user_path
from dsa_des.terminal.terminal import say

_MATLAB_NAME = re.compile("[A-Za-z][A-Za-z0-9_]{0,62}")
_ENDINGS = {"operator-csv": "-operator.csv", "asterix": ".ast"}


#: Options, with the formats that have them.
_ONLY_OF = {"step_s": ("daa", "xyz"), "geoid_m": ("kml",)}
_LEAST_STEP_S, _MOST_GEOID_M = 1e-3, 200.0


def export_run(
    run: str, to: str, out: str | None, step_s: float | None = None, geoid_m: float | None = None
) -> None:
    """Write a run in another format; ``dsa-des export``."""
    _check_options(to, step_s=step_s, geoid_m=geoid_m)
    tables = read_tables(run)
    folder = tables.folder.resolve()
    target = (
        user_path(out)
        if out is not None
        else folder.with_name(f"{folder.name}{_ENDINGS.get(to, f'.{to}')}")
    )
    if to == "csv":
        _write_table_files(
            tables, target if out is not None else folder.with_name(f"{folder.name}-csv")
        )
        return
    check_file_writable(target)
    said = ""
    if to in _ONLY_OF["step_s"]:
        text = daa_text if to == "daa" else xyz_text
        content = text(tables, STEP_S if step_s is None else step_s).encode("utf-8")
    elif to == "kml":
        said, geoid_m = _geoid_note_and_height_m(tables, geoid_m)
        content = kml_text(tables, geoid_m).encode("utf-8")
    else:
        content = _OF_ONE_FILE[to](tables)
    try:
        write_file(target, content)
    except OSError as error:
        raise OutputError(f"{target}: cannot be written: {error.strerror}") from error
    say(f"wrote {target}{said}")


def _check_options(to: str, **given: float | None) -> None:
    for name, value in given.items():
        option = f"--{name.replace('_', '-')}"
        if value is None:
            continue
        if to not in _ONLY_OF[name]:
            raise UsageError(f"{option} belongs to --to {' or '.join(_ONLY_OF[name])}, not {to}")
        if name == "step_s" and value != 0 and not _LEAST_STEP_S <= value < math.inf:
            raise UsageError(
                f"{option} {value:g}: at least {_LEAST_STEP_S:g} s, or 0 for the recorded instants"
            )
        if name == "geoid_m" and not abs(value) <= _MOST_GEOID_M:
            raise UsageError(f"{option} {value:g}: the geoid is within ±{_MOST_GEOID_M:g} m")


def _geoid_note_and_height_m(tables: RecordedTables, given_m: float | None) -> tuple[str, float]:
    """Return a note on the geoid's source (empty if given) and its height over the ellipsoid, m."""
    known_m = scene_undulation_m(tables)
    if given_m is not None:
        said, geoid_m = "", given_m
    elif known_m is not None:
        said, geoid_m = f" (geoid {known_m:g} m above the ellipsoid, as the terrain's)", known_m
    else:
        said, geoid_m = " (heights above the ellipsoid as above sea level: --geoid-m is 0)", 0.0
    return said, geoid_m


def _write_table_files(tables: RecordedTables, target: Path) -> None:
    """Write one file for each table; all of them are made before the first is written."""
    if target.exists() and (not target.is_dir() or any(target.iterdir())):
        raise OutputError(f"--out {target}: is there already and not an empty folder")
    contents = csv_files(tables)
    try:
        target.mkdir(parents=True, exist_ok=True)
        for name, content in contents.items():
            write_file(target / name, content)
    except OSError as error:
        raise OutputError(f"{target}: cannot be written: {error.strerror}") from error
    say(f"wrote {len(contents)} files into {target}")


def csv_files(run: RecordedTables) -> dict[str, bytes]:
    """Return each table's CSV file contents, by file name; missing values are empty cells."""
    import pyarrow.csv as pa_csv

    result = {}
    for name, table in run.tables.items():
        stream = io.BytesIO()
        pa_csv.write_csv(_decode_dictionaries(table), stream)
        result[f"{name}.csv"] = stream.getvalue()
    return result


def _decode_dictionaries(table: Any) -> Any:
    """Return an Arrow table with dictionary-encoded columns made plain, as CSV needs them."""
    import pyarrow as pa

    columns = [
        column.cast(column.type.value_type) if pa.types.is_dictionary(column.type) else column
        for column in table.columns
    ]
    return pa.table(columns, names=table.column_names)


def mat_bytes(run: RecordedTables) -> bytes:
    """Return a MATLAB file (level 5) with a struct for each table, a field for each column.

    Numbers are column vectors, NaN where nothing was measured; texts are cell arrays. A name that
    MATLAB cannot have is refused.
    """
    from scipy.io import savemat

    for table, columns in run.tables.items():
        for name in (table, *columns.column_names):
            if _MATLAB_NAME.fullmatch(name) is None:
                raise UsageError(
                    f"{run.folder}: {table}.parquet: {name!r} cannot be the name of a table or a "
                    "column in MATLAB: a letter, then at most 62 letters, digits and underscores"
                )
    content = {name: _matlab_struct(table) for name, table in run.tables.items()}
    stream = io.BytesIO()
    savemat(stream, content, long_field_names=True, oned_as="column")
    # Its head holds the hour at which it was written: the same run gives the same bytes.
    head = b"MATLAB 5.0 MAT-file, written by dsa-des export".ljust(116)
    return head + stream.getvalue()[116:]


def _matlab_struct(table: Any) -> dict[str, Any]:
    result: dict[str, Any] = {}
    for name in table.column_names:
        column = table[name]
        if str(column.type) in ("string", "large_string") or "dictionary" in str(column.type):
            texts = ["" if text is None else text for text in column.to_pylist()]
            result[name] = np.array(texts, dtype=object).reshape(-1, 1)
        else:
            result[name] = np.asarray(column.to_numpy(zero_copy_only=False))
    return result


_OF_ONE_FILE: dict[str, Callable[[RecordedTables], bytes]] = {
    "czml": lambda tables: czml_text(tables).encode("utf-8"),
    "asterix": asterix_bytes,
    "mcap": mcap_bytes,
    "mat": mat_bytes,
    "operator-csv": operator_csv,
}
