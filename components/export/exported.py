"""``dsa-des export``: a run in another format, of which CSV, MATLAB and ``.daa`` are made here."""

import io
import re
from pathlib import Path
from typing import Any

import numpy as np

from components.display.recorded_run import RecordedTables, read_tables
from components.export.globe import czml_text, kml_text
from components.export.operator_answers import operator_csv
from dsa_des.errors import OutputError, UsageError
from dsa_des.files.output_file import check_file, write_file
from dsa_des.files.output_names import named
from dsa_des.terminal.terminal import say

_MATLAB_NAME = re.compile("[A-Za-z][A-Za-z0-9_]{0,62}")
_DAA_HEAD = (
    "NAME, lat, lon, alt, trk, gs, vs, heading, time",
    "[], [deg], [deg], [m], [deg], [m/s], [m/s], [deg], [s]",
)
_ENDINGS = {"operator-csv": "-operator.csv"}


def export_run(run: str, to: str, out: str | None) -> None:
    """Write a run in another format; ``dsa-des export``."""
    tables = read_tables(run)
    folder = tables.folder.resolve()
    target = (
        named(out)
        if out is not None
        else folder.with_name(f"{folder.name}{_ENDINGS.get(to, f'.{to}')}")
    )
    if to == "csv":
        _write_folder(tables, target if out is not None else folder.with_name(f"{folder.name}-csv"))
        return
    check_file(target)
    content = _OF_ONE_FILE[to](tables)
    try:
        write_file(target, content)
    except OSError as error:
        raise OutputError(f"{target}: cannot be written: {error.strerror}") from error
    say(f"wrote {target}")


def _write_folder(tables: RecordedTables, target: Path) -> None:
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


def daa_text(run: RecordedTables) -> str:
    """Return the true flights as DAIDALUS and `traffic.daa_file` read them, by instants.

    The ownship comes first; a name that such a file cannot hold is refused.
    """
    rows: list[tuple[float, int, str]] = []
    for number, (name, flight) in enumerate(run.flights().items()):
        if any(c in name for c in ",;\t\n\r ") or not name:
            raise UsageError(f"{run.folder}: the name {name!r} holds what separates cells: rename")
        north, east = flight["velocity_north_m_s"], flight["velocity_east_m_s"]
        track_deg = np.degrees(np.arctan2(east, north)) % 360.0
        heading_deg = np.degrees(flight["heading_rad"]) % 360.0
        columns = (
            flight["lat_deg"], flight["lon_deg"], flight["alt_m"], track_deg, np.hypot(north, east),
            -flight["velocity_down_m_s"], heading_deg, flight["time_s"],
        )  # fmt: skip
        for cells in zip(*(column.tolist() for column in columns), strict=True):
            text = ", ".join([name, *(repr(cell) for cell in cells)])
            rows.append((cells[-1], number, text))
    rows.sort(key=lambda row: row[:2])
    return "\n".join([*_DAA_HEAD, *(text for _, _, text in rows)]) + "\n"


_OF_ONE_FILE = {
    "kml": lambda tables: kml_text(tables).encode("utf-8"),
    "czml": lambda tables: czml_text(tables).encode("utf-8"),
    "daa": lambda tables: daa_text(tables).encode("utf-8"),
    "mat": mat_bytes,
    "operator-csv": operator_csv,
}
