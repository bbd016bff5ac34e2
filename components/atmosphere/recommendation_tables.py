"""Reading the Recommendations' coefficient tables, which lie beside the code as CSV files."""

from __future__ import annotations

import csv
from functools import cache
from pathlib import Path

import numpy as np

from components.arguments.checks import FloatArray

_FOLDER = Path(__file__).parent / "data"


@cache
def rows(name: str) -> tuple[dict[str, str], ...]:
    """Return the rows of ``data/<name>.csv`` as dictionaries; lines starting with # are notes."""
    with open(_FOLDER / f"{name}.csv", encoding="utf-8", newline="") as file:
        return tuple(csv.DictReader(line for line in file if not line.startswith("#")))


@cache
def columns(name: str) -> dict[str, FloatArray]:
    """Return the columns of ``data/<name>.csv`` as read-only float64 arrays."""
    table = rows(name)
    result = {key: np.array([float(row[key]) for row in table]) for key in table[0]}
    for column in result.values():
        column.flags.writeable = False
    return result
