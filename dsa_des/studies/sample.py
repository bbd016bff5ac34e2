"""What makes a member of a sample itself: the seed that an encounter has, whoever is beside it.

Axes over which a study averages (`Study.over`) are a sample, and what chance does in one member
must say nothing about another: replicas of two encounters have different seeds and draws, though
their aircraft may bear the same names. Axes that are compared do not enter, so that conditions
meet the same chances in the same encounter.
"""

import hashlib
from collections.abc import Iterable
from functools import lru_cache
from pathlib import Path
from typing import Any

from dsa_des.studies.axes import Axis
from dsa_des.time.randomness import key_of


def member_seed(seed: int, members: Iterable[tuple[Axis, int]]) -> int:
    """Return the seed of all runs of one member of a sample.

    It depends on the values alone: not on their places, nor on what other values there are.

    Parameters
    ----------
    seed : int
        The study's.
    members : iterable of (Axis, index of its value)
        The axes that are a sample, in any order; without any the study's seed stays.
    """
    parts = sorted((axis.key, *identity(axis, index)) for axis, index in members)
    return (
        key_of(seed, "study sample", *(text for part in parts for text in part)) if parts else seed
    )


def identity(axis: Axis, index: int) -> tuple[str, ...]:
    """Return what tells one value of an axis from all others.

    A file is told by its name, without its folder, and its content: it keeps its draws wherever
    it lies, copies under other names are other encounters, and so are files of the same name in
    other folders, unless they hold the same. Other values are told by themselves; 1 and 1.0 are
    the same.
    """
    if not axis.files:
        return (_text(axis.labels[index]),)
    path = Path(axis.sets[index][0][1])
    try:
        return path.name, file_digest(path)
    except OSError:  # its runs say what is wrong with it
        return path.name, ""


def file_digest(path: Path) -> str:
    """Return the SHA-256 of a file's content; a file that stays as it is is read once.

    Raises
    ------
    OSError
        If it cannot be read.
    """
    state = path.stat()
    return _digest(str(path), state.st_mtime_ns, state.st_size, state.st_ino)


@lru_cache(maxsize=1 << 17)
def _digest(path: str, *state: int) -> str:
    with Path(path).open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _text(label: Any) -> str:
    if isinstance(label, float) and label.is_integer():
        label = int(label)
    return repr(label) if isinstance(label, int | float) else f"text {label}"
