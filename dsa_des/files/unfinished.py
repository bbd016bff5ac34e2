"""Folders for results that are not finished, and what becomes of those of killed processes.

Such a folder stands beside where the results will be. Its maker holds a lock on a file in it for
as long as it lives; a folder whose lock is free was left by a process that was killed, and the
next command that writes to the same place removes it.
"""

import json
import os
import shutil
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from dsa_des.terminal.interruption import deferred

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
def unfinished(target: Path) -> Iterator[Path]:
    """Give an empty folder beside `target`, on the same file system; it is gone afterwards.

    Parents of `target` that do not exist are made; those that are empty at the end are removed.

    Raises
    ------
    OSError
        If there is no place for it.
    """
    made = [parent for parent in target.parents if not os.path.lexists(parent)]
    folder: Path | None = None
    lock: int | None = None
    try:
        with deferred():
            remove_left_over(target.parent)
            folder, lock = _new_folder(target)
        yield folder
    finally:
        with deferred():
            if folder is not None:
                shutil.rmtree(folder, ignore_errors=True)
            if lock is not None:
                os.close(lock)
            for parent in made:  # the deepest first
                with suppress(OSError):
                    parent.rmdir()


def temporary_beside(path: Path) -> Path:
    """Return a name beside `path` that nothing has, for what is not finished."""
    return path.parent / f"{PREFIX}{os.urandom(6).hex()}"


def _new_folder(target: Path) -> tuple[Path, int | None]:
    for _ in range(_TRIES):
        target.parent.mkdir(parents=True, exist_ok=True)
        try:
            folder = temporary_beside(target)
            folder.mkdir(0o700)
            lock = os.open(folder / _LOCK, os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o600)
        except FileNotFoundError:  # a clean-up took the folder or its parent away
            continue
        try:
            os.write(lock, json.dumps(_about(target)).encode())
            if _locked(lock) is False or not _is_at(lock, folder / _LOCK):
                os.close(lock)
                continue
        except BaseException:
            os.close(lock)
            shutil.rmtree(folder, ignore_errors=True)
            raise
        return folder, lock
    raise FileNotFoundError(f"{target.parent} is removed again and again")


def _about(target: Path) -> dict[str, Any]:
    return {"dsa_des": _WHAT, "host": _host(), "target": target.name}


def _host() -> str:
    return os.uname().nodename if hasattr(os, "uname") else ""


def _locked(file: int) -> bool | None:
    """Lock an open file; False if another process has it, None if it cannot be locked at all."""
    if fcntl is None:
        return None
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:
        return None
    return True


def _is_at(file: int, path: Path) -> bool:
    try:
        return os.path.samestat(os.fstat(file), os.stat(path, follow_symlinks=False))
    except OSError:
        return False


def remove_left_over(parent: Path) -> None:
    """Remove what killed processes of this user on this machine have left in a folder."""
    if fcntl is None:
        return
    with suppress(OSError):
        for entry in [e for e in os.scandir(parent) if e.name.startswith(PREFIX)]:
            about = entry.stat(follow_symlinks=False)
            if about.st_uid != os.geteuid():
                continue
            with suppress(OSError):
                if entry.is_dir(follow_symlinks=False):
                    _remove_if_left_over(Path(entry.path))
                elif time.time() - about.st_mtime > _OLD_S:
                    os.unlink(entry.path)


def _remove_if_left_over(folder: Path) -> None:
    try:
        lock = os.open(folder / _LOCK, os.O_RDWR | os.O_NOFOLLOW | os.O_NONBLOCK)
    except FileNotFoundError:
        folder.rmdir()  # its maker was killed at once, or makes another one
        return
    try:
        if not _locked(lock):
            return
        content = os.read(lock, 1 << 16)
        if not content and os.listdir(folder) == [_LOCK]:
            shutil.rmtree(folder, ignore_errors=True)
            return
        about = json.loads(content)
        if about["dsa_des"] != _WHAT or about["host"] != _host():
            return
        back = folder.parent / Path(about["target"]).name
        if (folder / EARLIER).is_dir() and not os.path.lexists(back):
            (folder / EARLIER).rename(back)
        shutil.rmtree(folder, ignore_errors=True)
    except (ValueError, KeyError, TypeError):
        return  # not made by us
    finally:
        os.close(lock)
