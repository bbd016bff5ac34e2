"""Tables of a study file, flattened to dotted keys or made independent of where they stand."""

import math
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from dsa_des.block.component import SourcedText
from dsa_des.studies.draws import KINDS, as_text

#: Tables that name axes and results; ``wires[4].drop_probability`` is no pattern of files there.
_NAMING_RESULTS = ("title", "description", "figures", "compare", "over", "stop_when")
#: The key of an axis whose values are patterns of file names.
_PATTERNS = "files"


def resolved(data: Mapping[str, Any], swaps: Iterable[tuple[str, list[str]]]) -> dict[str, Any]:
    """Return a study's tables with absolute paths, and further swap axes."""
    tables = {
        key: value if key in _NAMING_RESULTS else _absolute(value) for key, value in data.items()
    }
    for block, types in swaps:
        tables.setdefault("axes", {})[f"swap.{block}"] = types
    return tables


def _absolute(value: Any, key: str = "") -> Any:
    if isinstance(value, Mapping):
        return {name: _absolute(item, str(name)) for name, item in value.items()}
    if isinstance(value, list):
        return [_absolute(item, key) for item in value]
    if isinstance(value, SourcedText) and hasattr(value, "folder"):
        if key == _PATTERNS and any(sign in value for sign in "*?["):
            try:
                return str((value.folder / Path(value).expanduser()).resolve())
            except (OSError, ValueError, RuntimeError):
                return value
        path = existing_file(value, value.folder)
        return value if path is None else str(path.resolve())
    return value


def existing_file(text: str, folder: Path) -> Path | None:
    """Return the file that a text names, seen from a folder; None if it names none.

    Any text may be asked about: too long for a name, with a NUL, or with an unknown user's ``~``.
    """
    try:
        path = folder / Path(text).expanduser()
        return path if path.is_file() else None
    except (OSError, ValueError, RuntimeError):
        return None


def json_safe(value: Any) -> Any:
    """Return a value that JSON can hold: what it has no form for becomes text."""
    if isinstance(value, Mapping):
        return {str(key): json_safe(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [json_safe(item) for item in value]
    if value is None or isinstance(value, bool):
        return value
    if isinstance(value, str):
        return str(value)
    if isinstance(value, int):
        # Digits in base 16 can always be written; those in base 10 only up to some thousand.
        return value if abs(value) < 2**63 else hex(value)
    if isinstance(value, float):
        return value if math.isfinite(value) else repr(value)
    return as_text(value)


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
