"""The files of the folders that packages ship: scenes, studies and parts of them, by name.

A package registers a function under the entry-point group `GROUP`. It takes nothing and returns
the folder of its scenes and studies.
"""

import glob
import os
from collections.abc import Iterator
from pathlib import Path, PurePosixPath

from dsa_des.block.entry_points import entry_points_of
from dsa_des.block.foreign_calls import ForeignFailure, wrap_foreign_errors
from dsa_des.block.shadowed_packages import load_unnamed_entry_point
from dsa_des.errors import UsageError

#: The entry points of functions that return a folder of scenes and studies.
GROUP = "dsa_des.examples"


def example_folders() -> list[Path]:
    """Return the folders of examples of all installed packages.

    UsageError if one of them cannot be asked.
    """
    found = []
    for point in entry_points_of(GROUP).values():
        try:
            with wrap_foreign_errors(UsageError):
                found.append(Path(load_unnamed_entry_point(point)()))
        except ForeignFailure as error:
            message = f"{GROUP}: {point.name} gives no folder: {error}"
            raise UsageError(message) from error.__cause__
    return [folder for folder in found if folder.is_dir()]


def existing_or_shipped_path(path: Path, name: str) -> Path:
    """Return the path if it exists, else the only shipped file `name` matches, else the path.

    The name is as it was written: ``alerting/do365b.conf``, or ``do365b.conf`` where only one is
    called so.
    """
    wanted = PurePosixPath(name)
    if os.path.lexists(path) or wanted.is_absolute() or not wanted.suffix or ".." in wanted.parts:
        return path
    there = [folder / wanted for folder in example_folders() if (folder / wanted).is_file()]
    if not there and len(wanted.parts) == 1:
        there = [found for folder in example_folders() for found in folder.rglob(glob.escape(name))]
    return there[0] if len(there) == 1 else path


def shipped_files() -> Iterator[tuple[PurePosixPath, Path]]:
    """Yield (path in its folder without ``.toml``, full path) of every shipped TOML file."""
    for folder in example_folders():
        for path in sorted(folder.rglob("*.toml")):
            yield PurePosixPath(path.relative_to(folder).with_suffix("").as_posix()), path


def find_shipped_files(name: str) -> list[Path]:
    """Return shipped TOML files a name can mean: the one at that path, or all so named.

    Names are ``first_light`` or ``systems/oasys``, with ``.toml`` or without.
    """
    wanted = PurePosixPath(name.removesuffix(".toml"))
    if not wanted.name or wanted.is_absolute() or ".." in wanted.parts:
        return []
    files = list(shipped_files())
    whole = [path for place, path in files if place == wanted]
    if whole or len(wanted.parts) > 1:
        return whole[:1]
    return [path for place, path in files if place.name == wanted.name]
