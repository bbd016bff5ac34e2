"""The folder of a study: one Parquet part per chunk, each there as a whole or not at all."""

import io
import json
import os
import re
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from pydantic import ValidationError

from dsa_des.errors import UsageError
from dsa_des.files.output_file import PREFIX, try_lock_file, write_file
from dsa_des.files.output_names import describe_write_error
from dsa_des.files.sealed_files import (
    ABOUT,
    is_sealed,
    open_lock_file,
    read_regular_file,
    seal_parquet,
)
from dsa_des.record.failure_counts import FailureCounts, sum_failure_counts
from dsa_des.results.record import StudyHead, StudyRecord

if TYPE_CHECKING:
    import pyarrow as pa


STUDY_JSON = "study.json"
PARTS = "parts"
LOCK = ".lock"
#: A part: the number of its round and its own.
_PART = re.compile(r"part-(\d{3,})-\d{6,}\.parquet")
_MOST_JSON_BYTES = 256 * 2**20
_Head = TypeVar("_Head", bound=StudyHead)


class NotWritten(Exception):
    """A part cannot be written; the text says why."""


@dataclass(frozen=True)
class Parts:
    """The folder for parts of a study and the hash that seals them: all a writing process needs."""

    folder: Path
    study_sha256: str

    def check_same_study(self) -> None:
        """Raise NotWritten unless this process sees a folder holding the study with this hash."""
        try:
            there = StudyFolder(self.folder).head.study_sha256
        except UsageError as error:
            raise NotWritten(
                f"{error}; who runs a study writes into its folder, by this name"
            ) from None
        if there != self.study_sha256:
            raise NotWritten(f"{self.folder}: holds another study by now")

    def write(self, name: str, content: bytes) -> None:
        """Write a part file in one step, with the study's hash; several processes may write it."""
        path = self.folder / PARTS / f"{name}.parquet"
        try:
            write_file(path, seal_parquet(content, f"{self.study_sha256} {name}"), to_disk=True)
        except OSError as error:
            raise NotWritten(error.strerror or str(error)) from None


class StudyFolder:
    """The folder that a study's results are stored in.

    It may hold anything: what is not a regular file of this very study is no part of it, and
    nothing is written through a link.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.parts = path / PARTS
        self._lock: int | None = None
        self._record: StudyRecord | None = None

    def open(self, description: str, *, resume: bool) -> None:
        """Create the folder, or open one to resume its study, and hold its lock until `close`.

        `description` is the content of ``study.json``. A UsageError where the folder holds
        something else, another study or results that were not to be resumed, or another process
        runs the study.
        """
        if self.path.is_symlink() and not self.path.exists():
            raise UsageError(f"--out {self.path}: is a link to nothing; a folder is needed")
        if self.path.exists() and not self.path.is_dir():
            raise UsageError(f"--out {self.path}: is a file; a folder is needed")
        try:
            self._raise_if_folder_is_foreign()
            self.parts.mkdir(parents=True, exist_ok=True)
            self._take_lock()
            # Only now is all that is there ours: before, it may have been another process's.
            self._begin_or_resume(description, resume=resume)
        except OSError as error:
            self.close()
            why = describe_write_error(error, self.path)
            raise UsageError(f"--out {self.path}: cannot be written: {why}") from error
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """Release the folder's lock, so that other processes may write into it."""
        if self._lock is not None:
            os.close(self._lock)
            self._lock = None

    def _raise_if_folder_is_foreign(self) -> None:
        if self.parts.is_symlink():
            raise UsageError(f"{self.parts}: is a link; the parts of a study are in a folder")
        if os.path.lexists(self.path / STUDY_JSON) or not self.path.exists():
            return
        own = {LOCK, PARTS}  # a process was killed before it wrote what study it is
        left = {entry.name for entry in self.path.iterdir()}
        strange = {name for name in left - own if not name.startswith(f".{STUDY_JSON}.")}
        if strange or (PARTS in left and any(self.parts.iterdir())):
            raise UsageError(f"{self.path}: is a folder that holds something other than a study")

    def _take_lock(self) -> None:
        try:
            self._lock = open_lock_file(self.path / LOCK)
        except OSError as error:
            reason = f"{self.path / LOCK}: cannot be written: {error.strerror}"
            raise UsageError(reason) from None
        if try_lock_file(self._lock) is False:
            raise UsageError(f"{self.path}: another process is running this study")

    def _begin_or_resume(self, text: str, *, resume: bool) -> None:
        known = os.path.lexists(self.path / STUDY_JSON)
        if known and not resume:
            raise UsageError(
                f"{self.path}: holds a study already; --resume continues it, --out names another"
            )
        self._record = StudyRecord.model_validate_json(text)
        if known:
            head = self.head
            if head.study_sha256 != self._record.study_sha256:
                raise UsageError(
                    f"{self.path}: holds another study or another version of it "
                    f"(made of {head.study}), or an encounter file has changed since; results "
                    "of the two cannot be mixed"
                )
        self.part_names()
        self._remove_abandoned_files()
        path = self.path / STUDY_JSON
        if not known or read_regular_file(path) != text.encode():  # as an older version wrote it
            self.write_file(STUDY_JSON, text.encode())

    def _remove_abandoned_files(self) -> None:
        """Remove temporary files left behind by processes that were killed while writing."""
        earlier = r"\.(part-|study\.json|summary\.|differences\.|figure-|scatter-).*\.\d+"
        ours = re.compile(rf"{re.escape(PREFIX)}[0-9a-f]{{12}}|{earlier}")
        for folder in (self.parts, self.path):
            for left in folder.iterdir():
                if ours.fullmatch(left.name):
                    with suppress(OSError):
                        left.unlink()

    @property
    def head(self) -> StudyHead:
        """File name and hash of the study that the folder holds."""
        return self._read_head(StudyHead)

    @property
    def record(self) -> StudyRecord:
        """The record of the study that the folder holds, read once."""
        if self._record is None:
            self._record = self._read_head(StudyRecord)
        return self._record

    def _read_head(self, model: type[_Head]) -> _Head:
        path = self.path / STUDY_JSON
        if not os.path.lexists(path):
            raise UsageError(f"{self.path}: is not the folder of a study: it has no {STUDY_JSON}")
        try:
            return model.model_validate_json(read_regular_file(path, _MOST_JSON_BYTES))
        except OSError as error:
            raise UsageError(f"{path}: cannot be read: {error.strerror}") from None
        except ValidationError as error:
            what = "is damaged, or not of a study"
            first = error.errors(include_url=False, include_context=False, include_input=False)[0]
            if first["loc"]:
                key = ".".join(map(str, first["loc"]))
                what += f" of this version of dsa_des ({key}: {first['msg']})"
            raise UsageError(f"{path}: {what}") from None
        except (RecursionError, MemoryError):
            raise UsageError(f"{path}: is damaged, or not of a study") from None

    # -- parts -----------------------------------------------------------------------------

    def part_names(self) -> list[str]:
        """Return the sorted names of the part files in the folder, whether readable or not."""
        if self.parts.is_symlink():
            raise UsageError(f"{self.parts}: is a link; the parts of a study are in a folder")
        try:
            files = sorted(e.name for e in self.parts.iterdir() if e.name.endswith(".parquet"))
        except OSError:
            return []
        for file in files:
            if _PART.fullmatch(file) is None and not file.startswith("."):
                raise UsageError(f"{self.parts / file}: is no part of a study; move it away")
        return [file.removesuffix(".parquet") for file in files if not file.startswith(".")]

    def part(self, name: str, columns: Sequence[str] | None = None) -> "pa.Table | None":
        """Return a part's table; None if it is missing, damaged, or belongs to another study.

        Only some `columns` are read of a part that was checked before.
        """
        table = self._read_sealed(self.parts / f"{name}.parquet", name, columns)
        table = None if table is None else table.replace_schema_metadata(None)
        whole = table is None or columns is not None or _matches_record(table, self.record)
        return table if whole else None

    def _read_sealed(
        self, path: Path, name: str, columns: Sequence[str] | None
    ) -> "pa.Table | None":
        import pyarrow as pa
        import pyarrow.parquet as pq

        try:
            content = read_regular_file(path)
            if not is_sealed(content, self._seal_text(name)):
                return None
            return pq.read_table(io.BytesIO(content), columns=columns)
        except (OSError, MemoryError, pa.ArrowException):
            return None

    def failure_counts(self, names: Iterable[str] | None = None) -> FailureCounts:
        """Return block → kind of failure → (failed, attempts), summed over named or all parts."""
        parts = []
        for name in self.part_names() if names is None else names:
            table = self._read_sealed(self.parts / f"{name}.parquet", name, ["cell"])
            parts.append({} if table is None else failure_counts_of_part(table))
        return sum_failure_counts(parts)

    @property
    def parts_destination(self) -> Parts:
        """The absolute folder and study's hash, with which any process can write parts of it."""
        return Parts(self.path.resolve(), self.record.study_sha256)

    def remove_part(self, name: str) -> None:
        """Remove a part that no longer belongs to the study."""
        (self.parts / f"{name}.parquet").unlink(missing_ok=True)

    def _seal_text(self, name: str) -> str:
        return f"{self.record.study_sha256} {name}"

    def results(self) -> "pa.Table":
        """Return the rows of all parts, in order of cell and replica.

        All of them are in memory then; `dsa_des.results.rows` reads them part by part.
        """
        import pyarrow as pa

        table = pa.concat_tables(list(self.each_part()))
        return table.sort_by([("cell", "ascending"), ("replica", "ascending")]).combine_chunks()

    def each_part(
        self, before_round: int | None = None, columns: Sequence[str] | None = None
    ) -> Iterator["pa.Table"]:
        """Yield parts' tables by name (only rounds below `before_round`, only `columns`, if given);
        UsageError at the end if any was unreadable.

        Only those of rounds before one, and only some columns of parts checked before.
        """
        names = self.part_names()
        if before_round is not None:
            names = [name for name in names if int(name.split("-")[1]) < before_round]
        if not names:
            raise UsageError(f"{self.path}: holds no results yet")
        damaged = []
        for name in names:
            table = self.part(name, columns)
            if table is None:
                damaged.append(f"{name}.parquet")
            else:
                yield table
        if damaged:
            shown = ", ".join(damaged[:_MOST_NAMED])
            if len(damaged) > _MOST_NAMED:
                shown += f" and {len(damaged) - _MOST_NAMED} more"
            raise UsageError(
                f"{self.parts}: cannot be read: {shown}; --resume writes damaged parts anew, "
                "those of another study must be moved away"
            )

    # -- other files -----------------------------------------------------------------------

    def write_file(self, name: str, content: bytes) -> None:
        """Write a file beside the parts in a single step."""
        write_file(self.path / name, content, to_disk=True)

    def write_table(self, name: str, content: bytes) -> None:
        """Write a table beside the parts, sealed as one of this study."""
        self.write_file(name, seal_parquet(content, self._seal_text(name)))

    def table(self, name: str) -> "pa.Table | None":
        """Return a table beside the parts; None if it is missing or belongs to another study."""
        table = self._read_sealed(self.path / name, name, None)
        return None if table is None else table.replace_schema_metadata(None)


def failure_counts_of_part(table: "pa.Table") -> FailureCounts:
    """Return block → kind of failure → (failed, attempts) in a part's runs, from its metadata."""
    text = (table.schema.metadata or {}).get(ABOUT, b"{}")
    with suppress(ValueError, RecursionError):
        found = json.loads(text)
        return {
            str(block): {str(what): (int(n), int(of)) for what, (n, of) in counts.items()}
            for block, counts in found.items()
        }
    return {}


#: How many damaged parts a message names.
_MOST_NAMED = 10


def _matches_record(table: "pa.Table", record: StudyRecord) -> bool:
    """Return whether a part has the study's columns, cells in range, and identifies every run."""
    import pyarrow.compute as pc

    if not table.schema.equals(record.schema_of_parts()):
        return False
    axes = [axis.column for axis in record.axes]
    if any(table[name].null_count for name in ("cell", "replica", "seed", "status", *axes)):
        return False
    if any(not pc.all(pc.is_finite(table[a.column])).as_py() for a in record.axes if a.numeric):
        return False
    cells = pc.min_max(table["cell"]).as_py()
    return table.num_rows > 0 and cells["min"] >= 0 and cells["max"] < record.cells


def latest_folder(parent: Path, stem: str) -> Path | None:
    """Return the ``parent/stem-NNN`` with the highest number; None if there is none."""
    form = re.compile(re.escape(stem) + r"-(\d{3,})")
    try:
        names = [entry.name for entry in parent.iterdir() if form.fullmatch(entry.name)]
    except OSError:
        return None
    return parent / max(names, key=lambda name: int(name[len(stem) + 1 :])) if names else None
