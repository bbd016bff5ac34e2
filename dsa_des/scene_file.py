"""Reading scene files: TOML, ``extends`` in any table, and where each key was written.

A table may say ``extends = "other.toml"`` (or a list of files): the keys of those files come
first and its own keys override them, table by table. Paths are taken from the folder of the file
that holds them.
"""

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from dsa_des.component import SourcedText
from dsa_des.errors import Problem, SceneError
from dsa_des.toml_reason import toml_reason

Key = tuple[str | int, ...]
COMMAND_LINE = "command line"


def dotted(key: Key) -> str:
    """Return ``blocks.traffic.intruders[1].name`` for a key path."""
    text = ""
    for part in key:
        text += f"[{part}]" if isinstance(part, int) else f".{part}" if text else str(part)
    return text


@dataclass
class SceneFile:
    """The merged tables of a scene and where each key came from.

    Parameters
    ----------
    path : Path
    data : dict
        Merged tables; every text is a `SourcedText`.
    sources : dict
        For each key path that was written, the file (or ``command line``).
    """

    path: Path
    data: dict[str, Any]
    sources: dict[Key, str] = field(default_factory=dict)

    def source_of(self, key: Key) -> str:
        """Return the file in which `key`, or the nearest table around it, was written."""
        for length in range(len(key), -1, -1):
            if key[:length] in self.sources:
                return self.sources[key[:length]]
        return str(self.path)

    def problem(self, key: Key, message: str, *value: Any) -> Problem:
        """Return a `Problem` at `key`, naming the file that holds it."""
        return Problem(self.source_of(key), dotted(key), message, *value)


def read_scene_file(path: Path | str) -> SceneFile:
    """Read a scene with everything it extends.

    Raises
    ------
    SceneError
        If a file is missing, is not TOML, or extends itself.
    """
    path = Path(path)
    problems: list[Problem] = []
    reader = _Reader(problems)
    data = reader.file(path, (), ())
    if problems:
        raise SceneError(problems)
    return SceneFile(path, data, reader.sources)


class _Reader:
    def __init__(self, problems: list[Problem]) -> None:
        self.problems = problems
        self.sources: dict[Key, str] = {}

    def file(self, path: Path, at: Key, chain: tuple[Path, ...]) -> dict[str, Any]:
        text = self._text(path, at, chain)
        if text is None:
            return {}
        try:
            table = tomllib.loads(text)
        except tomllib.TOMLDecodeError as error:
            self.problems.append(Problem(str(path), "", f"is not valid TOML: {toml_reason(error)}"))
            return {}
        self.sources[at] = str(path)
        return self._table(table, path, at, (*chain, path.resolve()))

    def _text(self, path: Path, at: Key, chain: tuple[Path, ...]) -> str | None:
        where = Problem(str(path), "", "")
        if at or chain:
            where = Problem(self.sources.get(at, str(chain[-1])), dotted((*at, "extends")), "")
        if path.resolve() in chain:
            message = f"extends itself by way of {path}"
        elif path.is_dir():
            message = f"{path} is a folder; a TOML file is needed"
        else:
            try:
                return path.read_text(encoding="utf-8")
            except FileNotFoundError:
                what = f"there is no file {path}" if chain else "there is no such file"
                message = what + _similar_file(path)
            except UnicodeDecodeError:
                message = f"{path} is not a text file in UTF-8"
            except OSError as error:
                message = f"{path} cannot be read: {error.strerror}"
        self.problems.append(Problem(where.source, where.key, message))
        return None

    def _table(
        self, table: Mapping[str, Any], path: Path, at: Key, chain: tuple[Path, ...]
    ) -> dict[str, Any]:
        merged: dict[str, Any] = {}
        bases = table.get("extends", [])
        for base in bases if isinstance(bases, list) else [bases]:
            if not isinstance(base, str):
                self.problems.append(
                    Problem(str(path), dotted((*at, "extends")), "must be a file name", base)
                )
                continue
            self.sources.setdefault(at, str(path))
            base_source = self.sources[at]
            merge(merged, self.file(path.parent / base, at, chain))
            self.sources[at] = base_source
        own = {
            key: self._value(value, path, (*at, key), chain)
            for key, value in table.items()
            if key != "extends"
        }
        return merge(merged, own)

    def _value(self, value: Any, path: Path, at: Key, chain: tuple[Path, ...]) -> Any:
        self.sources[at] = str(path)
        if isinstance(value, dict):
            return self._table(value, path, at, chain)
        if isinstance(value, list):
            return [self._value(item, path, (*at, i), chain) for i, item in enumerate(value)]
        if isinstance(value, str):
            return SourcedText.of(value, path.parent)
        return value


def merge(base: dict[str, Any], over: Mapping[str, Any]) -> dict[str, Any]:
    """Put the keys of `over` into `base`, table by table, and return `base`."""
    for key, value in over.items():
        if isinstance(value, dict) and isinstance(base.get(key), dict):
            merge(base[key], value)
        else:
            base[key] = value
    return base


def _similar_file(path: Path) -> str:
    from dsa_des.errors import nearest

    try:
        names = [entry.name for entry in path.parent.iterdir() if entry.is_file()]
    except OSError:
        return f" (there is no folder {path.parent})"
    close = nearest(path.name, names)
    return f"; did you mean {path.parent / close}?" if close else ""
