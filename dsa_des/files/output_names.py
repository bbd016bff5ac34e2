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
    """Return a typed path with ``~`` as the home folder; UsageError if it cannot be a path."""
    if not text.strip():
        raise UsageError(f"{option} {text!r}: is empty; a name is needed")
    if reason := reason_name_is_unusable(text):
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


def reason_name_is_unusable(path: str | Path) -> str | None:
    """Return why no file can have this name, or None if one can."""
    text = os.fspath(path)
    if "\0" in text:
        return "a name cannot hold the character NUL"
    try:
        text.encode()
    except UnicodeEncodeError:
        return "is not UTF-8 text"
    return None


def system_error_text(error: OSError) -> str:
    """Return the text of a system error without the file names that it may contain."""
    return os.strerror(error.errno) if error.errno else str(error)


def describe_write_error(error: OSError, path: Path) -> str:
    """Return the reason why a file or folder could not be written at `path`.

    Some file systems (``/proc``) take no folder and call it missing: what is there is named.
    """
    if error.errno != errno.ENOENT or path.exists():
        return system_error_text(error)
    there = next(parent for parent in path.absolute().parents if os.path.lexists(parent))
    return f"no folder can be made in {there}"


def new_folder_name(parent: Path, stem: str) -> Path:
    """Return the first of ``parent/stem-001``, ``-002``, ... that does not exist."""
    number = 1
    while os.path.lexists(parent / f"{stem}-{number:03d}"):
        number += 1
    return parent / f"{stem}-{number:03d}"


def make_numbered_folder(parent: Path, stem: str) -> Path:
    """Make the first missing one of ``parent/stem-001``, ``-002``, ... and return its path.

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
    """Return a folder's absolute path, with links resolved in its parents but not itself."""
    if folder.name in ("", ".."):
        return Path(os.path.realpath(folder))
    return Path(os.path.realpath(folder.parent)) / folder.name


def check_folder_path(folder: Path, option: str = "--out") -> None:
    """Raise UsageError unless a folder can be made at this path or there is one already.

    What is in a folder that is there is not looked at.
    """
    if reason := reason_name_is_unusable(folder):
        raise UsageError(f"{option} {folder}: {reason}")
    try:
        if ".." in folder.parts:
            folder.parent.lstat()  # it must be there: .. leads out of nothing that is not
        reason = _folder_path_refusal(absolute_location(folder))
    except OSError as error:
        reason = f"cannot be written: {system_error_text(error)}"
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
    """Raise OSError if the path, or a long file name inside it, is too long for the system."""
    there = next(parent for parent in (location, *location.parents) if os.path.lexists(parent))
    parts = location.relative_to(there).parts
    for path in (*(there / part for part in parts), location / ("x" * _LONGEST_INSIDE)):
        with suppress(FileNotFoundError):
            path.lstat()


def _protected_folders() -> list[tuple[str, Path]]:
    """Return (description, path) of the folders never replaced: working directory and home."""
    home = os.path.realpath(os.path.expanduser("~"))
    return [("the working directory", Path.cwd()), ("your home folder", Path(home))]


def _mount_points() -> set[str]:
    """Return the paths of all mount points, also of those on the same device."""
    try:
        lines = _MOUNTS.read_text(encoding="utf-8", errors="surrogateescape").splitlines()
    except OSError:
        return set()
    fields = [line.split()[4] for line in lines if len(line.split()) > 4]
    return {re.sub(r"\\(\d{3})", lambda code: chr(int(code[1], 8)), field) for field in fields}
