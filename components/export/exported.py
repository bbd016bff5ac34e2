"""``dsa-des export``: a run in another format, of which CSV, MATLAB and ``.daa`` are made here."""

import io
import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from components.display.recorded_run import RecordedTables, read_tables
from components.export.asterix_export import asterix_bytes
from components.export.globe import czml_text, kml_text
from components.export.mcap_export import mcap_bytes
from components.export.operator_answers import operator_csv
from components.geometry import line_of_sight_ned, local_axes
from dsa_des.arrays.types import FloatArray
from dsa_des.errors import OutputError, UsageError
from dsa_des.files.output_file import check_file, write_file
from dsa_des.files.output_names import named
from dsa_des.terminal.terminal import say

_MATLAB_NAME = re.compile("[A-Za-z][A-Za-z0-9_]{0,62}")
_DAA_HEAD = (
    "NAME, lat, lon, alt, trk, gs, vs, heading, time",
    "[], [deg], [deg], [m], [deg], [m/s], [m/s], [deg], [s]",
)
_XYZ_HEAD = (
    "NAME, sx, sy, sz, vx, vy, vz, heading, time",
    "[], [m], [m], [m], [m/s], [m/s], [m/s], [deg], [s]",
)
_ENDINGS = {"operator-csv": "-operator.csv", "asterix": ".ast"}


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

    def columns(flight: Mapping[str, FloatArray]) -> list[FloatArray]:
        north, east = flight["velocity_north_m_s"], flight["velocity_east_m_s"]
        return [
            flight["lat_deg"], flight["lon_deg"], flight["alt_m"],
            np.degrees(np.arctan2(east, north)) % 360.0, np.hypot(north, east),
            -flight["velocity_down_m_s"], np.degrees(flight["heading_rad"]) % 360.0,
        ]  # fmt: skip

    return "\n".join([*_DAA_HEAD, *_rows(run, columns)]) + "\n"


def xyz_text(run: RecordedTables) -> str:
    """Return the true flights as east, north (m) of a reference point, and altitudes.

    The point is where the ownship is first, at altitude 0; a comment says it. `read_daa` with that
    reference gives the flights again.
    """
    own = next(iter(run.flights().values()))
    lat, lon = float(own["lat_deg"][0]), float(own["lon_deg"][0])
    there = local_axes(np.array([lat]), np.array([lon]))

    def columns(flight: Mapping[str, FloatArray]) -> list[FloatArray]:
        place = flight["lat_deg"], flight["lon_deg"]
        here = local_axes(*place)
        # Altitudes stay what they are; east and north are those of the point of the tangent plane's
        # frame that lies so high above the plane, straight above or below the place.
        _, _, down = line_of_sight_ned(lat, lon, 0.0, *place, np.zeros_like(place[0]))
        height = (flight["alt_m"] + down) / _dot(here[2], there[2])
        north, east, _ = line_of_sight_ned(lat, lon, 0.0, *place, height)
        moves = (
            flight["velocity_east_m_s"], flight["velocity_north_m_s"], -flight["velocity_down_m_s"],
        )  # fmt: skip
        earth = [sum(v * axis[i] for v, axis in zip(moves, here, strict=True)) for i in range(3)]
        # The heading whose line above the plane, seen along the aircraft's own horizon, is its own.
        s, c = np.sin(flight["heading_rad"]), np.cos(flight["heading_rad"])
        nose = np.arctan2(
            s * _dot(here[1], there[1]) - c * _dot(here[0], there[1]),
            c * _dot(here[0], there[0]) - s * _dot(here[1], there[0]),
        )
        along = [_dot(earth, axis) for axis in there]
        return [east, north, flight["alt_m"], *along, np.degrees(nose) % 360.0]

    head = f"# reference point: lat {lat!r} deg, lon {lon!r} deg, alt 0 m"
    return "\n".join([head, *_XYZ_HEAD, *_rows(run, columns)]) + "\n"


def _dot(one: Sequence[Any], other: Sequence[Any]) -> Any:
    return sum(a * b for a, b in zip(one, other, strict=True))


def _rows(
    run: RecordedTables, columns: Callable[[Mapping[str, FloatArray]], Sequence[FloatArray]]
) -> list[str]:
    """Return a row for each aircraft and instant: its name, columns of its flight, the time."""
    rows: list[tuple[float, int, str]] = []
    for number, (name, flight) in enumerate(run.flights().items()):
        if any(c in name for c in ",;\t\n\r ") or not name:
            raise UsageError(f"{run.folder}: the name {name!r} holds what separates cells: rename")
        made = (*columns(flight), flight["time_s"])
        for cells in zip(*(column.tolist() for column in made), strict=True):
            text = ", ".join([name, *(repr(cell) for cell in cells)])
            rows.append((cells[-1], number, text))
    rows.sort(key=lambda row: row[:2])
    return [text for _, _, text in rows]


_OF_ONE_FILE = {
    "kml": lambda tables: kml_text(tables).encode("utf-8"),
    "czml": lambda tables: czml_text(tables).encode("utf-8"),
    "daa": lambda tables: daa_text(tables).encode("utf-8"),
    "xyz": lambda tables: xyz_text(tables).encode("utf-8"),
    "asterix": asterix_bytes,
    "mcap": mcap_bytes,
    "mat": mat_bytes,
    "operator-csv": operator_csv,
}
