"""The folder of a run: written under a temporary name, renamed when complete, read as Arrow.

A run folder holds ``scene.toml`` (resolved), one Parquet file per table (``detections``,
``scans``, ``tracks``, ...), ``run.json`` and the figures.
"""

import json
import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dsa_des.errors import UsageError
from dsa_des.plain_json import json_text

if TYPE_CHECKING:
    import pyarrow as pa

RUN_JSON = "run.json"


def new_folder_name(parent: Path, stem: str) -> Path:
    """Return the first of ``parent/stem-001``, ``-002``, ... that does not exist."""
    number = 1
    while (parent / f"{stem}-{number:03d}").exists():
        number += 1
    return parent / f"{stem}-{number:03d}"


def check_target(folder: Path) -> None:
    """Raise UsageError unless `folder` is free, empty, or an earlier run that may be replaced."""
    if not folder.exists():
        return
    if not folder.is_dir():
        raise UsageError(f"--out {folder}: is a file; a folder name is needed")
    if any(folder.iterdir()) and not (folder / RUN_JSON).exists():
        raise UsageError(
            f"--out {folder}: is a folder that holds something other than a run; "
            "choose a new name, or an earlier run to replace"
        )


@contextmanager
def writing(folder: Path) -> Iterator[Path]:
    """Give a temporary folder beside `folder`; it takes that name when the block succeeds.

    When the block raises, nothing is left behind.
    """
    check_target(folder)
    made = [parent for parent in folder.parents if not parent.exists()]
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        temporary = Path(tempfile.mkdtemp(prefix=f".{folder.name}.", dir=folder.parent))
    except OSError as error:
        raise UsageError(f"--out {folder}: cannot be written: {error.strerror}") from error
    try:
        # mkdtemp makes private folders; a result is as readable as any file of its maker.
        umask = os.umask(0)
        os.umask(umask)
        temporary.chmod(0o777 & ~umask)
        yield temporary
        if folder.exists():
            shutil.rmtree(folder)
        temporary.rename(folder)
    except BaseException:
        shutil.rmtree(temporary, ignore_errors=True)
        for parent in made:
            if parent.exists() and not any(parent.iterdir()):
                parent.rmdir()
        raise


def write_json(path: Path, content: Any) -> None:
    """Write JSON with sorted keys, so that equal contents are equal bytes."""
    path.write_text(json_text(content, indent=2, sort_keys=True) + "\n", encoding="utf-8")


@dataclass(frozen=True)
class Run:
    """A run read back from its folder.

    ``run["detections"]`` or ``run.detections`` is a ``pyarrow.Table``.

    Parameters
    ----------
    path : Path
    info : dict
        The content of ``run.json``: seed, versions, resolution, scene hash, counts, summary.
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
