"""Names of folders that count up: a new one that nobody else gets, and the latest there is."""

import os
import re
from pathlib import Path

from dsa_des.errors import UsageError


def claim_folder(parent: Path, stem: str) -> Path:
    """Make the first of ``parent/stem-001``, ``-002``, ... that is free; nobody else gets it.

    Raises
    ------
    UsageError
        If no folder can be made there.
    """
    number = 1
    while True:
        path = parent / f"{stem}-{number:03d}"
        try:
            path.mkdir(parents=True)
            return path
        except FileExistsError as error:
            if not os.path.lexists(path):
                raise UsageError(f"{parent}: cannot be written: {error.strerror}") from None
            number += 1
        except OSError as error:
            raise UsageError(f"{path}: cannot be made: {error.strerror}") from None


def latest_folder(parent: Path, stem: str) -> Path | None:
    """Return the ``parent/stem-NNN`` with the highest number; None if there is none."""
    form = re.compile(re.escape(stem) + r"-(\d{3,})")
    try:
        names = [entry.name for entry in parent.iterdir() if form.fullmatch(entry.name)]
    except OSError:
        return None
    return parent / max(names, key=lambda name: int(name[len(stem) + 1 :])) if names else None
