"""Files that are no scenes, and what packages make of them: a scene that holds what is in them.

A package registers a function under the entry-point group `GROUP`. It takes a path, and returns a
`DataScene`, or None where the file is of no kind that it knows; UsageError says what is wrong with
one that is.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from dsa_des.block.entry_points import entry_points_of
from dsa_des.block.shadowed_packages import load_unnamed_entry_point
from dsa_des.files.input_files import InputFileError, is_regular_file, read_input_text
from dsa_des.files.toml_files import NotToml, TomlError, parse_toml

GROUP = "dsa_des.recordings"
#: A scene in TOML is not larger where its name does not say that it is one.
_LARGEST_SCENE_BYTES = 1024 * 1024


class DataScene(NamedTuple):
    """A scene made from a data file: its tables, and lines that describe the file to people."""

    tables: Mapping[str, Any]
    about: list[str]


def scene_from_data_file(path: Path) -> DataScene | None:
    """Return the scene an installed reader makes of a data file; None for TOML or unknown files."""
    if not is_regular_file(path) or path.suffix.lower() == ".toml":
        return None
    try:
        parse_toml(read_input_text(path, _LARGEST_SCENE_BYTES))
        return None
    except NotToml:
        pass
    except TomlError:  # TOML that is too deep, say: its reader says so
        return None
    except InputFileError:
        pass
    for point in entry_points_of(GROUP).values():
        found: DataScene | None = load_unnamed_entry_point(point)(path)
        if found is not None:
            return found
    return None
