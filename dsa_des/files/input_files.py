"""Opening what a user named as a file: regular files of a bearable size, and nothing else.

A pipe would wait for ever, a device never ends, and a name may be no name at all; all of it is
checked before a byte is read.
"""

import os
import stat
from collections.abc import Callable
from functools import lru_cache, wraps
from pathlib import Path
from typing import Any

#: Files of tables and traffic; a day of dense traffic is a tenth of it.
LARGEST_BYTES = 512 * 1024 * 1024
#: Files in TOML, which is read at about a megabyte per second.
LARGEST_TOML_BYTES = 256 * 1024 * 1024

_KINDS = (
    (stat.S_ISDIR, "a folder"),
    (stat.S_ISFIFO, "a pipe"),
    (stat.S_ISSOCK, "a socket"),
    (stat.S_ISCHR, "a device"),
    (stat.S_ISBLK, "a device"),
)


class InputFileError(ValueError):
    """A named file cannot be read; the message says why, without its name."""


class NoSuchFile(InputFileError):
    """There is no file of that name."""


class NotText(InputFileError):
    """A file holds something else than text in UTF-8."""


def resolve_home(text: str) -> Path:
    """Return a text as path with leading ``~`` as home folder; InputFileError if impossible."""
    if "\0" in text:
        raise InputFileError("holds a NUL character: no file can have such a name")
    try:
        return Path(text).expanduser()
    except RuntimeError:
        user = text.split("/", 1)[0]
        raise InputFileError(f"there is no home folder of {user[:80]!r}") from None


def readable_file_status(path: Path, largest_bytes: int = LARGEST_BYTES) -> os.stat_result:
    """Return a regular file's status; InputFileError if it cannot be read or is too large."""
    try:
        status = path.stat()
    except FileNotFoundError:
        raise NoSuchFile("there is no such file") from None
    except ValueError:
        raise InputFileError("holds a NUL character: no file can have such a name") from None
    except OSError as error:
        raise InputFileError(f"cannot be read: {_read_error_text(error)}") from None
    if not stat.S_ISREG(status.st_mode):
        kind = next((what for is_kind, what in _KINDS if is_kind(status.st_mode)), "no file")
        raise InputFileError(f"is {kind}: a regular file is needed")
    if status.st_size > largest_bytes:
        raise InputFileError(
            f"holds {status.st_size / 2**20:,.0f} MB: at most {largest_bytes / 2**20:,.0f} MB "
            "are read"
        )
    return status


def read_input_bytes(path: Path, largest_bytes: int = LARGEST_BYTES) -> bytes:
    """Return a regular file's content; InputFileError if unreadable or too large."""
    size = readable_file_status(path, largest_bytes).st_size
    try:
        with path.open("rb") as file:
            content = file.read(size + 1)
            if len(content) != size:  # those of /proc say that they are empty and are not
                content += file.read(largest_bytes)
    except OSError as error:
        raise InputFileError(f"cannot be read: {_read_error_text(error)}") from None
    if len(content) > largest_bytes:
        raise InputFileError(f"holds more than {largest_bytes / 2**20:,.0f} MB")
    return content


def read_input_text(path: Path, largest_bytes: int = LARGEST_BYTES) -> str:
    """Return the text of a regular file in UTF-8, with or without a byte-order mark."""
    try:
        text = read_input_bytes(path, largest_bytes).decode("utf-8-sig")
    except UnicodeDecodeError:
        raise NotText("is not a text file in UTF-8") from None
    if "\0" in text:
        raise NotText("is not a text file: it holds NUL characters")
    return text.replace("\r\n", "\n")


def cache_file_reads(most: int) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Return a decorator for a file reader: it keeps the results of the `most` last read files.

    A file, or several in a tuple, is read again when its size or the time of its last change is
    another; one without status is read, so that the reader says what is wrong with it.
    """

    def keeping(read: Callable[..., Any]) -> Callable[..., Any]:
        kept = lru_cache(most)(lambda state, path, *more, **named: read(path, *more, **named))

        @wraps(read)
        def again(path: Path | tuple[Path, ...], *more: Any, **named: Any) -> Any:
            paths = path if isinstance(path, tuple) else (path,)
            try:
                states = tuple(one.stat() for one in paths)
            except (OSError, ValueError):
                return read(path, *more, **named)
            state = tuple((one.st_mtime_ns, one.st_size) for one in states)
            return kept(state, path, *more, **named)

        return again

    return keeping


def is_regular_file(path: Path) -> bool:
    """Return whether a path is a regular file; False also for a text that cannot be a path."""
    try:
        return path.is_file()
    except (OSError, ValueError, RuntimeError):
        return False


def is_folder(path: Path) -> bool:
    """Return whether a path is a folder; False also for a text that cannot be a path."""
    try:
        return path.is_dir()
    except (OSError, ValueError, RuntimeError):
        return False


def _read_error_text(error: OSError) -> str:
    return (error.strerror or type(error).__name__).lower()
