"""The search for modules that a file names: installed ones first, then some folders.

The folders, such as the working directory and that of the scene, are where foreign files may
lie. They are put last on the module path, only while a module that is not installed is imported.
"""

import contextlib
import importlib
import importlib.util
import os
import sys
from collections.abc import Iterable, Iterator, Sequence
from importlib.machinery import ModuleSpec, PathFinder
from pathlib import Path
from types import ModuleType

from dsa_des.errors import nearest_name

_UNFINDABLE = (ImportError, AttributeError, TypeError, ValueError, OSError)
# Top module → the folder it was found in: what is beside it may be imported with it again.
_FOUND: dict[str, str] = {}


def module_search_folders(beside: Iterable[Path] = ()) -> list[str]:
    """Return absolute module folders besides ``sys.path``: working directory, then `beside`."""
    return list(dict.fromkeys(str(Path.cwd() / folder) for folder in (Path(), *beside)))


@contextlib.contextmanager
def append_to_module_path(folders: Sequence[str]) -> Iterator[None]:
    """Append those folders that are not on ``sys.path`` to its end, while the context lasts."""
    added = [folder for folder in folders if folder not in sys.path]
    if added:
        importlib.invalidate_caches()
    sys.path += added
    try:
        yield
    finally:
        for folder in reversed(added):
            with contextlib.suppress(ValueError):  # a module may have changed the path
                sys.path.reverse()
                sys.path.remove(folder)
            sys.path.reverse()


def folders_for_module(top: str, folders: Sequence[str]) -> Sequence[str]:
    """Return the folders to search for a module; none if it is installed."""
    return folders if _FOUND.get(top) in folders or not is_imported_or_importable(top) else ()


def is_imported_or_importable(top: str) -> bool:
    """Return whether a module is imported already or can be found on ``sys.path``."""
    try:
        return top in sys.modules or importlib.util.find_spec(top) is not None
    except _UNFINDABLE:
        return False


def remember_module_folder(top: str, folders: Sequence[str]) -> None:
    """Remember in which of the folders a module is found."""
    for folder in folders:
        if PathFinder.find_spec(top, [folder]) is not None:
            _FOUND[top] = folder
            return


def files_of_conflicting_modules(top: str, folders: Sequence[str]) -> tuple[str, str] | None:
    """Return (file of the imported module, file that its name means now); None if they are one.

    None if what was imported is meant.
    """
    loaded = getattr(sys.modules.get(top), "__file__", None)
    if top not in _FOUND or loaded is None:
        return None
    meant = PathFinder.find_spec(top, [*sys.path, *folders])
    if meant is None or meant.origin is None or Path(meant.origin) == Path(loaded):
        return None
    return loaded, meant.origin


def file_of_module(module_name: str, beside: Iterable[Path] = ()) -> str:
    """Return the file that a module is imported from, without importing anything.

    Where there is none: ``there is no such module``, or the kind of module it is.
    """
    try:
        spec = _find_module_spec(module_name, module_search_folders(beside))
    except _UNFINDABLE:
        spec = None
    if spec is None:
        return "there is no such module"
    if spec.has_location and spec.origin:
        return spec.origin
    if spec.submodule_search_locations:
        return "a folder without __init__.py"
    return spec.origin or "no file"


def _find_module_spec(module_name: str, folders: Sequence[str]) -> ModuleSpec | None:
    top, *rest = module_name.split(".")
    with append_to_module_path(folders_for_module(top, folders)):
        # Finds the module of a name without dots; nothing is imported.
        spec = importlib.util.find_spec(top) if top else None
    name = top
    for part in rest:
        if spec is None or spec.submodule_search_locations is None:
            return None
        name = f"{name}.{part}"
        spec = PathFinder.find_spec(name, list(spec.submodule_search_locations))
    return spec


_SUFFIX = ".py"


def split_type_name(name: str) -> tuple[str, str]:
    """Return (module or file path, class name) of ``module:Class`` or ``./file.py:Class``."""
    file, _, class_name = name.rpartition(":")
    if is_python_file_path(file):
        return file, class_name
    module, _, class_name = name.partition(":")
    return module, class_name


def is_python_file_path(name: str) -> bool:
    """Return whether a name is a Python file's path (contains a slash), not a module."""
    return name.endswith(_SUFFIX) and ("/" in name or os.sep in name)


def absolute_type_name(name: str) -> str:
    """Return ``./file.py:Class`` with its file's absolute path; return other names unchanged.

    A `SourcedText` knows the folder of the file that it was written in.
    """
    file, class_name = split_type_name(name)
    return f"{absolute_file_path(name)}:{class_name}" if is_python_file_path(file) else name


def absolute_file_path(name: str) -> Path:
    """Return the absolute path of the file in ``./file.py:Class``."""
    file = os.path.expanduser(split_type_name(name)[0])
    return Path(os.path.abspath(Path(getattr(name, "folder", "")) / file))


def missing_file_reason(path: Path) -> str:
    """Return why a module's file cannot be imported, such as none there; empty if it is there."""
    try:
        if path.is_file():
            return ""
        if path.exists():
            return f"{path} is no regular file"
        close = nearest_name(path.name, [entry.name for entry in path.parent.glob(f"*{_SUFFIX}")])
    except (OSError, ValueError) as error:
        return f"{str(path)!r} cannot be read: {error}"
    return f"there is no file {path}" + (f"; did you mean {close}?" if close else "")


def import_file(path: Path) -> ModuleType:
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
        with append_to_module_path([str(path.parent)]):
            spec.loader.exec_module(module)
    except BaseException:
        del sys.modules[name]
        raise
    return module
