"""Values that a Python program gives, as a scene file would hold them."""

from abc import abstractmethod
from collections.abc import Mapping
from copy import deepcopy
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path
from typing import Any, Self

from dsa_des.block.class_text import sourced, type_text
from dsa_des.block.component import Component, as_written
from dsa_des.block.entry_points import COMPONENTS
from dsa_des.errors import Problem, SceneError, UsageError
from dsa_des.scene.overrides import read_sets, set_value, swap_type
from dsa_des.scene.scene_file import SceneFile


def scene_value(value: Any, group: str = COMPONENTS) -> Any:
    """Return a value as a scene file written in the working directory would hold it.

    Parameters
    ----------
    value : object
        Texts, paths, numbers (NumPy's as well), fractions, classes, and tables, lists, tuples and
        arrays of these.
    group : str
        Entry points among which classes may be registered.

    Raises
    ------
    TypeError
        For anything else; the message says what.
    """
    if isinstance(value, bool | int | float):
        return value
    if isinstance(value, type):
        return type_text(value, group)
    if isinstance(value, Path):
        return sourced(str(value), Path.cwd())
    if isinstance(value, str):
        return value if hasattr(value, "folder") else sourced(value, Path.cwd())
    if isinstance(value, Fraction):
        return as_written(value)
    if isinstance(value, Mapping):
        for key in value:
            if not isinstance(key, str):
                raise TypeError(f"has the key {key!r}: keys are texts")
        return {str(key): scene_value(item, group) for key, item in value.items()}
    if isinstance(value, list | tuple | range):
        return [scene_value(item, group) for item in value]
    if hasattr(value, "tolist") and not isinstance(plain := value.tolist(), type(value)):
        return scene_value(plain, group)  # NumPy's numbers and arrays
    raise TypeError(
        f"is of the type {type(value).__name__}: a scene holds texts, numbers, truth values, "
        "lists and tables"
    )


_SET, _SWAP = "scene.set", "scene.swap"


@dataclass(frozen=True)
class Origin:
    """What a scene was made of.

    Parameters
    ----------
    file : SceneFile
        Its tables as they were read; they are never changed.
    changes : tuple of (key, value)
        In their order; the key ``swap.BLOCK`` puts a type into a block.
    """

    file: SceneFile
    changes: tuple[tuple[str, Any], ...] = ()

    def tables(self) -> tuple[SceneFile, list[Problem], list[str]]:
        """Return changed tables, what is wrong with the changes, and what swaps dropped."""
        file = self.file.copy()
        problems: list[Problem] = []
        dropped: list[str] = []
        for key, value in self.changes:
            if key.startswith("swap."):
                name = key.removeprefix("swap.")
                found, gone = swap_type(file, name, value, _SWAP)
                problems += [replace(problem, key=name) for problem in found]
                dropped += gone
            else:
                problems += set_value(file, key, deepcopy(value), _SET)
        return file, problems, dropped


class Changeable:
    """What can be changed; see `Scene`."""

    _origin: Origin | None = None

    @classmethod
    @abstractmethod
    def _checked(cls, scene_file: SceneFile, problems: list[Problem]) -> Self:
        """Return the checked scene of tables."""

    @classmethod
    def of(cls, origin: Origin) -> Self:
        """Return the checked scene that tables and changes make.

        Raises
        ------
        SceneError
            With every problem found.
        """
        file, problems, dropped = origin.tables()
        scene = cls._checked(file, problems)
        scene._origin = origin
        scene.dropped = dropped
        return scene

    dropped: list[str]

    @property
    def origin(self) -> Origin:
        """What the scene was made of.

        Raises
        ------
        UsageError
            If it was not made by `dsa_des.load_scene`.
        """
        if self._origin is None:
            raise UsageError("this scene cannot be changed: it was not made by dsa_des.load_scene")
        return self._origin

    def set(self, values: Mapping[str, Any] | str, /, *more: str) -> Self:
        """Return a scene with other values; this one stays as it is.

        Parameters
        ----------
        values : mapping or str
            Dotted key → value, for example ``{"blocks.radar.scan_rate_hz": 2}``, or texts as
            ``--set`` takes them: ``"blocks.radar.scan_rate_hz=2"``. Relative paths are those of
            the working directory; a table may say ``extends``, as in a file.
        *more : str
            Further texts.

        Raises
        ------
        SceneError
            With every problem that the new scene has.
        """
        if isinstance(values, str):
            read, problems = read_sets((values, *more))
            if problems:
                raise SceneError(replace(one, source=_SET) for one in problems)
            values = dict(read)
        return self._changed(values, _SET)

    def swap(
        self,
        types: "Mapping[str, str | type[Component]] | None" = None,
        /,
        **more: "str | type[Component]",
    ) -> Self:
        """Return a scene with other types in some blocks; this one stays as it is.

        A block keeps its name, its wires and the parameters that the new type knows; ``dropped``
        lists the others.

        Parameters
        ----------
        types, **more
            Block → type: a registered name, ``module:Class``, or a class.

        Raises
        ------
        SceneError
            With every problem that the new scene has.
        """
        named = {**(types or {}), **more}
        return self._changed({f"swap.{name}": kind for name, kind in named.items()}, _SWAP)

    def _changed(self, values: Mapping[str, Any], source: str) -> Self:
        changes: list[tuple[str, Any]] = []
        problems: list[Problem] = []
        for key, value in values.items():
            shown = key.removeprefix("swap.") if source == _SWAP else key
            if not isinstance(key, str):
                problems.append(Problem(source, "", "a key must be text", key))
            elif source == _SET and key.startswith("swap."):
                problems.append(Problem(source, key, "types are changed with scene.swap"))
            elif source == _SWAP and not isinstance(value, str | type):
                message = "must be a registered name, module:Class, or a class"
                problems.append(Problem(source, shown, message, value))
            else:
                try:
                    changes.append((key, scene_value(value)))
                except TypeError as error:
                    problems.append(Problem(source, shown, str(error)))
        if problems:
            raise SceneError(problems)
        return self.of(Origin(self.origin.file, (*self.origin.changes, *changes)))
