"""``dsa-des export``: read a run, write it in the format that is asked for."""

from pathlib import Path

from components.export.globe import czml_text, kml_text
from components.export.operator_answers import operator_csv
from components.export.plain_tables import csv_files, mat_bytes
from components.export.recorded import RecordedTables, read_tables
from components.export.traffic import daa_text
from dsa_des.errors import OutputError
from dsa_des.files.output_file import check_file, write_file
from dsa_des.files.output_names import named
from dsa_des.terminal.terminal import say

_OF_ONE_FILE = {
    "kml": lambda tables: kml_text(tables).encode("utf-8"),
    "czml": lambda tables: czml_text(tables).encode("utf-8"),
    "daa": lambda tables: daa_text(tables).encode("utf-8"),
    "mat": lambda tables: mat_bytes(tables),
    "operator-csv": operator_csv,
}
_ENDINGS = {"operator-csv": "-operator.csv"}


def export_run(run: str, to: str, out: str | None) -> None:
    """Write a run in another format.

    Raises
    ------
    UsageError, OutputError
    """
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
