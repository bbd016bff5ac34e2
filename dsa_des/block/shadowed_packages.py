"""Another package of the name of one of ours, found before it on the module path."""

import contextlib
import importlib
import importlib.util
import io
import sys
from collections.abc import Callable, Iterator, Sequence
from contextvars import ContextVar
from dataclasses import dataclass, field
from functools import lru_cache
from importlib.metadata import Distribution, EntryPoint
from pathlib import Path
from typing import Any

from dsa_des.block import source_file
from dsa_des.block.foreign_calls import ForeignFailure, wrap_foreign_errors
from dsa_des.block.source_file import (
    append_to_module_path,
    file_of_module,
    files_of_conflicting_modules,
    folders_for_module,
    module_search_folders,
    remember_module_folder,
)
from dsa_des.errors import UsageError, did_you_mean

#: Where our packages lie side by side.
_HOME = Path(__file__).parents[2]


def refuse_hidden_module(module_name: str) -> None:
    """Raise UsageError if a foreign module's top-level name would hide a package of ours."""
    top = module_name.partition(".")[0]
    ours = _HOME / top
    found = _location_of_module(top)
    if found is None or not (ours / "__init__.py").is_file():
        return
    folder = found.parent if found.name == "__init__.py" else found
    if folder == ours or folder.resolve() == ours.resolve():
        return
    raise UsageError(
        f"the module {top!r} is {found}, which hides the package {ours} that dsa-des needs: "
        "give it another name, or take it off the Python path"
    )


def _location_of_module(top: str) -> Path | None:
    """Return the file of a module, imported or not; the folder of one without ``__init__.py``."""
    try:
        loaded = sys.modules.get(top)
        spec = importlib.util.find_spec(top) if loaded is None else None
    except (ImportError, ValueError, OSError):
        return None
    file = getattr(loaded, "__file__", None) or (spec and spec.has_location and spec.origin)
    if file:
        return Path(file)
    places = getattr(loaded, "__path__", None) or (spec and spec.submodule_search_locations)
    return next(map(Path, places or ()), None)


_OURS = "dsa-des"


class NotImportable(Exception):
    """Something named by a file cannot be imported; the message says what and from where."""


class NotAllowed(NotImportable):
    """Something was not imported because nothing foreign may be; see `Imports`."""


@dataclass(frozen=True)
class Foreign:
    """A module outside this package named in a file at `key`, such as ``blocks.radar.type``.

    `name` is as it stands there, for example ``mine:Radar``; `file` is where it would be imported
    from, or what it is instead of a file.
    """

    key: str
    name: str
    module: str
    file: str


@dataclass
class Imports:
    """Whether foreign modules may be imported, and a function told of each `Foreign` beforehand."""

    allowed: bool = True
    announce: Callable[[Foreign], None] | None = None
    seen: set[Foreign] = field(default_factory=set)

    def announce_or_refuse_import(self, foreign: Foreign) -> None:
        """Announce a foreign module once; NotAllowed if foreign modules may not be imported."""
        if self.announce is not None and foreign not in self.seen:
            self.seen.add(foreign)
            self.announce(foreign)
        if not self.allowed:
            raise NotAllowed("is not imported")


_ANYTHING = Imports()
_IMPORTS: ContextVar[Imports] = ContextVar("imports", default=_ANYTHING)


@contextlib.contextmanager
def import_policy(policy: Imports) -> Iterator[Imports]:
    """Apply an import policy to all modules that files name, while the context lasts."""
    token = _IMPORTS.set(policy)
    try:
        yield policy
    finally:
        _IMPORTS.reset(token)


def import_named_object(name: str, key: str = "", beside: Sequence[Path] = ()) -> Any:
    """Return what ``module:Class`` or ``./file.py:Class`` names; `NotImportable` if it cannot be.

    A name that knows the folder it was written in (`SourcedText`) is looked for there, too, and in
    the folders `beside`. The `key` names it, for messages.
    """
    module_name, class_name = source_file.split_type_name(name)
    path = (
        source_file.absolute_file_path(name)
        if source_file.is_python_file_path(module_name)
        else None
    )
    if not class_name or (path is None and not all(module_name.split("."))):
        raise NotImportable("must have the form module:Class or ./file.py:Class")
    beside = (*([Path(name.folder)] if hasattr(name, "folder") else []), *beside)
    policy = _IMPORTS.get()
    if policy.announce is not None or not policy.allowed:
        file = file_of_module(module_name, beside) if path is None else str(path)
        short = module_name if path is None else path.stem
        policy.announce_or_refuse_import(Foreign(key, name, short, file))
    module = _import_module(module_name, beside) if path is None else _import_file(path)
    try:
        with wrap_foreign_errors():
            return getattr(module, class_name)
    except ForeignFailure as error:
        if not isinstance(error.__cause__, AttributeError):
            raise NotImportable(
                f"{_folder_of_module(module)} cannot give {class_name!r}: {error}"
            ) from error
        known = [n for n in vars(module) if not n.startswith("_")]
        hint = did_you_mean(class_name, known)
        raise NotImportable(f"{_folder_of_module(module)} has no {class_name!r}{hint}") from None


def load_entry_point(point: EntryPoint, key: str = "") -> Any:
    """Import and return an entry point's object; with `key`, announce foreign ones first.

    Raises NotImportable if it cannot be imported, and UsageError if it is ours and another package
    hides it.
    """
    if is_own_entry_point(point):
        refuse_hidden_module(point.module)
    elif key:
        policy = _IMPORTS.get()
        if policy.announce is not None or not policy.allowed:
            policy.announce_or_refuse_import(
                Foreign(key, point.name, point.module, file_of_module(point.module))
            )
    try:
        with wrap_foreign_errors(), _redirect_stdout_to_stderr(point.module):
            return point.load()
    except ForeignFailure as error:
        what = f"cannot be imported from {point.value} ({file_of_module(point.module)}): {error}"
        raise NotImportable(what) from error.__cause__


def load_unnamed_entry_point(point: EntryPoint) -> Any:
    """Import and return an entry point's object that no scene names; UsageError if that fails.

    UsageError if it cannot be imported.
    """
    try:
        return load_entry_point(point)
    except NotImportable as error:
        package = "" if point.dist is None else f" of the package {point.dist.name}"
        message = f"{point.group}: {point.name}{package} {error}"
        raise UsageError(message) from error.__cause__


def is_own_entry_point(point: EntryPoint) -> bool:
    """Return whether this package itself registered an entry point."""
    return point.dist is None or _normalised_distribution_name(point.dist) == _OURS


@lru_cache(maxsize=64)
def _normalised_distribution_name(distribution: Distribution) -> str:
    """Return a distribution's name in lower case with ``-`` in place of ``_``."""
    return distribution.name.lower().replace("_", "-")


def _import_module(module_name: str, beside: Sequence[Path]) -> Any:
    top = module_name.partition(".")[0]
    folders = module_search_folders(beside)
    if others := files_of_conflicting_modules(top, folders):
        raise NotImportable(
            f"module {top!r} was imported from {others[0]} before, which {others[1]} is not: "
            "name that ./FILE.py:CLASS"
        )
    extra = folders_for_module(top, folders)
    try:
        with (
            append_to_module_path(extra),
            wrap_foreign_errors(),
            _redirect_stdout_to_stderr(module_name),
        ):
            module = importlib.import_module(module_name)
    except ForeignFailure as error:
        raise NotImportable(_explain_failure(module_name, beside, error)) from error.__cause__
    remember_module_folder(top, extra)
    return module


def _import_file(path: Path) -> Any:
    if what := source_file.missing_file_reason(path):
        raise NotImportable(what)
    try:
        with wrap_foreign_errors(), _redirect_stdout_to_stderr(path.name):
            return source_file.import_file(path)
    except ForeignFailure as error:
        left = "it left with " if isinstance(error.__cause__, SystemExit) else ""
        raise NotImportable(f"{path} cannot be imported: {left}{error}") from error.__cause__


def _explain_failure(module_name: str, beside: Sequence[Path], error: ForeignFailure) -> str:
    cause, file = error.__cause__, file_of_module(module_name, beside)
    missing = (cause.name or "") if isinstance(cause, ModuleNotFoundError) else ""
    if missing and (module_name == missing or module_name.startswith(f"{missing}.")):
        others = [folder for folder in module_search_folders(beside)[1:] if Path(folder).is_dir()]
        return (
            f"there is no module {module_name!r} in the working directory"
            f"{''.join(f', in {folder}' for folder in others)} or on the Python path"
            f"{_describe_shadowed_folder(module_name)}"
        )
    if isinstance(cause, SystemExit):
        return (
            f"module {module_name!r} ({file}) cannot be imported: it left with sys.exit or "
            f"SystemExit ({error})"
        )
    if missing:
        return f"module {module_name!r} ({file}) cannot be imported: {cause}"
    return f"module {module_name!r} ({file}) cannot be imported: {error}"


def _describe_shadowed_folder(module_name: str) -> str:
    """Return a hint that an installed package hides the folder of the same name; else empty."""
    top, *rest = module_name.split(".")
    here = Path.cwd() / top
    found = file_of_module(top)
    if not rest or not here.is_dir() or Path(found).parent == here:
        return ""
    return f": {top} is the installed {found}, not the folder {here}; give that another name"


def _folder_of_module(module: Any) -> str:
    file = getattr(module, "__file__", None)
    if file == module.__name__:
        return str(file)
    return f"module {module.__name__!r}" + (f" ({file})" if file else "")


class _Shown(io.TextIOBase):
    """A text stream that copies a module's prints during import to standard error, by line."""

    def __init__(self, module_name: str) -> None:
        self._module_name = module_name
        self._rest = ""

    def writable(self) -> bool:
        """Return True: it takes text."""
        return True

    def write(self, text: str) -> int:
        """Print all ended lines, each after the module's name; return the length of `text`."""
        from dsa_des.terminal.terminal import say

        *lines, self._rest = (self._rest + text).split("\n")
        for line in lines:
            say(f"{self._module_name}: {line}", err=True)
        return len(text)

    def print_unfinished_line(self) -> None:
        """Print the last line if it was not ended."""
        if self._rest:
            self.write("\n")


@contextlib.contextmanager
def _redirect_stdout_to_stderr(module_name: str) -> Iterator[None]:
    """Send prints inside the context to standard error, as standard output may be JSON."""
    shown = _Shown(module_name)
    try:
        with contextlib.redirect_stdout(shown):
            yield
    finally:
        shown.print_unfinished_line()
