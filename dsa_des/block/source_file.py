"""Names of the form ``./file.py:Class``: a class in a file, wherever that lies.

A relative file is taken from the folder of the file that names it, or from the working directory
where the command line does.
"""

import importlib.util
import os
import sys
from pathlib import Path
from types import ModuleType

from dsa_des.block.module_search import last_on_path
from dsa_des.errors import nearest

_SUFFIX = ".py"


def split_name(name: str) -> tuple[str, str]:
    """Return the module or file, and the class, of ``module:Class`` or ``./file.py:Class``."""
    file, _, class_name = name.rpartition(":")
    if is_file(file):
        return file, class_name
    module, _, class_name = name.partition(":")
    return module, class_name


def is_file(name: str) -> bool:
    """Return whether a name is that of a file and not of a module: it holds a slash."""
    return name.endswith(_SUFFIX) and ("/" in name or os.sep in name)


def absolute(name: str) -> str:
    """Return ``./file.py:Class`` with its file written out; other names as they are.

    Parameters
    ----------
    name : str
        A `dsa_des.block.component.SourcedText` knows the folder of the file that it was written in.
    """
    file, class_name = split_name(name)
    return f"{path_of(name)}:{class_name}" if is_file(file) else name


def path_of(name: str) -> Path:
    """Return the file of ``./file.py:Class``."""
    file = os.path.expanduser(split_name(name)[0])
    return Path(os.path.abspath(Path(getattr(name, "folder", "")) / file))


def missing(path: Path) -> str:
    """Return what is wrong with a file that cannot be imported from; nothing if it is there."""
    try:
        if path.is_file():
            return ""
        if path.exists():
            return f"{path} is no regular file"
        close = nearest(path.name, [entry.name for entry in path.parent.glob(f"*{_SUFFIX}")])
    except (OSError, ValueError) as error:
        return f"{str(path)!r} cannot be read: {error}"
    return f"there is no file {path}" + (f"; did you mean {close}?" if close else "")


def imported(path: Path) -> ModuleType:
    """Return the module of a file, imported once; its name is its path.

    What lies beside it can be imported by it.
    """
    name = str(path)
    if name in sys.modules:
        return sys.modules[name]
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None and spec.loader is not None  # its name ends with .py
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    try:
        with last_on_path([str(path.parent)]):
            spec.loader.exec_module(module)
    except BaseException:
        del sys.modules[name]
        raise
    return module
