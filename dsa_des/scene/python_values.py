"""Values that a Python program gives, as a scene file would hold them."""

from collections.abc import Mapping
from fractions import Fraction
from pathlib import Path
from typing import Any

from dsa_des.block.class_text import sourced, type_text
from dsa_des.block.component import as_written
from dsa_des.block.entry_points import COMPONENTS


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
