"""Finding blocks by name: entry points of group ``dsa_des.components``, or ``module:Class``.

Our own blocks are registered in the same way as a stranger's.
"""

import importlib
import sys
from pathlib import Path
from typing import Any

from dsa_des.component import Component
from dsa_des.entry_points import registered
from dsa_des.errors import did_you_mean


class UnknownType(Exception):
    """A block type cannot be found or is not a component; the message says what is allowed."""


def find(type_name: str) -> type[Component]:
    """Return the class of a registered block type or of ``module:Class``.

    Raises
    ------
    UnknownType
        If it cannot be imported or is not a `Component`.
    """
    if ":" in type_name:
        found = import_named(type_name)
    else:
        point = registered().get(type_name)
        if point is None:
            hint = did_you_mean(type_name, registered())
            raise UnknownType(f"unknown block type{hint} (or module:Class)")
        try:
            found = point.load()
        except Exception as error:
            raise UnknownType(f"cannot be imported from {point.value}: {error}") from error
    if not (isinstance(found, type) and issubclass(found, Component)):
        raise UnknownType("is not a dsa_des.Component")
    return found


def import_named(type_name: str) -> Any:
    """Return what ``module:Class`` names, also beside the working directory.

    Raises
    ------
    UnknownType
        If it cannot be imported.
    """
    module_name, _, class_name = type_name.partition(":")
    # `module:Class` beside the user's scene is the common case; a console script, unlike
    # `python -m`, does not put the working directory on the path.
    here = str(Path.cwd())
    if here not in sys.path:
        sys.path.insert(0, here)
    try:
        module = importlib.import_module(module_name)
    except ModuleNotFoundError as error:
        if error.name and (module_name == error.name or module_name.startswith(error.name + ".")):
            raise UnknownType(
                f"there is no module {module_name!r} in the working directory or on the Python path"
            ) from error
        raise UnknownType(f"module {module_name!r} cannot be imported: {error}") from error
    except Exception as error:
        raise UnknownType(
            f"module {module_name!r} cannot be imported: {type(error).__name__}: {error}"
        ) from error
    try:
        return getattr(module, class_name)
    except AttributeError:
        hint = did_you_mean(class_name, [n for n in vars(module) if not n.startswith("_")])
        raise UnknownType(f"module {module_name!r} has no {class_name!r}{hint}") from None
