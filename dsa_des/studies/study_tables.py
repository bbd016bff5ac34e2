"""Tables of a study file, flattened to dotted keys or made independent of where they stand."""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from dsa_des.component import SourcedText
from dsa_des.studies.draws import KINDS

#: Tables that name axes and results; ``wires[4].drop_probability`` is no pattern of files there.
_NAMING_RESULTS = ("figures", "compare", "over", "stop_when")


def resolved(data: Mapping[str, Any], swaps: Iterable[tuple[str, list[str]]]) -> dict[str, Any]:
    """Return a study's tables with absolute paths, and further swap axes."""
    tables = {
        key: value if key in _NAMING_RESULTS else _absolute(value) for key, value in data.items()
    }
    for block, types in swaps:
        tables.setdefault("axes", {})[f"swap.{block}"] = types
    return tables


def _absolute(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _absolute(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_absolute(item) for item in value]
    if isinstance(value, SourcedText) and hasattr(value, "folder"):
        path = value.folder / Path(value).expanduser()
        if any(sign in value for sign in "*?[") or path.is_file():
            return str(path.resolve())
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
