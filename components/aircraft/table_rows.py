"""The rows of a table written as CSV, with their line numbers."""

import csv
from collections.abc import Iterator, Sequence
from os import PathLike
from pathlib import Path

from dsa_des.block.limits import refuse_extremes
from dsa_des.files.input_files import InputFileError, read_input_text


def table_rows(path: str | PathLike[str]) -> Iterator[tuple[int, list[str]]]:
    """Give the rows of a table that hold something, with their lines from 1.

    Blank lines and lines that start with # are left out. A cell never spans lines, so that a
    stray quote cannot swallow what follows it.
    """
    try:
        text = read_input_text(Path(path))
    except InputFileError as error:
        raise ValueError(f"{path}: {error}") from None
    for number, line in enumerate(text.replace("\r", "\n").split("\n"), start=1):
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        try:
            cells = next(csv.reader([line]))
        except csv.Error as error:
            raise ValueError(f"{path}, line {number}: cannot be read: {error}") from None
        if any(cell.strip() for cell in cells):
            yield number, cells


def row_values(
    place: str,
    header: Sequence[str],
    cells: Sequence[str],
    columns: Sequence[int],
    quantities: Sequence[str],
) -> list[float]:
    """Return the numbers of a row."""
    values = []
    for column, quantity in zip(columns, quantities, strict=True):
        try:
            value = float(cells[column].replace("_", "no number"))
        except (ValueError, IndexError):
            wanted = ", ".join(header[column] for column in columns)
            raise ValueError(
                f"{place}: it must have a number in each of the columns {wanted}"
            ) from None
        try:
            refuse_extremes(quantity, value)
        except ValueError as error:
            raise ValueError(f"{place}: {header[column]} is {value:g}: {error}") from None
        values.append(value)
    return values
