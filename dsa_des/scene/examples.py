"""Scenes, studies and cases that packages ship, by name: ``first_light``."""

import os
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Literal

from dsa_des.block.shipped_files import find_shipped_files, shipped_files
from dsa_des.errors import Problem, SceneError, nearest_name
from dsa_des.scene.scene_file import read_scene_file

#: What a shipped file may be; a case asks by studies whether requirements are met.
Kind = Literal["scene", "study", "case"]


def find_input_file(asked: Path | str, kind: Kind | None = None) -> Path:
    """Return an input file's path: as given if it exists, else the shipped file of that name.

    A name that is neither is returned as a path, for its reader to say what is wrong with it.
    """
    path = Path(asked)
    if not str(asked):
        message = f"is empty: the name of a {kind or 'scene or study'} is needed"
        raise SceneError([Problem("''", "", message)])
    if "\0" in str(asked) or os.path.lexists(path):
        return path
    shipped = find_example(path.as_posix(), kind)
    if shipped is not None:
        return shipped
    # A name that no file system takes is refused where it is opened.
    if not path.is_absolute() and len(path.name) <= 255 and not _has_similar_file(path):
        names = [example.name for example in examples() if kind in (None, example.kind)]
        close = nearest_name(path.name.removesuffix(".toml"), names)
        if close or (len(path.parts) == 1 and not path.suffix):
            message = (
                f"there is no such file, nor a shipped {kind or 'scene or study'} of that name"
            )
            if close:
                message = f"there is no such file; did you mean the shipped {close!r}?"
            message += " (dsa-des examples lists them all)"
            raise SceneError([Problem(str(asked), "", message)])
    return path


def _has_similar_file(path: Path) -> bool:
    """Return whether the folder of `path` holds a file with nearly the same name."""
    try:
        files = [entry.name for entry in os.scandir(path.parent) if entry.is_file()]
        return nearest_name(path.name, files) is not None
    except OSError:
        return False


@dataclass(frozen=True)
class Example:
    """A scene, a study or a case that a package ships.

    Parameters
    ----------
    name : str
        As it is asked for: its path in the folder without ``.toml``, or shorter, its file's stem
        where no other example has the same.
    path : Path
    kind : {"scene", "study", "case"}
    title : str
    """

    name: str
    path: Path
    kind: Kind
    title: str


def examples() -> list[Example]:
    """Return all shipped scenes, studies and cases, sorted by kind and name.

    Files that are only parts of scenes (aircraft, sensors, obstacles) are not among them.

    Raises
    ------
    UsageError
        If a package that registered a folder cannot be imported.
    """
    result = [
        (location, path, *read)
        for location, path in shipped_files()
        if (read := _kind_and_title(path)) is not None
    ]
    stems = [(location.name, kind) for location, _, kind, _ in result]
    return sorted(
        (
            Example(
                location.name if stems.count((location.name, kind)) == 1 else str(location),
                path,
                kind,
                title,
            )
            for location, path, kind, title in result
        ),
        key=lambda example: (example.kind, example.name),
    )


def find_example(name: str, kind: Kind | None = None) -> Path | None:
    """Return the file of a shipped scene, study or case; None if there is none of that name."""
    paths = find_shipped_files(name)
    if len(paths) > 1:
        kinds = {path: read[0] for path in paths if (read := _kind_and_title(path))}
        paths = [path for path, one in kinds.items() if kind in (None, one)]
    return paths[0] if len(paths) == 1 else None


@cache
def _kind_and_title(path: Path) -> tuple[Kind, str] | None:
    """Return whether a file is scene, study or case, and its title; None for part of a scene."""
    try:
        data = read_scene_file(path).data
    except SceneError:
        return None
    title = str(data.get("title", path.stem))
    if "scene" in data:
        return "study", title
    if "study" in data and "requirements" in data:
        return "case", title
    return ("scene", title) if _is_complete_scene(data) else None


def _is_complete_scene(data: dict[str, Any]) -> bool:
    """Return whether tables are a complete scene: all wires begin and end at its blocks."""
    blocks, wires = data.get("blocks"), data.get("wires")
    if not isinstance(blocks, dict) or not isinstance(wires, list):
        return False
    ends: list[str] = []
    for wire in wires:
        ends += [str(wire.get(k)) for k in ("from", "to")] if isinstance(wire, dict) else []
        ends += wire.split("->") if isinstance(wire, str) else []
    return all(end.partition(".")[0].strip() in blocks for end in ends)
