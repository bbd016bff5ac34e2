"""Names for results: what the user wrote after ``--out``, or the next free number.

Everything about a name that can be known is found out before a run begins: a run that has taken
an hour must not fail because it cannot be written.
"""

import errno
import os
import re
import stat
from contextlib import suppress
from pathlib import Path

from dsa_des.errors import UsageError

#: Longest name of a file in a folder of results; figures and tables have shorter ones.
_LONGEST_INSIDE = 64
_MOUNTS = Path("/proc/self/mountinfo")


def user_path(text: str, option: str = "--out") -> Path:
    """Return the path that a user wrote, with ``~`` for the home folder."""
    if not text.strip():
        raise UsageError(f"{option} {text!r}: is empty; a name is needed")
    if reason := name_refusal(text):
        raise UsageError(f"{option} {text!r}: {reason}")
    if not text.startswith("~"):
        return Path(text)
    try:
        return Path(text).expanduser()
    except RuntimeError:
        raise UsageError(
            f"{option} {text}: there is no home folder of that name; ./{text} is a name in the "
            "working directory"
        ) from None


def name_refusal(path: str | Path) -> str | None:
    """Return why no file can have this name, if so."""
    text = os.fspath(path)
    if "\0" in text:
        return "a name cannot hold the character NUL"
    try:
        text.encode()
    except UnicodeEncodeError:
        return "is not UTF-8 text"
    return None


def reason_of(error: OSError) -> str:
    """Return what an error of the system says, without the names that it may hold."""
    return os.strerror(error.errno) if error.errno else str(error)


def describe_write_error(error: OSError, path: Path) -> str:
    """Return the reason of a system error at a path that was to be made or written into.

    Some file systems (``/proc``) take no folder and call it missing: what is there is named.
    """
    if error.errno != errno.ENOENT or path.exists():
        return reason_of(error)
    there = next(parent for parent in path.absolute().parents if os.path.lexists(parent))
    return f"no folder can be made in {there}"


def new_folder_name(parent: Path, stem: str) -> Path:
    """Return the first of ``parent/stem-001``, ``-002``, ... that does not exist."""
    number = 1
    while os.path.lexists(parent / f"{stem}-{number:03d}"):
        number += 1
    return parent / f"{stem}-{number:03d}"


def claim_folder(parent: Path, stem: str) -> Path:
    """Make the first of ``parent/stem-001``, ... that does not exist, and return it.

    Of processes that do so at once each gets a folder of its own.
    """
    while True:
        folder = new_folder_name(parent, stem)
        try:
            parent.mkdir(parents=True, exist_ok=True)
            folder.mkdir()
        except FileExistsError:
            if os.path.lexists(folder):  # another process was faster
                continue
            raise UsageError(f"{parent}: is no folder") from None
        except OSError as error:
            why = describe_write_error(error, folder)
            raise UsageError(f"{folder}: cannot be written: {why}") from error
        return folder


def absolute_location(folder: Path) -> Path:
    """Return where a folder is, without links above it, whatever the working directory becomes."""
    if folder.name in ("", ".."):
        return Path(os.path.realpath(folder))
    return Path(os.path.realpath(folder.parent)) / folder.name


def check_folder_path(folder: Path, option: str = "--out") -> None:
    """Raise UsageError unless a folder can be made at this path, or one is there to be used.

    What is in a folder that is there is not looked at.
    """
    if reason := name_refusal(folder):
        raise UsageError(f"{option} {folder}: {reason}")
    try:
        if ".." in folder.parts:
            folder.parent.lstat()  # it must be there: .. leads out of nothing that is not
        reason = _folder_path_refusal(absolute_location(folder))
    except OSError as error:
        reason = f"cannot be written: {reason_of(error)}"
    if reason is not None:
        raise UsageError(f"{option} {folder}: {reason}")


def _folder_path_refusal(path: Path) -> str | None:
    try:
        kind = path.lstat().st_mode
    except FileNotFoundError:
        _raise_if_too_long(path)
        return None
    if stat.S_ISLNK(kind):
        return f"is a symbolic link to {os.readlink(path)}; name a folder"
    if not stat.S_ISDIR(kind):
        return "is a file; a folder name is needed"
    for what, kept in _protected_folders():
        if path == kept or path in kept.parents:
            return f"{'is' if path == kept else 'holds'} {what}; name a folder inside it"
    if os.path.ismount(path) or str(path) in _mount_points():
        return "is a mount point; name a folder inside it"
    effective = os.access in os.supports_effective_ids
    if not os.access(path, os.R_OK | os.W_OK | os.X_OK, effective_ids=effective):
        return "cannot be written: Permission denied"
    _raise_if_too_long(path)
    return None


def _raise_if_too_long(location: Path) -> None:
    """Raise OSError if the system refuses a part of the path, or names inside it."""
    there = next(parent for parent in (location, *location.parents) if os.path.lexists(parent))
    parts = location.relative_to(there).parts
    for path in (*(there / part for part in parts), location / ("x" * _LONGEST_INSIDE)):
        with suppress(FileNotFoundError):
            path.lstat()


def _protected_folders() -> list[tuple[str, Path]]:
    """Return folders that are never replaced, and neither is what holds them."""
    home = os.path.realpath(os.path.expanduser("~"))
    return [("the working directory", Path.cwd()), ("your home folder", Path(home))]


def _mount_points() -> set[str]:
    """Return all mount points; ``os.path.ismount`` does not know those of the same device."""
    try:
        lines = _MOUNTS.read_text(encoding="utf-8", errors="surrogateescape").splitlines()
    except OSError:
        return set()
    fields = [line.split()[4] for line in lines if len(line.split()) > 4]
    return {re.sub(r"\\(\d{3})", lambda code: chr(int(code[1], 8)), field) for field in fields}
