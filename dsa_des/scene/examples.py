"""Scenes and studies that packages ship, found by name: ``first_light``.

A package registers a function under the entry-point group `GROUP`. It takes nothing and returns
the folder of its scenes and studies.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path, PurePosixPath
from typing import Any, Literal

from dsa_des.block.entry_points import registered
from dsa_des.block.foreign import installed
from dsa_des.block.strangers import Left, strangers_code
from dsa_des.errors import SceneError, UsageError
from dsa_des.scene.scene_file import read_scene_file

#: The entry points of functions that return a folder of scenes and studies.
GROUP = "dsa_des.examples"


@dataclass(frozen=True)
class Example:
    """A scene or a study that a package ships.

    Parameters
    ----------
    name : str
        As it is asked for: its path in the folder without ``.toml``, or shorter, its file's stem
        where no other example has the same.
    path : Path
    kind : {"scene", "study"}
    title : str
    """

    name: str
    path: Path
    kind: Literal["scene", "study"]
    title: str


def examples() -> list[Example]:
    """Return all shipped scenes and studies, sorted by kind and name.

    Files that are only parts of scenes (aircraft, sensors, obstacles) are not among them.

    Raises
    ------
    UsageError
        If a package that registered a folder cannot be imported.
    """
    found = [
        (place, path, *read)
        for place, path in _files()
        if (read := _kind_and_title(path)) is not None
    ]
    stems = [(place.name, kind) for place, _, kind, _ in found]
    return sorted(
        (
            Example(
                place.name if stems.count((place.name, kind)) == 1 else str(place),
                path,
                kind,
                title,
            )
            for place, path, kind, title in found
        ),
        key=lambda example: (example.kind, example.name),
    )


def find_example(name: str, kind: Literal["scene", "study"] | None = None) -> Path | None:
    """Return the file of a shipped scene or study; None if there is none of that name.

    Parameters
    ----------
    name : str
        ``first_light``, ``systems/oasys``, with ``.toml`` or without.
    kind : {"scene", "study"}, optional
        Which of the two is wanted where both have the name.

    Raises
    ------
    UsageError
        If a package that registered a folder cannot be imported.
    """
    wanted = PurePosixPath(name.removesuffix(".toml"))
    if not wanted.name or wanted.is_absolute() or ".." in wanted.parts:
        return None
    whole = [path for place, path in _files() if place == wanted]
    if whole:
        return whole[0]
    if len(wanted.parts) > 1:
        return None
    same_stem = [path for place, path in _files() if place.name == wanted.name]
    if len(same_stem) > 1:
        kinds = {path: read[0] for path in same_stem if (read := _kind_and_title(path))}
        same_stem = [path for path, one in kinds.items() if kind in (None, one)]
    return same_stem[0] if len(same_stem) == 1 else None


def folders() -> list[Path]:
    """Return the folders of examples of all installed packages.

    Raises
    ------
    UsageError
        If one of them cannot be asked.
    """
    found = []
    for point in registered(GROUP).values():
        try:
            with strangers_code(UsageError):
                found.append(Path(installed(point)()))
        except Left as error:
            message = f"{GROUP}: {point.name} gives no folder: {error}"
            raise UsageError(message) from error.__cause__
    return [folder for folder in found if folder.is_dir()]


def _files() -> Iterator[tuple[PurePosixPath, Path]]:
    """Yield every TOML file of the folders with its place there, without ``.toml``."""
    for folder in folders():
        for path in sorted(folder.rglob("*.toml")):
            yield PurePosixPath(path.relative_to(folder).with_suffix("").as_posix()), path


@cache
def _kind_and_title(path: Path) -> tuple[Literal["scene", "study"], str] | None:
    """Return what a file is, and its title; None for a part of a scene."""
    try:
        data = read_scene_file(path).data
    except SceneError:
        return None
    title = str(data.get("title", path.stem))
    if "scene" in data:
        return "study", title
    return ("scene", title) if _is_whole(data) else None


def _is_whole(data: dict[str, Any]) -> bool:
    """Return whether tables are a scene and not a part of one: its wires end at its blocks."""
    blocks, wires = data.get("blocks"), data.get("wires")
    if not isinstance(blocks, dict) or not isinstance(wires, list):
        return False
    ends: list[str] = []
    for wire in wires:
        ends += [str(wire.get(k)) for k in ("from", "to")] if isinstance(wire, dict) else []
        ends += wire.split("->") if isinstance(wire, str) else []
    return all(end.partition(".")[0].strip() in blocks for end in ends)
