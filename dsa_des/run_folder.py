"""The folder of a run, read as Arrow tables.

A run folder holds ``scene.toml`` (resolved), one Parquet file per table (``detections``,
``scans``, ``tracks``, ...), ``run.json`` and the figures.
"""

import json
import os
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dsa_des.manifest import RUN_JSON, with_files
from dsa_des.output_file import write_file
from dsa_des.output_names import new_folder_name
from dsa_des.plain_json import json_text

if TYPE_CHECKING:
    import pyarrow as pa

__all__ = ["RUN_JSON", "Run", "new_folder_name", "read_run", "write_json", "write_run_json"]


def write_json(path: Path, content: Any) -> None:
    """Write JSON with sorted keys, so that equal contents are equal bytes."""
    write_file(path, (json_text(content, indent=2, sort_keys=True) + "\n").encode())


def write_run_json(folder: Path, content: dict[str, Any]) -> None:
    """Write ``run.json``, which lists the files of the folder: the last one to be written.

    A folder whose files are not listed is not replaced by later results.
    """
    write_json(folder / RUN_JSON, with_files(folder, content))


@dataclass(frozen=True)
class Run:
    """A run read back from its folder.

    ``run["detections"]`` or ``run.detections`` is a ``pyarrow.Table``.

    Parameters
    ----------
    path : Path
    info : dict
        The content of ``run.json``: seed, versions, resolution, scene hash, counts, summary, and
        ``files``, every file of the folder with a digest.
    tables : dict
        Table name → ``pyarrow.Table``.
    """

    path: Path
    info: dict[str, Any]
    tables: "dict[str, pa.Table]"

    def __getitem__(self, table: str) -> "pa.Table":
        if table not in self.tables:
            raise KeyError(f"the run has no table {table!r}; it has {', '.join(self.tables)}")
        return self.tables[table]

    def __getattr__(self, table: str) -> "pa.Table":
        if table.startswith("__") or table not in self.__dict__.get("tables", {}):
            raise AttributeError(table)
        return self.tables[table]

    @property
    def scene(self) -> str:
        """The resolved scene, as TOML text."""
        return (self.path / "scene.toml").read_text(encoding="utf-8")


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
    return Run(folder, info, tables)
