"""Tables of a study file, flattened to dotted keys or made independent of where they stand."""

import os
from collections.abc import Iterable, Mapping
from typing import Any

from dsa_des.component import SourcedText
from dsa_des.input_files import InputFileError, is_regular_file, resolve_home
from dsa_des.studies.draws import KINDS

#: What holds no paths: texts for people, and tables that name axes and results;
#: ``wires[4].drop_probability`` is no pattern of files there.
_NO_PATHS = ("title", "description", "figures", "compare", "over", "stop_when")


def resolved(data: Mapping[str, Any], swaps: Iterable[tuple[str, list[str]]]) -> dict[str, Any]:
    """Return a study's tables with absolute paths, and further swap axes."""
    tables = {key: value if key in _NO_PATHS else _absolute(value) for key, value in data.items()}
    for block, types in swaps:
        tables.setdefault("axes", {})[f"swap.{block}"] = types
    return tables


def _absolute(value: Any, patterns: bool = False) -> Any:
    """Return a value with texts that name files, or are patterns of them, as absolute paths."""
    if isinstance(value, Mapping):
        return {key: _absolute(item, key == "files") for key, item in value.items()}
    if isinstance(value, list):
        return [_absolute(item, patterns) for item in value]
    if isinstance(value, SourcedText) and hasattr(value, "folder"):
        try:
            path = value.folder / resolve_home(str(value))
        except InputFileError:  # a text that can be no path
            return value
        if is_regular_file(path) or (patterns and any(sign in value for sign in "*?[")):
            return os.path.realpath(path)
    return value


def flat_values(tables: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Return dotted key → value; tables on the way are keys of the scene."""
    found: dict[str, Any] = {}
    for name, value in tables.items():
        key = f"{prefix}.{name}" if prefix else str(name)
        if isinstance(value, dict):
            found |= flat_values(value, key)
        else:
            found[key] = value
    return found


def flat_draws(tables: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Return dotted key → how it is drawn."""
    found: dict[str, Any] = {}
    for name, value in tables.items():
        key = f"{prefix}.{name}" if prefix else str(name)
        if isinstance(value, dict) and value and not set(value) & set(KINDS):
            nested = any(isinstance(item, dict) for item in value.values())
            found |= flat_draws(value, key) if nested else {key: value}
        else:
            found[key] = value
    return found
