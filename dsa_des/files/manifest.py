"""The list of files in a folder that are ours: only they may be replaced or deleted.

``run.json`` lists every file that was written with it, each with a digest. Whatever is not in
that list, or is no longer as it was written, belongs to the user.
"""

import hashlib
import json
import os
import stat
from collections.abc import Iterator
from pathlib import Path
from typing import Any

#: What a folder of results holds beside its tables: who made it, of what, and all its files.
RUN_JSON = "run.json"
_FILES = "files"
_MOST_READ = 1 << 20


def with_files(folder: Path, content: dict[str, Any]) -> dict[str, Any]:
    """Return the content of ``run.json`` with the list of all files that are in the folder."""
    files = {name: _digest(folder / name) for name in _names(folder) if name != RUN_JSON}
    return {**content, _FILES: files}


def foreign_in(folder: Path) -> list[str]:
    """Return what of a folder dsa_des did not write, by its name in the folder, sorted.

    All of it if the folder holds no ``run.json`` of ours; nothing if it is empty. A file that was
    changed since is not what we wrote.

    Raises
    ------
    OSError
        If it cannot be read.
    """
    names = list(_names(folder))
    files = _listed(folder / RUN_JSON)
    if files is None:
        return names
    return [
        name
        for name in names
        if name != RUN_JSON and (name not in files or files[name] != _digest(folder / name))
    ]


def _listed(path: Path) -> dict[str, str] | None:
    try:
        if not stat.S_ISREG(path.lstat().st_mode):
            return None
        content = json.loads(path.read_text(encoding="utf-8"))
    except (FileNotFoundError, ValueError, RecursionError):
        return None
    files = content.get(_FILES) if isinstance(content, dict) else None
    return files if isinstance(files, dict) else None


def _names(folder: Path) -> Iterator[str]:
    """Give the names of all files below a folder, and of folders that hold none, sorted."""
    for entry in sorted(os.scandir(folder), key=lambda entry: entry.name):
        inside = None
        if entry.is_dir(follow_symlinks=False):
            inside = [f"{entry.name}/{name}" for name in _names(Path(entry.path))]
        yield from inside or [entry.name]


def _digest(path: Path) -> str:
    """Return a digest of a file's length and its first MiB, or what it is instead of a file.

    Tables may be larger than memory; an edit of one changes its length or its beginning.
    """
    about = path.lstat()
    if not stat.S_ISREG(about.st_mode):
        return "no file"
    with path.open("rb") as file:
        beginning = file.read(_MOST_READ)
    return hashlib.sha256(b"%d " % about.st_size + beginning).hexdigest()
