"""Importing what a file names: ``module:Class``, and entry points that other packages registered.

The working directory is where a user's own modules lie, and where anybody's files may lie. It is
looked at last, only for a module that is not installed, and only while that module is imported;
no file in it can stand in for one of ours or of an installed package.
"""

import contextlib
import importlib
import importlib.util
import io
import sys
from collections.abc import Callable, Iterator
from contextvars import ContextVar
from dataclasses import dataclass, field
from importlib.machinery import ModuleSpec, PathFinder
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import Any

from dsa_des.errors import UsageError, did_you_mean
from dsa_des.strangers import Left, strangers_code

_OURS = "dsa-des"
# Modules found beside the scene: what is beside them may be imported with them again.
_BESIDE: set[str] = set()


class NotImportable(Exception):
    """Something named by a file cannot be imported; the message says what and from where."""


class NotAllowed(NotImportable):
    """Something was not imported because nothing foreign may be; see `Imports`."""


@dataclass(frozen=True)
class Foreign:
    """One foreign module that something names.

    Parameters
    ----------
    key : str
        Who names it, for example ``blocks.radar.type``.
    name : str
        As it is named there, for example ``mine:Radar``.
    module : str
    file : str
        Where it would be imported from, or what it is instead of a file.
    """

    key: str
    name: str
    module: str
    file: str


@dataclass
class Imports:
    """What may be imported, and who is told before it is.

    Parameters
    ----------
    allowed : bool
        Whether foreign modules may be imported at all.
    announce : callable, optional
        Called with each `Foreign` before it is imported, or not.
    """

    allowed: bool = True
    announce: Callable[[Foreign], None] | None = None
    seen: set[Foreign] = field(default_factory=set)

    def about_to(self, foreign: Foreign) -> None:
        """Tell who wants to know.

        Raises
        ------
        NotAllowed
            If nothing foreign may be imported.
        """
        if self.announce is not None and foreign not in self.seen:
            self.seen.add(foreign)
            self.announce(foreign)
        if not self.allowed:
            raise NotAllowed("is not imported")


_ANYTHING = Imports()
_IMPORTS: ContextVar[Imports] = ContextVar("imports", default=_ANYTHING)


@contextlib.contextmanager
def imports(policy: Imports) -> Iterator[Imports]:
    """Apply a policy to all imports of what files name, meanwhile."""
    token = _IMPORTS.set(policy)
    try:
        yield policy
    finally:
        _IMPORTS.reset(token)


def load_named(name: str, key: str = "") -> Any:
    """Return what ``module:Class`` names.

    Parameters
    ----------
    name : str
    key : str
        Who names it, for messages.

    Raises
    ------
    NotImportable
        If it cannot be imported.
    """
    module_name, _, class_name = name.partition(":")
    if not class_name or not all(module_name.split(".")):
        raise NotImportable("must have the form module:Class")
    policy = _IMPORTS.get()
    if policy.announce is not None or not policy.allowed:
        policy.about_to(Foreign(key, name, module_name, file_of(module_name)))
    module = _imported(module_name)
    try:
        with strangers_code():
            return getattr(module, class_name)
    except Left as error:
        if not isinstance(error.__cause__, AttributeError):
            raise NotImportable(f"{_where(module)} cannot give {class_name!r}: {error}") from error
        known = [n for n in vars(module) if not n.startswith("_")]
        hint = did_you_mean(class_name, known)
        raise NotImportable(f"{_where(module)} has no {class_name!r}{hint}") from None


def load_point(point: EntryPoint, key: str = "") -> Any:
    """Return what an entry point names.

    Parameters
    ----------
    point : EntryPoint
    key : str
        Who names it; those of other packages are announced if somebody does.

    Raises
    ------
    NotImportable
        If it cannot be imported.
    """
    if key and not is_ours(point):
        policy = _IMPORTS.get()
        if policy.announce is not None or not policy.allowed:
            policy.about_to(Foreign(key, point.name, point.module, file_of(point.module)))
    try:
        with strangers_code(), _no_output(point.module):
            return point.load()
    except Left as error:
        what = f"cannot be imported from {point.value} ({file_of(point.module)}): {error}"
        raise NotImportable(what) from error.__cause__


def installed(point: EntryPoint) -> Any:
    """Return what a package registered that no file names: a section, a report, a command.

    Raises
    ------
    UsageError
        If it cannot be imported.
    """
    try:
        return load_point(point)
    except NotImportable as error:
        package = "" if point.dist is None else f" of the package {point.dist.name}"
        message = f"{point.group}: {point.name}{package} {error}"
        raise UsageError(message) from error.__cause__


def is_ours(point: EntryPoint) -> bool:
    """Return whether this package itself registered an entry point."""
    return point.dist is None or point.dist.name.lower().replace("_", "-") == _OURS


def file_of(module_name: str) -> str:
    """Return the file that a module is imported from, without importing anything.

    Where there is none: ``there is no such module``, or the kind of module it is.
    """
    try:
        spec = _spec(module_name)
    except (ImportError, AttributeError, TypeError, ValueError, OSError):
        spec = None
    if spec is None:
        return "there is no such module"
    if spec.has_location and spec.origin:
        return spec.origin
    if spec.submodule_search_locations:
        return "a folder without __init__.py"
    return spec.origin or "no file"


def _spec(module_name: str) -> ModuleSpec | None:
    top, *rest = module_name.split(".")
    with _path_for(top):
        # Finds the module of a name without dots; nothing is imported.
        spec = importlib.util.find_spec(top) if top else None
    name = top
    for part in rest:
        if spec is None or spec.submodule_search_locations is None:
            return None
        name = f"{name}.{part}"
        spec = PathFinder.find_spec(name, list(spec.submodule_search_locations))
    return spec


@contextlib.contextmanager
def _path_for(top: str) -> Iterator[None]:
    """Put the working directory last on the module path if nothing before it has the module."""
    here = str(Path.cwd())
    if here in sys.path or (not _is_beside(top, here) and _installed(top)):
        yield
        return
    importlib.invalidate_caches()
    sys.path.append(here)
    try:
        yield
    finally:
        with contextlib.suppress(ValueError):  # a module may have changed the path
            sys.path.reverse()
            sys.path.remove(here)
        sys.path.reverse()


def _is_beside(top: str, here: str) -> bool:
    return f"{here}:{top}" in _BESIDE


def _installed(top: str) -> bool:
    try:
        return top in sys.modules or importlib.util.find_spec(top) is not None
    except (ImportError, AttributeError, TypeError, ValueError, OSError):
        return False


def _imported(module_name: str) -> Any:
    top = module_name.partition(".")[0]
    here = str(Path.cwd())
    beside = _is_beside(top, here) or not _installed(top)
    try:
        with _path_for(top), strangers_code(), _no_output(module_name):
            module = importlib.import_module(module_name)
    except Left as error:
        raise NotImportable(_why(module_name, error)) from error.__cause__
    if beside:
        _BESIDE.add(f"{here}:{top}")
    return module


def _why(module_name: str, error: Left) -> str:
    cause, file = error.__cause__, file_of(module_name)
    missing = (cause.name or "") if isinstance(cause, ModuleNotFoundError) else ""
    if missing and (module_name == missing or module_name.startswith(f"{missing}.")):
        return (
            f"there is no module {module_name!r} in the working directory or on the Python path"
            f"{_shadowed(module_name)}"
        )
    if isinstance(cause, SystemExit):
        return (
            f"module {module_name!r} ({file}) cannot be imported: it left with sys.exit or "
            f"SystemExit ({error})"
        )
    if missing:
        return f"module {module_name!r} ({file}) cannot be imported: {cause}"
    return f"module {module_name!r} ({file}) cannot be imported: {error}"


def _shadowed(module_name: str) -> str:
    """Say which installed package of the same name was looked in instead of a folder here."""
    top, *rest = module_name.split(".")
    here = Path.cwd() / top
    found = file_of(top)
    if not rest or not here.is_dir() or Path(found).parent == here:
        return ""
    return f": {top} is the installed {found}, not the folder {here}; give that another name"


def _where(module: Any) -> str:
    file = getattr(module, "__file__", None)
    return f"module {module.__name__!r}" + (f" ({file})" if file else "")


class _Shown(io.TextIOBase):
    """Passes what a module prints while it is imported on to standard error, line by line."""

    def __init__(self, module_name: str) -> None:
        self._module_name = module_name
        self._rest = ""

    def writable(self) -> bool:
        """Return True: it takes text."""
        return True

    def write(self, text: str) -> int:
        """Print whole lines of `text`, each with the module's name."""
        from dsa_des.terminal import say

        *lines, self._rest = (self._rest + text).split("\n")
        for line in lines:
            say(f"{self._module_name}: {line}", err=True)
        return len(text)

    def finish(self) -> None:
        """Print what is left."""
        if self._rest:
            self.write("\n")


@contextlib.contextmanager
def _no_output(module_name: str) -> Iterator[None]:
    """Keep what is printed meanwhile off standard output, which may be JSON."""
    shown = _Shown(module_name)
    try:
        with contextlib.redirect_stdout(shown):
            yield
    finally:
        shown.finish()
