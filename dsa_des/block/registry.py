"""Entry points of this and other packages, by group and name."""

from collections.abc import Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

from dsa_des.block.class_text import ClassText
from dsa_des.block.component import Component, Input, Output, Parameters
from dsa_des.block.entry_points import registered
from dsa_des.block.foreign import (
    NotAllowed,
    NotImportable,
    installed,
    is_ours,
    load_named,
    load_point,
)
from dsa_des.block.foreign_calls import ForeignFailure, foreign_code
from dsa_des.block.message import Message
from dsa_des.errors import did_you_mean

SECTIONS = "dsa_des.sections"


@lru_cache(maxsize=1)
def section_models() -> dict[str, type[Parameters]]:
    """Return the registered section models by table name, sorted."""
    return {name: installed(point) for name, point in registered(SECTIONS).items()}


class UnknownType(Exception):
    """A block type cannot be found or is not a component; the message says what is allowed."""


class NotImported(UnknownType):
    """A block type is foreign, and nothing foreign may be imported.

    See `dsa_des.block.foreign.Imports`.
    """


def find(type_name: str, key: str = "", beside: Sequence[Path] = ()) -> type[Component]:
    """Return the class of a registered block type, ``module:Class`` or ``./file.py:Class``.

    The `key` names it, for messages; modules may lie in the folders `beside`. Raises NotImported if
    it may not be imported, and UnknownType if it cannot be or is not a `Component`.
    """
    if isinstance(type_name, ClassText):
        return _looked_at(type_name, type_name.cls)
    point = registered().get(type_name)
    if point is None and ":" not in type_name:
        module, _, last = type_name.rpartition(".")
        if module and last[:1].isupper():  # as Python writes it
            raise UnknownType(f"unknown block type; did you mean '{module}:{last}' (module:Class)?")
        hint = did_you_mean(type_name, registered())
        raise UnknownType(f"unknown block type{hint} (or module:Class)")
    try:
        found = load_named(type_name, key, beside) if point is None else load_point(point, key)
    except NotAllowed as error:
        raise NotImported(str(error)) from None
    except NotImportable as error:
        raise UnknownType(str(error)) from error.__cause__
    if point is not None and is_ours(point):
        return _component(found)
    return _looked_at(type_name, found)


def _looked_at(type_name: str, found: Any) -> type[Component]:
    """Return a stranger's class if it is a component."""
    try:
        with foreign_code(UnknownType):
            return _component(found)
    except ForeignFailure as error:
        raise UnknownType(f"{type_name} cannot be looked at: {error}") from error.__cause__


def _component(found: Any) -> type[Component]:
    """Return a class if it declares what the engine reads of every block."""
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
                f"{found.path()} declares {name} wrongly: they must be a table of names and "
                f"dsa_des.{kind.__name__} of a dsa_des.Message"
            )
    if not (isinstance(found.Parameters, type) and issubclass(found.Parameters, Parameters)):
        raise UnknownType(
            f"{found.path()} declares Parameters wrongly: they must be a subclass of "
            "dsa_des.Parameters"
        )
    return found


def _is_message(kind: object) -> bool:
    return isinstance(kind, type) and issubclass(kind, Message)
