"""Reading scene files: TOML, ``extends`` in any table, and where each key was written.

A table may say ``extends = "other.toml"`` (or a list of files): the keys of those files come
first and its own keys override them, table by table; a list whose items have a ``name`` is also
changed item by item, by a table of these names. ``remove = ["calibrate"]`` takes inherited keys
away. Paths are taken from the folder of the file that holds them; where no file lies there, what
is extended may be a shipped one by its name (``extends = "first_light"``)."""

import os
from collections.abc import Mapping
from copy import deepcopy
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from dsa_des.block.registry import with_source_folder
from dsa_des.block.shipped_files import find_shipped_files, shipped_files
from dsa_des.errors import Problem, SceneError, UsageError
from dsa_des.files.input_files import (
    LARGEST_TOML_BYTES,
    InputFileError,
    NoSuchFile,
    NotText,
    is_folder,
    is_regular_file,
    read_input_text,
)
from dsa_des.files.toml_files import DEEPEST, TomlError, parse_toml
from dsa_des.scene.inheritance import REMOVE, Inheritance
from dsa_des.scene.keys import Key, dotted_key
from dsa_des.text.safe_text import shorten

COMMAND_LINE = "command line"
# Files that extend each other in a row; scenes have about four.
_LONGEST_CHAIN = 32
# Values taken from files, counted each time that a file is extended: files that extend the next
# one twice would double them at every step.
_MOST_VALUES = 20_000_000
# What a file counts for, however short it is.
_VALUES_PER_FILE = 200


@dataclass
class SceneFile:
    """The merged tables of a scene and where each key came from."""

    path: Path
    #: Merged tables; every text is a `SourcedText`.
    data: dict[str, Any]
    #: For each key path that was written, the file (or ``command line``).
    sources: dict[Key, str] = field(default_factory=dict)
    #: Keys of blocks that were inherited from a table of another type → that type.
    of_other_type: dict[Key, str] = field(default_factory=dict)
    #: Tables within blocks → the values that stood beside them in the file that wrote them first.
    beside: dict[Key, dict[str, Any]] = field(default_factory=dict)
    #: Lists that take the place of inherited ones → the named items that are gone with these.
    replaced: dict[Key, list[str]] = field(default_factory=dict)
    #: What is wrong with it: whoever reads it adds to them, and refuses it in the end.
    problems: list[Problem] = field(default_factory=list)

    def copy(self) -> "SceneFile":
        """Return a copy of the file's tables that can be changed without changing these."""
        tables = replace(self, data=deepcopy(self.data), problems=[*self.problems])
        for name in ("sources", "of_other_type", "beside", "replaced"):
            setattr(tables, name, dict(getattr(self, name)))
        return tables

    def source_file_of(self, key: Key) -> str:
        """Return the file in which `key`, or the nearest table around it, was written."""
        for length in range(len(key), -1, -1):
            if key[:length] in self.sources:
                return self.sources[key[:length]]
        return str(self.path)

    def problem(self, key: Key, message: str, *value: Any) -> Problem:
        """Return a `Problem` with this message at `key`, naming the file that holds the key."""
        return Problem(self.source_file_of(key), dotted_key(key), message, *value)

    def report(self, key: Key, message: str, *value: Any) -> None:
        """Add a problem with this message at `key` to the file's problems."""
        self.problems.append(self.problem(key, message, *value))

    def raise_if_problems(self) -> None:
        """Raise a `SceneError` with all problems, duplicates removed, if there are any."""
        if self.problems:
            raise SceneError({str(problem): problem for problem in self.problems}.values())


def read_scene_file(path: Path | str) -> SceneFile:
    """Read a scene with everything it extends."""
    path = Path(path)
    reader = _Reader()
    data = reader.read_file_tables(path, (), ())
    if reader.problems:
        raise SceneError(reader.problems)
    return reader.scene_file(path, data, reader.sources)


def read_scene_tables(tables: Mapping[str, Any], name: str) -> SceneFile:
    """Return tables, with all they extend, as a scene file `name` in the working directory."""
    here = Path.cwd() / name
    reader = _Reader()
    reader.sources[()] = str(here)
    data = reader.merge_tables(tables, here)
    if reader.problems:
        raise SceneError(
            replace(p, source=name) if p.source == str(here) else p for p in reader.problems
        )
    sources = {k: name if file == str(here) else file for k, file in reader.sources.items()}
    return reader.scene_file(Path(name), data, sources)


class _Reader:
    def __init__(self) -> None:
        self.problems: list[Problem] = []
        self.sources: dict[Key, str] = {}
        self._inheritance = Inheritance(self.sources, self.problems)
        #: Each file that was read: its real path, and its tables or the error.
        self._read: dict[Path, tuple[Path, dict[str, Any] | Exception]] = {}
        self._taken = 0

    def scene_file(self, path: Path, data: dict[str, Any], sources: dict[Key, str]) -> SceneFile:
        of = self._inheritance
        return SceneFile(path, data, sources, of.of_other_type, of.beside, of.replaced)

    def read_file_tables(self, path: Path, at: Key, chain: tuple[Path, ...]) -> dict[str, Any]:
        self._count_and_limit_values(path, _VALUES_PER_FILE)
        if path not in self._read:
            self._read[path] = _read_tables_or_error(path)
        real, tables = self._read[path]
        if isinstance(tables, dict) and real not in chain and len(chain) < _LONGEST_CHAIN:
            self.sources[at] = str(path)
            return self._finish_tables(
                tables, self._merge_with_bases(tables, path, at, (*chain, real)), at
            )
        if isinstance(tables, TomlError):
            self.problems.append(Problem(str(path), "", str(tables)))
            return {}
        name = shorten(str(path), 300)
        if real in chain:
            message = f"extends itself by way of {name}"
        elif isinstance(tables, dict):
            message = f"is the {_LONGEST_CHAIN + 1}th file in a row that extends the next one: "
            message += f"at most {_LONGEST_CHAIN} are read"
        elif isinstance(tables, NoSuchFile):
            what = f"there is no file {name}" if chain else "there is no such file"
            message = what + _similar_file_hint(path, shipped=bool(chain))
        elif is_folder(path):
            message = f"{f'{name} ' if chain else ''}is a folder; a TOML file is needed"
        else:
            message = f"{f'{name} ' if chain else ''}{tables}"
            message += "; a TOML file is needed" if isinstance(tables, NotText) else ""
        if at or chain:
            source, key = self.sources.get(at, str(chain[-1])), dotted_key((*at, "extends"))
            self.problems.append(Problem(source, key, message))
        else:
            self.problems.append(Problem(str(path), "", message))
        return {}

    def merge_tables(self, tables: Mapping[str, Any], path: Path) -> dict[str, Any]:
        return self._finish_tables(tables, self._merge_with_bases(tables, path, (), (path,)), ())

    def _finish_tables(
        self, own: Mapping[str, Any], merged: dict[str, Any], at: Key
    ) -> dict[str, Any]:
        self._inheritance.note_sibling_values(own, merged, at)
        return self._inheritance.strip_and_report_removals(merged, at)

    def _count_and_limit_values(self, path: Path, values: int = 1) -> None:
        self._taken += values
        if self._taken > _MOST_VALUES:
            message = f"with all that it extends, has more than {_MOST_VALUES:,} values"
            raise SceneError([Problem(str(path), "", message)])

    def _merge_with_bases(
        self, table: Mapping[str, Any], path: Path, at: Key, chain: tuple[Path, ...]
    ) -> dict[str, Any]:
        if len(at) > DEEPEST:
            message = f"tables are nested too deeply: at most {DEEPEST} inside each other"
            self.problems.append(Problem(str(path), dotted_key(at), message))
            return {}
        merged: dict[str, Any] = {}
        bases = table.get("extends", [])
        for base in bases if isinstance(bases, list) else [bases]:
            if not isinstance(base, str):
                self.problems.append(
                    Problem(str(path), dotted_key((*at, "extends")), "must be a file name", base)
                )
                continue
            self.sources.setdefault(at, str(path))
            base_source = self.sources[at]
            self._inheritance.merge_in_place(
                merged, self.read_file_tables(self._extended_path(path, base), at, chain), at
            )
            self.sources[at] = base_source
        own = {
            key: self._resolve_value(value, path, (*at, key), chain)
            for key, value in table.items()
            if key != "extends"
        }
        if REMOVE in own:
            own[REMOVE] = self._inheritance.parse_removals(own[REMOVE], str(path))
        return self._inheritance.merge_in_place(merged, own, at)

    def _extended_path(self, path: Path, base: str) -> Path:
        """Return the path ``extends`` means: beside `path`, or the one shipped file so named."""
        beside = path.parent / base
        if "\0" in base or os.path.lexists(beside):
            return beside
        try:
            shipped = find_shipped_files(base)
        except UsageError as error:
            raise SceneError([Problem(str(path), "extends", str(error))]) from None
        return shipped[0] if len(shipped) == 1 else beside

    def _resolve_value(self, value: Any, path: Path, at: Key, chain: tuple[Path, ...]) -> Any:
        self._count_and_limit_values(path)
        self.sources[at] = str(path)
        self._inheritance.of_other_type.pop(at, None)
        if isinstance(value, dict):
            return self._merge_with_bases(value, path, at, chain)
        if isinstance(value, list):
            return [
                self._resolve_value(item, path, (*at, i), chain) for i, item in enumerate(value)
            ]
        if isinstance(value, str):
            return with_source_folder(value, path.parent)
        return value


def _read_tables_or_error(path: Path) -> tuple[Path, dict[str, Any] | Exception]:
    """Return a TOML file's real path, and its tables or the error if it cannot be read."""
    try:
        text = read_input_text(path, LARGEST_TOML_BYTES)
        return Path(os.path.realpath(path)), parse_toml(text)
    except (InputFileError, TomlError) as error:
        return path, error


def merge_tables_in_place(base: dict[str, Any], over: Mapping[str, Any]) -> dict[str, Any]:
    """Merge `over` into `base` in place, table by table, and return `base`."""
    return Inheritance({}, []).merge_in_place(base, over, ())


def _similar_file_hint(path: Path, shipped: bool) -> str:
    """Return a hint at a similar file (beside `path`, shipped) or a missing folder; else empty."""
    from dsa_des.errors import nearest_name

    missing, names = "", []
    try:
        names = [entry.name for entry in path.parent.iterdir() if is_regular_file(entry)]
    except OSError:
        missing = f" (there is no folder {shorten(str(path.parent), 300)})"
    if close := nearest_name(path.name, names):
        return f"; did you mean {path.parent / close}?"
    known = [name for index, _ in shipped_files() for name in (index.name, str(index))]
    if shipped and (close := nearest_name(path.name.removesuffix(".toml"), known)):
        return f"; did you mean the shipped {close!r}?"
    return missing


__all__ = [
    "COMMAND_LINE",
    "Key",
    "SceneFile",
    "dotted_key",
    "merge_tables_in_place",
    "read_scene_file",
]
