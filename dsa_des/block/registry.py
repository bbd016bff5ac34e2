"""Classes by the names that scenes have for them, and names by class."""

import importlib
import sys
from collections.abc import Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

from dsa_des.block.component import Component, Input, Output, Parameters, SourcedText
from dsa_des.block.entry_points import entry_points_of
from dsa_des.block.foreign_calls import ForeignFailure, wrap_foreign_errors
from dsa_des.block.message import Message
from dsa_des.block.shadowed_packages import (
    NotAllowed,
    NotImportable,
    import_named_object,
    is_own_entry_point,
    load_entry_point,
    load_unnamed_entry_point,
)
from dsa_des.errors import did_you_mean

SECTIONS = "dsa_des.sections"


@lru_cache(maxsize=1)
def section_models() -> dict[str, type[Parameters]]:
    """Return the registered section models by table name, sorted."""
    return {
        name: load_unnamed_entry_point(point) for name, point in entry_points_of(SECTIONS).items()
    }


class ClassText(str):
    """The text ``module:Class`` of a class that cannot be found by that text.

    It is defined in ``__main__``, in a notebook or inside a function; the class comes along.
    """

    __slots__ = ("cls",)
    cls: type


def class_name_in_scene(cls: type, group: str) -> str:
    """Return a class's name in a scene: that of its entry point if it is registered.

    Else as ``module:Class`` where any process can import it, and else as a `ClassText`.
    """
    path = f"{cls.__module__}:{cls.__qualname__}"
    for name, point in entry_points_of(group).items():
        if point.value == path:
            return name
    if _is_importable(cls):
        return path
    text = ClassText(path)
    text.cls = cls
    return text


def class_texts_in(value: Any) -> list[str]:
    """Return every `ClassText` in a value, also inside tables and lists."""
    if isinstance(value, ClassText):
        return [value]
    if isinstance(value, dict):
        return [text for item in value.values() for text in class_texts_in(item)]
    if isinstance(value, list | tuple):
        return [text for item in value for text in class_texts_in(item)]
    return []


def with_source_folder(value: str, folder: Any) -> str:
    """Return the text with the folder it was written in (`SourcedText`); `ClassText` unchanged."""
    return value if isinstance(value, ClassText) else SourcedText.from_text(value, folder)


def _is_importable(cls: type) -> bool:
    """Return whether another process would get this very class by importing its module and name."""
    module = sys.modules.get(cls.__module__)
    if module is None or cls.__module__ == "__main__":
        return False
    if getattr(module, cls.__qualname__, None) is not cls:
        return False
    name = ""
    for part in cls.__module__.split("."):
        parent = sys.modules.get(name) if name else None
        name = f"{name}.{part}" if name else part
        path = getattr(parent, "__path__", None)
        # What is imported already says nothing: it may have been made by hand.
        importlib.invalidate_caches()
        specs = (finder.find_spec(name, path) for finder in sys.meta_path)
        spec = next((spec for spec in specs if spec is not None), None)
        if spec is None:
            return False
    return spec is not None and spec.origin == getattr(module, "__file__", None)


class UnknownType(Exception):
    """A block type cannot be found or is not a component; the message says what is allowed."""


class NotImported(UnknownType):
    """A block type is foreign, and nothing foreign may be imported.

    See `dsa_des.block.shadowed_packages.Imports`.
    """


def find_component(type_name: str, key: str = "", beside: Sequence[Path] = ()) -> type[Component]:
    """Return the class of a registered block type, ``module:Class`` or ``./file.py:Class``.

    The `key` names it, for messages; modules may lie in the folders `beside`. Raises NotImported if
    it may not be imported, and UnknownType if it cannot be or is not a `Component`.
    """
    if isinstance(type_name, ClassText):
        return _check_component_class(type_name, type_name.cls)
    point = entry_points_of().get(type_name)
    if point is None and ":" not in type_name:
        module, _, last = type_name.rpartition(".")
        if module and last[:1].isupper():  # as Python writes it
            raise UnknownType(f"unknown block type; did you mean '{module}:{last}' (module:Class)?")
        hint = did_you_mean(type_name, entry_points_of())
        raise UnknownType(f"unknown block type{hint} (or module:Class)")
    try:
        found = (
            import_named_object(type_name, key, beside)
            if point is None
            else load_entry_point(point, key)
        )
    except NotAllowed as error:
        raise NotImported(str(error)) from None
    except NotImportable as error:
        raise UnknownType(str(error)) from error.__cause__
    if point is not None and is_own_entry_point(point):
        return _require_component(found)
    return _check_component_class(type_name, found)


def _check_component_class(type_name: str, found: Any) -> type[Component]:
    """Return the component class of a type name; UnknownType if invalid or its own code fails."""
    try:
        with wrap_foreign_errors(UnknownType):
            return _require_component(found)
    except ForeignFailure as error:
        raise UnknownType(f"{type_name} cannot be looked at: {error}") from error.__cause__


def _require_component(found: Any) -> type[Component]:
    """Return a `Component` class with valid ports and parameters; else raise UnknownType."""
    if not (isinstance(found, type) and issubclass(found, Component)):
        raise UnknownType("is not a dsa_des.Component")
    for name, kind in (("inputs", Input), ("outputs", Output)):
        ports = getattr(found, name)
        fine = isinstance(ports, Mapping) and all(
            isinstance(port, str) and isinstance(declared, kind) and _is_message(declared.message)
            for port, declared in ports.items()
        )
        if not fine:
            raise UnknownType(
                f"{found.import_path()} declares {name} wrongly: they must be a table of names and "
                f"dsa_des.{kind.__name__} of a dsa_des.Message"
            )
    if not (isinstance(found.Parameters, type) and issubclass(found.Parameters, Parameters)):
        raise UnknownType(
            f"{found.import_path()} declares Parameters wrongly: they must be a subclass of "
            "dsa_des.Parameters"
        )
    return found


def _is_message(kind: object) -> bool:
    return isinstance(kind, type) and issubclass(kind, Message)
