"""Scenes by shipped name, by path or as a table."""

import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from dsa_des.errors import Problem, SceneError, did_you_mean
from dsa_des.scene.examples import examples, find_example
from dsa_des.scene.overrides import read_changes, to_scene_value
from dsa_des.scene.scene import Scene, scene_with_changes
from dsa_des.scene.scene_file import SceneFile, read_scene_file, read_scene_tables

#: What messages call a scene that is given as a table, and its title where it has none.
_TABLE = "scene"


def load_scene(
    source: str | os.PathLike[str] | Mapping[str, Any],
    *,
    sets: Iterable[str] = (),
    swaps: Iterable[str] = (),
    seed: int | None = None,
    duration_s: object = None,
) -> Scene:
    """Read and check a scene.

    Parameters
    ----------
    source : str, path or mapping
        A TOML file, the name of a shipped scene where there is no such file, or tables as a file
        in the working directory would hold them.
    sets, swaps : iterable of str
        Changes as the command line takes them: ``key=value`` and ``block=type``.
    seed, duration_s : optional
        Override the scene's own.

    Raises
    ------
    SceneError
        With every problem found.
    UsageError
        If an installed package is broken that shipped scenes or sections come from.
    """
    changes, problems = read_changes(sets, swaps, seed, duration_s)
    if problems:
        raise SceneError(problems)
    return scene_with_changes(_read_source(source), tuple(changes))


def as_scene(source: "Scene | str | os.PathLike[str] | Mapping[str, Any]") -> Scene:
    """Return `source` if it is a scene already, else load it with `load_scene`."""
    return source if isinstance(source, Scene) else load_scene(source)


def _read_source(source: str | os.PathLike[str] | Mapping[str, Any]) -> SceneFile:
    if isinstance(source, Mapping):
        try:
            return read_scene_tables(to_scene_value(source), _TABLE)
        except TypeError as error:
            raise SceneError([_problem_of_unusable_value(source, str(error))]) from None
    if not isinstance(source, str | os.PathLike):
        message = "must be a path, the name of a shipped scene, or a table"
        raise SceneError([Problem("load_scene", "", message, source)])
    path = Path(source)
    if isinstance(source, str) and not os.path.lexists(path):
        shipped = find_example(source, "scene")
        if shipped is not None:
            return read_scene_file(shipped)
        if path.name == source and not path.suffix:
            known = [example.name for example in examples() if example.kind == "scene"]
            message = f"there is no such file and no shipped scene{did_you_mean(source, known)}"
            raise SceneError([Problem(source, "", message)])
    return read_scene_file(path)


def _problem_of_unusable_value(tables: Mapping[str, Any], message: str, key: str = "") -> Problem:
    """Return a problem that names the first value of the tables that cannot be in a scene."""
    for name, value in tables.items():
        inner = f"{key}.{name}" if key else str(name)
        if isinstance(value, Mapping):
            try:
                to_scene_value(value)
            except TypeError:
                return _problem_of_unusable_value(value, message, inner)
            continue
        try:
            to_scene_value(value)
        except TypeError as error:
            return Problem(_TABLE, inner, str(error))
    return Problem(_TABLE, key, message)
