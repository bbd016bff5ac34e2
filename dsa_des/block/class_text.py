"""Classes in place of ``module:Class``: in Python a scene may name a class itself."""

import importlib
import sys
from typing import Any

from dsa_des.block.component import SourcedText
from dsa_des.block.entry_points import registered


class ClassText(str):
    """The text ``module:Class`` of a class that cannot be found by that text.

    It is defined in ``__main__``, in a notebook or inside a function; the class comes along.
    """

    __slots__ = ("cls",)
    cls: type


def type_text(cls: type, group: str) -> str:
    """Return how a scene names a class: as registered in a group of entry points.

    Else as ``module:Class`` where any process can import it, and else as a `ClassText`.
    """
    path = f"{cls.__module__}:{cls.__qualname__}"
    for name, point in registered(group).items():
        if point.value == path:
            return name
    if _is_importable(cls):
        return path
    text = ClassText(path)
    text.cls = cls
    return text


def classes_in(value: Any) -> list[str]:
    """Return every `ClassText` in tables and lists."""
    if isinstance(value, ClassText):
        return [value]
    if isinstance(value, dict):
        return [text for item in value.values() for text in classes_in(item)]
    if isinstance(value, list | tuple):
        return [text for item in value for text in classes_in(item)]
    return []


def sourced(value: str, folder: Any) -> str:
    """Return a text as written in a file of a folder; a class stays one."""
    return value if isinstance(value, ClassText) else SourcedText.of(value, folder)


def _is_importable(cls: type) -> bool:
    """Return whether another process finds this very class by its module and name."""
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
