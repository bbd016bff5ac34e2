"""Reading files of a folder that others may have filled: no link is followed, no pipe waited for.

A folder of results can come from a stranger, and its names may be links to files elsewhere.
"""

import os
import stat
from pathlib import Path

_NO_FOLLOW = getattr(os, "O_NOFOLLOW", 0)
_NO_WAIT = getattr(os, "O_NONBLOCK", 0)
_BINARY = getattr(os, "O_BINARY", 0)


def read_regular(path: Path, most: int | None = None) -> bytes:
    """Return the content of a file that is no link, folder, pipe or device.

    Parameters
    ----------
    path : Path
    most : int, optional
        Largest size, bytes.

    Raises
    ------
    OSError
        If it is no such file, too large, or cannot be read.
    """
    with os.fdopen(os.open(path, os.O_RDONLY | _NO_FOLLOW | _NO_WAIT | _BINARY), "rb") as file:
        about = os.fstat(file.fileno())
        if not stat.S_ISREG(about.st_mode):
            raise OSError(22, "is no regular file", str(path))
        if most is not None and about.st_size > most:
            raise OSError(27, f"is larger than {most:,} bytes", str(path))
        return file.read()


def open_lock(path: Path) -> int:
    """Return the descriptor of a lock file, made if need be; its content is never touched.

    Raises
    ------
    OSError
        If it is a link or no regular file, or cannot be made.
    """
    number = os.open(path, os.O_RDWR | os.O_CREAT | _NO_FOLLOW | _NO_WAIT, 0o666)
    if not stat.S_ISREG(os.fstat(number).st_mode):
        os.close(number)
        raise OSError(22, "is no regular file", str(path))
    return number
