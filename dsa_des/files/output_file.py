"""Writing a file as a whole or not at all, and never through a link."""

import os
import stat
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from dsa_des.errors import UsageError
from dsa_des.files.output_names import reason_of, why_no_name
from dsa_des.files.unfinished import remove_left_over, temporary_beside

#: Endings of the pictures that are drawn.
PICTURES = (".png",)
#: Folders of the system, in which names stand for something else: ``/dev/stdout`` is a link that
#: may well lead to an ordinary file, and must not be replaced all the same.
_SYSTEM = ("/dev", "/proc", "/sys")
_ORDINARY = ("/dev/shm",)


def write_file(path: Path, content: bytes, *, to_disk: bool = False) -> None:
    """Write a file under a temporary name and rename it.

    A link that stands there is replaced; what it points to stays as it is.

    Parameters
    ----------
    path : Path
    content : bytes
    to_disk : bool
        Whether the content must be on the disk before it takes its name, so that it is whole even
        after a loss of power.

    Raises
    ------
    OSError
        If it cannot be written; nothing is left behind then.
    """
    temporary = temporary_beside(path)
    try:
        with open(temporary, "xb") as stream:
            stream.write(content)
            if to_disk:
                stream.flush()
                os.fsync(stream.fileno())
        os.replace(temporary, path)
    except BaseException as error:
        with suppress(OSError):
            temporary.unlink()
        if isinstance(error, OSError) and error.errno is not None:
            raise OSError(error.errno, os.strerror(error.errno), str(path)) from error
        raise


def check_file(path: Path, option: str = "--out") -> None:
    """Raise UsageError unless `path` can be written as a file; called before work begins.

    Files that a killed process has left half-written beside it are removed.
    """
    if reason := why_no_name(path):
        raise UsageError(f"{option} {path}: {reason}")
    try:
        if not path.parent.is_dir():
            raise UsageError(f"{option} {path}: there is no folder {path.parent}")
        if reason := _why_no_file(path):
            raise UsageError(f"{option} {path}: {reason}; the name of a file is needed")
        remove_left_over(path.parent)
        trial = temporary_beside(path)
        with open(trial, "xb"):
            pass
        trial.unlink()
    except OSError as error:
        raise UsageError(f"{option} {path}: cannot be written: {reason_of(error)}") from error


def check_ending(path: Path, endings: Sequence[str], option: str = "--out") -> None:
    """Raise UsageError unless a file's name ends as one of its kind does.

    Parameters
    ----------
    path : Path
    endings : sequence of str
        With their dots, in small letters; capitals will do as well.
    option : str
        That named it.
    """
    if path.suffix.lower() not in endings:
        meant = "" if path.suffix else f"; {path.name}{endings[0]} would do"
        raise UsageError(
            f"{option} {path}: a name that ends in {' or '.join(endings)} is needed{meant}"
        )


def _why_no_file(path: Path) -> str | None:
    """Return why a file must not take this place, if so; devices would be replaced by it."""
    folder = Path(os.path.realpath(path.parent))
    above = {str(one) for one in (folder, *folder.parents)}
    if above.intersection(_SYSTEM) and not above.intersection(_ORDINARY):
        return f"is in a folder of the system, {folder}"
    try:
        kind = path.stat().st_mode
    except FileNotFoundError:  # nothing there, or a link to nothing
        return None
    if stat.S_ISDIR(kind):
        return "is a folder"
    return None if stat.S_ISREG(kind) else "is a device or a pipe"
