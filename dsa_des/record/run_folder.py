"""The folder of a run, read as Arrow tables.

A run folder holds ``scene.toml`` (resolved), one Parquet file per table (``detections``,
``scans``, ``tracks``, ...), ``run.json`` and the figures.
"""

import json
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from textwrap import wrap
from typing import TYPE_CHECKING, Any

from dsa_des.arrays.types import IntArray
from dsa_des.block.entry_points import entry_points_of
from dsa_des.block.shadowed_packages import load_unnamed_entry_point
from dsa_des.errors import UsageError, did_you_mean
from dsa_des.files.output_file import write_file
from dsa_des.files.output_folder import RUN_JSON, content_with_file_digests
from dsa_des.files.output_names import new_folder_name
from dsa_des.record.drawing import pictures_in
from dsa_des.record.table_metadata import OF_ROWS
from dsa_des.terminal.terminal import capture_html, capture_text
from dsa_des.text.plain_json import json_text
from dsa_des.text.safe_text import escape_unprintable, shorten

if TYPE_CHECKING:
    import pyarrow as pa

__all__ = ["RUN_JSON", "Run", "new_folder_name", "read_run", "write_json", "write_run_json"]


#: Entry points of the plug-ins that report on a run.
REPORTS = "dsa_des.reports"
# By these, rows of two tables belong together.
_KEYS = {"block", "tick"}
# Of what a run is shown as in Python.
_WIDTH, _MOST_LINES = 84, 6


def write_json(path: Path, content: Any) -> None:
    """Write JSON with sorted keys, so that equal contents are equal bytes."""
    write_file(path, (json_text(content, indent=2, sort_keys=True) + "\n").encode())


def write_run_json(folder: Path, content: dict[str, Any]) -> None:
    """Write ``run.json``, the last file, with a digest of every file in the folder.

    A folder whose files are not listed is not replaced by later results.
    """
    write_json(folder / RUN_JSON, content_with_file_digests(folder, content))


@dataclass(frozen=True, repr=False)
class Run:
    """A finished run, kept in memory or read back from its folder.

    ``run["detections"]`` or ``run.detections`` is a ``pyarrow.Table``, with the columns of other
    tables that belong to its rows: those of ``scans`` that say where the ownship was.

    Parameters
    ----------
    path : Path or None
        Its folder, if it has one.
    info : dict
        The content of ``run.json``: seed, versions, resolution, scene hash, counts, summary, and
        ``files``, every file of the folder with a digest.
    tables : dict
        Table name → ``pyarrow.Table``, as it is recorded.
    scene : str
        The resolved scene, as TOML text.
    draw : callable
        Returns its figures by name; called when one is asked for.
    """

    path: Path | None
    info: dict[str, Any]
    tables: "dict[str, pa.Table]"
    scene: str
    draw: Callable[[], dict[str, Any]] = field(compare=False)

    def __getitem__(self, table: str) -> "pa.Table":
        if table not in self.tables:
            raise KeyError(f"the run has no table {table!r}; it has {', '.join(self.tables)}")
        joined: dict[str, Any] = self.__dict__.setdefault("_joined", {})
        if table not in joined:
            joined[table] = join_row_columns(self.tables, table)
        return joined[table]

    def __getattr__(self, table: str) -> "pa.Table":
        if table.startswith("__") or table not in self.__dict__.get("tables", {}):
            raise AttributeError(table)
        return self[table]

    def __dir__(self) -> list[str]:
        return sorted([*super().__dir__(), *self.tables])

    def __repr__(self) -> str:
        title, seconds = self.info.get("title", ""), self.info.get("duration_s", "?")
        seed = self.info.get("seed", "?")
        where = "in memory" if self.path is None else f"in {shorten(str(self.path))}"
        rows = ", ".join(f"{name} ({len(table)} rows)" for name, table in self.tables.items())
        tables = wrap(escape_unprintable(rows), _WIDTH) or ["none"]
        lines = [
            f"Run of {shorten(repr(title))}, {seconds} s, seed {seed}, {where}",
            *(f"  {line}" for line in tables[:_MOST_LINES]),
        ]
        return "\n".join([*lines, *(["  ..."] if len(tables) > _MOST_LINES else [])])

    def __str__(self) -> str:
        return capture_text(self._print_to)

    def _repr_html_(self) -> str:
        return capture_html(self._print_to)

    def _print_to(self, console: Any) -> None:
        """Print the run and each report of its summary to the console, as ``dsa-des run`` does."""
        from rich.text import Text

        console.print(Text(repr(self)))
        for point in entry_points_of(REPORTS).values():
            load_unnamed_entry_point(point)().show(console, self.summary)

    @property
    def summary(self) -> dict[str, Any]:
        """The results of the run as a dict, as ``dsa-des run --json`` prints them."""
        summary: dict[str, Any] = self.info.get("summary", {})
        return summary

    @cached_property
    def figures(self) -> dict[str, Any]:
        """All figures by name; those of a run in memory are drawn when they are first asked for."""
        return self.draw()

    def figure(self, name: str) -> Any:
        """Return the figure of this name that the reports draw, for example ``plan``.

        It is a matplotlib figure with a method ``save(path)``; of a run that was read from a folder
        it is the PNG file there, with the same method.

        Raises
        ------
        UsageError
            If there is none of this name.
        """
        if name not in self.figures:
            hint = did_you_mean(name, self.figures)
            raise UsageError(f"the run has no figure {name!r}{hint}")
        return self.figures[name]


def join_row_columns(tables: "Mapping[str, pa.Table]", name: str) -> "pa.Table":
    """Return a table with other tables' columns that belong to its rows (`OF_ROWS`).

    They are joined by block, tick and replica; where the table has such a column itself, what
    stands in it comes first.
    """
    import pyarrow as pa
    import pyarrow.compute as pc

    table = tables[name]
    for other in tables.values():
        wanted = [f for f in other.schema if (f.metadata or {}).get(OF_ROWS) == name.encode()]
        if not wanted or not {*table.column_names} & {*other.column_names} >= _KEYS:
            continue
        row = _matching_rows(table, other)
        rows = pa.array(row, mask=row < 0)
        for item in wanted:
            values = other[item.name].take(rows)
            if item.name in table.column_names:
                index = table.column_names.index(item.name)
                values = pc.coalesce(table[item.name], values)
                table = table.set_column(index, item.remove_metadata(), values)
            else:
                table = table.append_column(item.remove_metadata(), values)
    return table


def _matching_rows(table: "pa.Table", other: "pa.Table") -> IntArray:
    """Return for each row of `table` the row of `other` of equal block, tick, replica; or -1."""
    import numpy as np
    import pyarrow as pa

    count = len(table)
    keys = np.zeros(count + len(other), dtype=np.int64)
    for name in ("replica", "tick", "block"):
        if name in other.column_names:
            kind = table.schema.field(name).type
            plain = kind.value_type if pa.types.is_dictionary(kind) else kind
            chunks = [c for part in (table, other) for c in part[name].cast(plain).chunks]
            codes = pa.chunked_array(chunks, plain).combine_chunks().dictionary_encode()
            keys = keys * len(codes.dictionary) + codes.indices.to_numpy()
    mine, theirs = keys[:count], keys[count:]
    if not len(theirs):
        return np.full(count, -1, dtype=np.int64)
    order = np.argsort(theirs, kind="stable")
    row = order[np.minimum(np.searchsorted(theirs[order], mine), len(theirs) - 1)]
    return np.where(theirs[row] == mine, row, -1)


def read_run(path: str | os.PathLike[str]) -> Run:
    """Read a run folder.

    Parameters
    ----------
    path : path of the folder

    Returns
    -------
    Run
        With one Arrow table per Parquet file.

    Raises
    ------
    FileNotFoundError
        If the folder is not a run.
    """
    import pyarrow.parquet as pq

    folder = Path(path)
    if not (folder / RUN_JSON).is_file():
        raise FileNotFoundError(f"{folder} is not a run folder: it has no {RUN_JSON}")
    info = json.loads((folder / RUN_JSON).read_text(encoding="utf-8"))
    # Each file is opened by itself: a folder name is never taken for a partition.
    tables = {file.stem: pq.ParquetFile(file).read() for file in sorted(folder.glob("*.parquet"))}
    scene = folder / "scene.toml"
    text = scene.read_text(encoding="utf-8") if scene.is_file() else ""
    return Run(folder, info, tables, text, lambda: pictures_in(folder))
