"""The folder of a study: one Parquet part per chunk, each there as a whole or not at all."""

import hashlib
import json
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dsa_des import __version__
from dsa_des.errors import UsageError
from dsa_des.studies.draws import as_text
from dsa_des.studies.study import Study

if TYPE_CHECKING:
    import pyarrow as pa

STUDY_JSON = "study.json"
PARTS = "parts"


class StudyFolder:
    """Where a study keeps its results.

    Parameters
    ----------
    path : Path
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.parts = path / PARTS

    def open(self, study: Study, *, resume: bool) -> None:
        """Make the folder, or take up the one that is there.

        Raises
        ------
        UsageError
            If it holds something else, another study, or results that were not to be resumed.
        """
        about = description(study)
        known = self.about() if (self.path / STUDY_JSON).is_file() else None
        if known is not None and not resume:
            raise UsageError(
                f"{self.path}: holds a study already; --resume continues it, --out names another"
            )
        if known is not None and known["study_sha256"] != about["study_sha256"]:
            raise UsageError(
                f"{self.path}: holds another study or another version of it "
                f"(made of {known['study']}), or an encounter file has changed since; results of "
                "the two cannot be mixed"
            )
        if self.path.exists() and not self.path.is_dir():
            raise UsageError(f"--out {self.path}: is a file; a folder is needed")
        if known is None and self.path.exists() and any(self.path.iterdir()):
            raise UsageError(f"{self.path}: is a folder that holds something other than a study")
        try:
            self.parts.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise UsageError(f"--out {self.path}: cannot be written: {error.strerror}") from error
        for left in self.parts.glob(".*"):  # of a process that was killed while it wrote
            left.unlink()
        if known is None:
            text = json.dumps(about, indent=2) + "\n"
            self.write_file(STUDY_JSON, text.encode())

    def about(self) -> dict[str, Any]:
        """Return what ``study.json`` says.

        Raises
        ------
        UsageError
            If the folder is not a study.
        """
        try:
            text = (self.path / STUDY_JSON).read_text(encoding="utf-8")
        except OSError:
            raise UsageError(
                f"{self.path}: is not the folder of a study: it has no {STUDY_JSON}"
            ) from None
        try:
            content: Any = json.loads(text)
        except ValueError:
            content = None
        needed = {"study", "scene", "study_sha256", "tables"}
        if not isinstance(content, dict) or not needed <= set(content):
            raise UsageError(f"{self.path / STUDY_JSON}: is damaged, or not of a study")
        return content

    @contextmanager
    def locked(self) -> Iterator[None]:
        """Keep other processes from writing into the folder.

        Raises
        ------
        UsageError
            If another process runs this study.
        """
        try:
            import fcntl
        except ImportError:  # no such locks on this system
            yield
            return
        with (self.path / ".lock").open("w") as file:
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError:
                raise UsageError(f"{self.path}: another process is running this study") from None
            yield

    def has(self, name: str) -> bool:
        """Return whether a part is there and can be read."""
        import pyarrow as pa
        import pyarrow.parquet as pq

        path = self.parts / f"{name}.parquet"
        if not path.exists():
            return False
        try:
            pq.read_metadata(path)
        except (OSError, pa.ArrowInvalid):
            return False
        return True

    def failed_in(self, name: str) -> tuple[int, int]:
        """Return how many runs a part holds and how many of them failed."""
        import pyarrow.parquet as pq

        column = pq.ParquetFile(self.parts / f"{name}.parquet").read(columns=["error"])["error"]
        return len(column), len(column) - column.null_count

    def write_part(self, name: str, content: bytes) -> None:
        """Write a part under a temporary name and rename it.

        Raises
        ------
        OSError
            If it cannot be written; nothing is left behind then.
        """
        _write(self.parts / f"{name}.parquet", content)

    def write_file(self, name: str, content: bytes) -> None:
        """Write a file beside the parts as a whole."""
        _write(self.path / name, content)

    def results(self) -> "pa.Table":
        """Return the rows of all parts, in order of cell and replica."""
        import pyarrow as pa
        import pyarrow.parquet as pq

        files = sorted(self.parts.glob("*.parquet"))
        if not files:
            raise UsageError(f"{self.path}: holds no results yet")
        try:
            table = pa.concat_tables([pq.ParquetFile(file).read() for file in files])
        except (OSError, pa.ArrowInvalid):
            damaged = ", ".join(file.name for file in files if not self.has(file.stem))
            raise UsageError(
                f"{self.parts}: cannot be read: {damaged}; --resume writes damaged parts anew"
            ) from None
        return table.sort_by([("cell", "ascending"), ("replica", "ascending")]).combine_chunks()


def _write(path: Path, content: bytes) -> None:
    temporary = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        with temporary.open("wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        temporary.replace(path)
    except BaseException:
        with suppress(OSError):
            temporary.unlink()
        raise


def description(study: Study) -> dict[str, Any]:
    """Return the content of ``study.json``: what fixes every result, and how to read them."""
    identity: dict[str, Any] = {
        "scene": study.base.data,
        "seed": study.seed,
        "replicas": study.replicas,
        "axes": [[axis.key, axis.labels, axis.sets, axis.swaps] for axis in study.axes],
        "draws": [[draw.key, draw.kind, draw.values, draw.stratified] for draw in study.draws],
        "metrics": [[spec.name, spec.keys] for spec in study.metrics],
        "sets": study.sets,
        "swaps": study.swaps,
        "runs_per_chunk": study.runs_per_chunk,
        "stop_when": None if study.stop_when is None else vars(study.stop_when),
        "version": __version__,
    }
    files = _files_in([study.base.data, study.sets, [axis.sets for axis in study.axes]])
    identity["files"] = {str(path): _sha256(path) for path in sorted(files)}
    text = json.dumps(identity, sort_keys=True, default=as_text)
    return {
        "study": str(study.path.resolve()),
        "title": study.title,
        "scene": str(study.scene_path.resolve()),
        "study_sha256": hashlib.sha256(text.encode()).hexdigest(),
        "seed": study.seed,
        "cells": len(study.cells),
        "replicas": study.replicas,
        "axes": [
            {"column": axis.column, "values": axis.labels, "over": axis.column in study.over}
            for axis in study.axes
        ],
        "version": __version__,
        "tables": study.tables,
    }


def _files_in(value: Any) -> set[Path]:
    """Return the files that values name: encounters, terrain, tables.

    Their content fixes results as much as the values do.
    """
    if isinstance(value, Mapping):
        return _files_in(list(value.values()))
    if isinstance(value, list | tuple):
        return set().union(*map(_files_in, value))
    if not isinstance(value, str):
        return set()
    path = getattr(value, "folder", Path()) / Path(value)
    try:
        return {path.resolve()} if path.is_absolute() and path.is_file() else set()
    except (OSError, ValueError):  # a text that can be no path
        return set()


def _sha256(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
