"""The search for modules that a file names: installed ones first, then some folders.

The folders, such as the working directory and that of the scene, are where foreign files may
lie. They are put last on the module path, only while a module that is not installed is imported.
"""

import contextlib
import importlib
import importlib.util
import sys
from collections.abc import Iterable, Iterator, Sequence
from importlib.machinery import ModuleSpec, PathFinder
from pathlib import Path

_UNFINDABLE = (ImportError, AttributeError, TypeError, ValueError, OSError)
# Top module → the folder it was found in: what is beside it may be imported with it again.
_FOUND: dict[str, str] = {}


def searched(beside: Iterable[Path] = ()) -> list[str]:
    """Return the folders looked in besides the module path, the working directory first."""
    return list(dict.fromkeys(str(Path.cwd() / folder) for folder in (Path(), *beside)))


@contextlib.contextmanager
def last_on_path(folders: Sequence[str]) -> Iterator[None]:
    """Put folders last on the module path, meanwhile, those that are not on it."""
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


def needed(top: str, folders: Sequence[str]) -> Sequence[str]:
    """Return the folders that a module may be found in: none if it is installed."""
    return folders if _FOUND.get(top) in folders or not is_installed(top) else ()


def is_installed(top: str) -> bool:
    """Return whether a module is imported already or found on the module path."""
    try:
        return top in sys.modules or importlib.util.find_spec(top) is not None
    except _UNFINDABLE:
        return False


def remember(top: str, folders: Sequence[str]) -> None:
    """Note in which of the folders a module was found."""
    for folder in folders:
        if PathFinder.find_spec(top, [folder]) is not None:
            _FOUND[top] = folder
            return


def other_of_the_name(top: str, folders: Sequence[str]) -> tuple[str, str] | None:
    """Return the files of an imported module and of another of its name that is meant now.

    None if what was imported is meant.
    """
    loaded = getattr(sys.modules.get(top), "__file__", None)
    if top not in _FOUND or loaded is None:
        return None
    meant = PathFinder.find_spec(top, [*sys.path, *folders])
    if meant is None or meant.origin is None or Path(meant.origin) == Path(loaded):
        return None
    return loaded, meant.origin


def file_of(module_name: str, beside: Iterable[Path] = ()) -> str:
    """Return the file that a module is imported from, without importing anything.

    Where there is none: ``there is no such module``, or the kind of module it is.
    """
    try:
        spec = _spec(module_name, searched(beside))
    except _UNFINDABLE:
        spec = None
    if spec is None:
        return "there is no such module"
    if spec.has_location and spec.origin:
        return spec.origin
    if spec.submodule_search_locations:
        return "a folder without __init__.py"
    return spec.origin or "no file"


def _spec(module_name: str, folders: Sequence[str]) -> ModuleSpec | None:
    top, *rest = module_name.split(".")
    with last_on_path(needed(top, folders)):
        # Finds the module of a name without dots; nothing is imported.
        spec = importlib.util.find_spec(top) if top else None
    name = top
    for part in rest:
        if spec is None or spec.submodule_search_locations is None:
            return None
        name = f"{name}.{part}"
        spec = PathFinder.find_spec(name, list(spec.submodule_search_locations))
    return spec
