"""Writing an item's data and rows as CSV."""

import csv
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from components.thesis.made import Columns


def write_csv(path: Path, columns: Columns) -> None:
    """Write columns of equal length; numbers with nine significant digits."""
    lines = [[_text(value) for value in line] for line in zip(*columns.values(), strict=True)]
    _write(path, [list(columns), *lines])


def write_rows(path: Path, rows: Sequence[Mapping[str, Any]]) -> None:
    """Write compared rows as they are in JSON; what does not exist is an empty field."""
    names = list(rows[0]) if rows else []
    _write(path, [names, *([_text(row[name]) for name in names] for row in rows)])


def _text(value: Any) -> str:
    if value is None:
        return ""
    if isinstance(value, str):
        return value
    return f"{float(value):.9g}"


def _write(path: Path, lines: Sequence[Sequence[str]]) -> None:
    with open(path, "w", encoding="utf-8", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows(lines)
