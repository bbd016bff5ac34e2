"""Writing a file piece by piece, which takes its name when it is whole."""

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

from dsa_des.files.output_file import temporary_beside


@contextmanager
def streamed(path: Path) -> Iterator[BinaryIO]:
    """Give a file to write to; nothing is left behind where the block does not end well.

    Raises
    ------
    OSError
        If it cannot be written.
    """
    temporary = temporary_beside(path)
    try:
        with open(temporary, "xb") as file:
            yield file
        os.replace(temporary, path)
    except BaseException:
        with suppress(OSError):
            temporary.unlink()
        raise
