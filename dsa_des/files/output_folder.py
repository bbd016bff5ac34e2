"""The list of files in a folder that are ours: only they may be replaced or deleted.

``run.json`` lists every file that was written with it, each with a digest. Whatever is not in
that list, or is no longer as it was written, belongs to the user.
"""

import hashlib
import json
import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from dsa_des.errors import OutputError, UsageError
from dsa_des.files.output_file import EARLIER, temporary_folder
from dsa_des.files.output_names import (
    absolute_location,
    check_folder_path,
    describe_write_error,
    make_numbered_folder,
    new_folder_name,
    system_error_text,
    user_path,
)
from dsa_des.terminal.interruption import defer_signals

#: A run folder's own description: its version, its scene, and all its files.
RUN_JSON = "run.json"
_FILES = "files"
_MOST_READ = 1 << 20


def content_with_file_digests(folder: Path, content: dict[str, Any]) -> dict[str, Any]:
    """Return the content of ``run.json`` with a digest of every file that is in the folder now."""
    files = {
        name: _quick_digest(folder / name) for name in _file_names_below(folder) if name != RUN_JSON
    }
    return {**content, _FILES: files}


def foreign_or_changed_files(folder: Path) -> list[str]:
    """Return, sorted, a folder's files that dsa_des did not write or that changed since.

    All of it if the folder holds no ``run.json`` of ours; nothing if it is empty. A file that was
    changed since is not what we wrote.
    """
    names = list(_file_names_below(folder))
    files = _read_file_digests(folder / RUN_JSON)
    if files is None:
        return names
    return [
        name
        for name in names
        if name != RUN_JSON and (name not in files or files[name] != _quick_digest(folder / name))
    ]


def _read_file_digests(path: Path) -> dict[str, str] | None:
    try:
        if not stat.S_ISREG(path.lstat().st_mode):
            return None
        content = json.loads(path.read_text(encoding="utf-8"))
    except (FileNotFoundError, ValueError, RecursionError):
        return None
    files = content.get(_FILES) if isinstance(content, dict) else None
    return files if isinstance(files, dict) else None


def _file_names_below(folder: Path) -> Iterator[str]:
    """Yield names, relative to the folder, of all files and empty folders below it, sorted."""
    for entry in sorted(os.scandir(folder), key=lambda entry: entry.name):
        inside = None
        if entry.is_dir(follow_symlinks=False):
            inside = [f"{entry.name}/{name}" for name in _file_names_below(Path(entry.path))]
        yield from inside or [entry.name]


def _quick_digest(path: Path) -> str:
    """Return a SHA-256 of a file's length and first MiB; ``no file`` if it is no regular file.

    Tables may be larger than memory; an edit of one changes its length or its beginning.
    """
    about = path.lstat()
    if not stat.S_ISREG(about.st_mode):
        return "no file"
    with path.open("rb") as file:
        beginning = file.read(_MOST_READ)
    return hashlib.sha256(b"%d " % about.st_size + beginning).hexdigest()


_MOST_SHOWN = 3
_RESULTS = "results"


class OutputFolder:
    """The folder that a command writes its results into.

    It is a new or empty one at `path`, or takes the place of earlier results; with a `stem`, the
    next free ``stem-NNN`` in `path`. Of two commands at once each may expect the same number: once
    the results are written, `path` is where they are.
    """

    def __init__(self, path: Path, stem: str | None = None) -> None:
        self._home, self._stem = path, stem
        self.path = path if stem is None else new_folder_name(path, stem)

    @classmethod
    def from_option(cls, out: str | None, parent: Path, stem: str) -> "OutputFolder":
        """Return the results folder that ``--out`` names, or the next free ``parent/stem-NNN``."""
        return cls(parent, stem) if out is None else cls(user_path(out))

    def check(self) -> None:
        """Raise UsageError unless the results can be written to this folder."""
        check_folder_path(self.path)
        if self._stem is None and (reason := _reason_not_to_replace(absolute_location(self.path))):
            raise UsageError(f"--out {self.path}: {reason}; choose a new name")

    @contextmanager
    def write_then_rename(self) -> Iterator[Path]:
        """Yield a temporary folder for results; it is renamed at the end if there is no error.

        When the block raises, nothing is left behind.
        """
        self.check()
        path = absolute_location(self.path)
        before = _folder_fingerprint(path)
        ready = False
        try:
            with temporary_folder(path) as folder:
                results = folder / _RESULTS
                results.mkdir()
                ready = True
                yield results
                with defer_signals():
                    if self._stem is not None:
                        self._move_to_free_number(results, path.parent)
                    else:
                        self._replace_folder(results, path, before, folder / EARLIER)
        except BrokenPipeError:  # that of our output on the terminal
            raise
        except OSError as error:
            if not ready:
                why = describe_write_error(error, path)
                raise UsageError(f"--out {self.path}: cannot be written: {why}") from error
            raise OutputError(
                f"{self.path}: the results cannot be written: {system_error_text(error)}"
            ) from error

    def _move_to_free_number(self, results: Path, parent: Path) -> None:
        """Rename the finished results to the first free ``stem-NNN``."""
        assert self._stem is not None
        while True:
            self.path = new_folder_name(self._home, self._stem)
            path = parent / self.path.name
            try:
                results.rename(path)
            except OSError:
                if os.path.lexists(path):  # another process was faster
                    continue
                raise
            return

    def _replace_folder(
        self, results: Path, path: Path, before: tuple[int, ...] | None, earlier: Path
    ) -> None:
        """Give results their final name; replace earlier ones only if unchanged since the start."""
        reason: str | None = "has come to be there while the results were made"
        if _folder_fingerprint(path) is None:
            reason = None
        elif _folder_fingerprint(path) == before:
            reason = _move_earlier_results(path, earlier)
        if reason is None:
            try:
                results.rename(path)
                return
            except OSError as error:
                reason = f"cannot be replaced: {system_error_text(error)}"
                if earlier.exists():
                    with suppress(OSError):
                        earlier.rename(path)
        # A finished run is not thrown away because its place was taken.
        saved = new_folder_name(path.parent, path.name)
        results.rename(saved)
        wanted, self.path = self.path, self.path.with_name(saved.name)
        raise OutputError(f"--out {wanted}: {reason}; the results are in {self.path}")


@contextmanager
def make_results_folder(out: str | None, parent: Path, stem: str) -> Iterator[Path]:
    """Yield a new folder for results; it is removed when the context ends if it is still empty.

    It is what ``--out`` names, which must be new or empty, or the next free ``parent/stem-NNN``.
    """
    folder = parent / stem if out is None else user_path(out)
    made = [above for above in folder.parents if not os.path.lexists(above)]
    if out is None:
        folder = make_numbered_folder(parent, stem)
        made.insert(0, folder)
    elif _make_empty_folder(folder):
        made.insert(0, folder)
    try:
        yield folder
    finally:
        with defer_signals():
            for one in made:
                with suppress(OSError):
                    one.rmdir()


def _make_empty_folder(folder: Path) -> bool:
    """Make a folder and return True; False if there is an empty one; UsageError if it is filled."""
    try:
        if os.path.lexists(folder) and (not folder.is_dir() or any(folder.iterdir())):
            raise UsageError(f"--out {folder}: is there already; a new folder is needed")
        check_folder_path(folder)
        new = not folder.exists()
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        why = describe_write_error(error, folder)
        raise UsageError(f"--out {folder}: cannot be written: {why}") from error
    return new


def _move_earlier_results(path: Path, earlier: Path) -> str | None:
    """Move results from `path` to `earlier` and return None, or the reason if they must stay."""
    try:
        path.rename(earlier)
    except OSError as error:
        return f"cannot be replaced: {system_error_text(error)}"
    if reason := _reason_not_to_replace(earlier):
        earlier.rename(path)
    return reason


def _reason_not_to_replace(path: Path) -> str | None:
    """Return why a folder (with files dsa_des did not write) must not be replaced, or None."""
    if not os.path.lexists(path):
        return None
    try:
        foreign = foreign_or_changed_files(path)
    except OSError as error:
        return f"cannot be read: {system_error_text(error)}"
    if not foreign:
        return None
    shown = ", ".join(foreign[:_MOST_SHOWN])
    if len(foreign) > _MOST_SHOWN:
        shown += f" and {len(foreign) - _MOST_SHOWN} more"
    return f"is a folder that holds something other than a run: {shown}"


def _folder_fingerprint(path: Path) -> tuple[int, ...] | None:
    """Return numbers that change with a folder or its entries; None if there is no such folder."""
    try:
        about = path.lstat()
    except FileNotFoundError:
        return None
    return about.st_dev, about.st_ino, about.st_mtime_ns
