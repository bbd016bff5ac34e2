"""Writing a file as a whole or not at all, and never through a link."""

import json
import os
import shutil
import stat
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, BinaryIO

from dsa_des.errors import UsageError
from dsa_des.files.output_names import reason_name_is_unusable, system_error_text
from dsa_des.terminal.interruption import defer_signals

#: Endings of the pictures that are drawn.
PICTURES = (".png",)
#: Folders of the system, in which names stand for something else: ``/dev/stdout`` is a link that
#: may well lead to an ordinary file, and must not be replaced all the same.
_SYSTEM = ("/dev", "/proc", "/sys")
_ORDINARY = ("/dev/shm",)


def write_file(path: Path, content: bytes, *, to_disk: bool = False) -> None:
    """Write a file under a temporary name, then rename it; a failure leaves nothing behind.

    A link that stands there is replaced; what it points to stays as it is. `to_disk` has the
    content on the disk before it takes its name, so that it is whole even after a loss of power.
    """
    with stream_file(path) as stream:
        stream.write(content)
        if to_disk:
            stream.flush()
            os.fsync(stream.fileno())


@contextmanager
def stream_file(path: Path) -> Iterator[BinaryIO]:
    """Yield a file to write; it is named `path` only if the context ends without an error."""
    temporary = unused_temporary_path(path)
    try:
        with open(temporary, "xb") as stream:
            yield stream
        os.replace(temporary, path)
    except BaseException as error:
        with suppress(OSError):
            temporary.unlink()
        if isinstance(error, OSError) and error.errno is not None:
            raise OSError(error.errno, os.strerror(error.errno), str(path)) from error
        raise


def check_file_writable(path: Path, option: str = "--out") -> None:
    """Raise UsageError unless a file can be written at `path`; called before work begins.

    Files that a killed process has left half-written beside it are removed.
    """
    if reason := reason_name_is_unusable(path):
        raise UsageError(f"{option} {path}: {reason}")
    try:
        if not path.parent.is_dir():
            raise UsageError(f"{option} {path}: there is no folder {path.parent}")
        if reason := _refusal_of_file(path):
            raise UsageError(f"{option} {path}: {reason}; the name of a file is needed")
        remove_abandoned_temporary_files(path.parent)
        trial = unused_temporary_path(path)
        with open(trial, "xb"):
            pass
        trial.unlink()
    except OSError as error:
        raise UsageError(
            f"{option} {path}: cannot be written: {system_error_text(error)}"
        ) from error


def check_file_ending(path: Path, endings: Sequence[str], option: str = "--out") -> None:
    """Raise UsageError unless the name of a file has one of the given endings."""
    if path.suffix.lower() not in endings:
        meant = "" if path.suffix else f"; {path.name}{endings[0]} would do"
        raise UsageError(
            f"{option} {path}: a name that ends in {' or '.join(endings)} is needed{meant}"
        )


def _refusal_of_file(path: Path) -> str | None:
    """Return why no file may be written here (system folder, folder, device, pipe), or None."""
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


try:
    import fcntl
except ImportError:  # no such locks on this system: nothing is taken for left over
    fcntl = None  # type: ignore[assignment]

#: How the names of unfinished files and folders begin.
PREFIX = ".dsa_des-"
#: What an unfinished folder holds besides its lock: an earlier result that is about to be replaced.
EARLIER = "earlier"
_LOCK = "lock"
_WHAT = "results that are not finished"
_TRIES = 100
#: Nothing takes so long to write a file that is in memory.
_OLD_S = 3600.0


@contextmanager
def temporary_folder(target: Path) -> Iterator[Path]:
    """Yield an empty temporary folder beside `target`, on its file system; removed at the end.

    Parents of `target` that do not exist are made; those that are empty at the end are removed.
    """
    made = [parent for parent in target.parents if not os.path.lexists(parent)]
    folder: Path | None = None
    lock: int | None = None
    try:
        with defer_signals():
            remove_abandoned_temporary_files(target.parent)
            folder, lock = _make_locked_temporary_folder(target)
        yield folder
    finally:
        with defer_signals():
            if folder is not None:
                shutil.rmtree(folder, ignore_errors=True)
            if lock is not None:
                os.close(lock)
            for parent in made:  # the deepest first
                with suppress(OSError):
                    parent.rmdir()


def unused_temporary_path(path: Path) -> Path:
    """Return a random unused path in the folder of `path`, for a file that is not finished."""
    return path.parent / f"{PREFIX}{os.urandom(6).hex()}"


def _make_locked_temporary_folder(target: Path) -> tuple[Path, int | None]:
    for _ in range(_TRIES):
        target.parent.mkdir(parents=True, exist_ok=True)
        try:
            folder = unused_temporary_path(target)
            folder.mkdir(0o700)
            lock = os.open(folder / _LOCK, os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o600)
        except FileNotFoundError:  # a clean-up took the folder or its parent away
            continue
        try:
            os.write(lock, json.dumps(_temporary_folder_marker(target)).encode())
            if try_lock_file(lock) is False or not _is_same_file(lock, folder / _LOCK):
                os.close(lock)
                continue
        except BaseException:
            os.close(lock)
            shutil.rmtree(folder, ignore_errors=True)
            raise
        return folder, lock
    raise FileNotFoundError(f"no folder can be made in {target.parent}")


def _temporary_folder_marker(target: Path) -> dict[str, Any]:
    return {"dsa_des": _WHAT, "host": _host_name(), "target": target.name}


def _host_name() -> str:
    return os.uname().nodename if hasattr(os, "uname") else ""


def try_lock_file(file: int) -> bool | None:
    """Lock an open file without waiting; return True, False if taken, None if impossible."""
    if fcntl is None:
        return None
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:
        return None
    return True


def _is_same_file(file: int, path: Path) -> bool:
    try:
        return os.path.samestat(os.fstat(file), os.stat(path, follow_symlinks=False))
    except OSError:
        return False


def remove_abandoned_temporary_files(parent: Path) -> None:
    """Remove temporary items in `parent` left by this user's killed processes on this machine."""
    if fcntl is None:
        return
    with suppress(OSError):
        for entry in [e for e in os.scandir(parent) if e.name.startswith(PREFIX)]:
            about = entry.stat(follow_symlinks=False)
            if about.st_uid != os.geteuid():
                continue
            with suppress(OSError):
                if entry.is_dir(follow_symlinks=False):
                    _remove_abandoned_folder(Path(entry.path))
                elif time.time() - about.st_mtime > _OLD_S:
                    os.unlink(entry.path)


def _remove_abandoned_folder(folder: Path) -> None:
    try:
        lock = os.open(folder / _LOCK, os.O_RDWR | os.O_NOFOLLOW | os.O_NONBLOCK)
    except FileNotFoundError:
        folder.rmdir()  # its maker was killed at once, or makes another one
        return
    try:
        if not try_lock_file(lock):
            return
        content = os.read(lock, 1 << 16)
        if not content and os.listdir(folder) == [_LOCK]:
            shutil.rmtree(folder, ignore_errors=True)
            return
        about = json.loads(content)
        if about["dsa_des"] != _WHAT or about["host"] != _host_name():
            return
        back = folder.parent / Path(about["target"]).name
        if (folder / EARLIER).is_dir() and not os.path.lexists(back):
            (folder / EARLIER).rename(back)
        shutil.rmtree(folder, ignore_errors=True)
    except (ValueError, KeyError, TypeError):
        return  # not made by us
    finally:
        os.close(lock)
