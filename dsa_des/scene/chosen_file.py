"""The scene or study that a user asked for: a file that is there, or a shipped one by its name."""

import os
from pathlib import Path
from typing import Literal

from dsa_des.errors import Problem, SceneError, nearest
from dsa_des.scene.examples import examples, find_example


def chosen_file(asked: Path | str, kind: Literal["scene", "study"] | None = None) -> Path:
    """Return the file of a scene or study: a path that exists, or else that of a shipped one.

    A name that is neither is returned as a path, for its reader to say what is wrong with it.

    Parameters
    ----------
    asked : path or str
        Such as ``mine/scene.toml`` or ``first_light``.
    kind : {"scene", "study"}, optional
        Which of the two is wanted where both have the name.

    Raises
    ------
    SceneError
        If there is no such file and a shipped scene or study has nearly this name.
    """
    path = Path(asked)
    if not str(asked) or "\0" in str(asked) or os.path.lexists(path):
        return path
    found = find_example(path.as_posix(), kind)
    if found is not None:
        return found
    if len(path.parts) == 1 and not _has_neighbour(path):
        names = [example.name for example in examples() if kind in (None, example.kind)]
        if close := nearest(path.name.removesuffix(".toml"), names):
            message = f"there is no such file; did you mean the shipped {close!r}? "
            message += "(dsa-des examples lists them all)"
            raise SceneError([Problem(str(asked), "", message)])
    return path


def _has_neighbour(path: Path) -> bool:
    """Return whether a file (no folder) of nearly this name lies in the working directory."""
    try:
        files = [entry.name for entry in os.scandir() if entry.is_file()]
        return nearest(path.name, files) is not None
    except OSError:
        return False
