"""Tables of a study file: figures, requirements, draws, and paths seen from anywhere."""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from dsa_des.block.component import SourcedText
from dsa_des.errors import did_you_mean
from dsa_des.results.record import FigureRecord, Requirement, as_text
from dsa_des.scene.scene_file import Key
from dsa_des.studies.axes import Axis

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


FIGURES = {
    "axis": ("metric", "axis", "lines"),
    "heat": ("metric", "x", "y"),
    "map": ("metric", "x", "y", "limit"),
    "polar": ("metric", "axis"),
    "histogram": ("metric", "axis"),
    "cdf": ("metric", "axis"),
    "series": ("metric", "freedom", "limit"),
    "run": ("cell", "replica"),
}
_MOST_FREEDOM = 1e6
_AXES = ("axis", "lines", "x", "y")


def _each_table(
    name: str, items: Any, add: Callable[..., None]
) -> Iterator[tuple[Key, dict[str, Any]]]:
    """Give key and content of each table of a list; what else it holds is a problem."""
    if not isinstance(items, list):
        add((name,), f"must be a list of tables ([[{name}]])")
        return
    for number, item in enumerate(items):
        if isinstance(item, dict):
            yield (name, number), item
        else:
            add((name, number), f"must be a table ([[{name}]])", item)


def read_figures(
    items: Any,
    axes: tuple[Axis, ...],
    replicas: int,
    column: Callable[[Key, Any, tuple[Axis, ...]], str | None],
    add: Callable[..., None],
) -> tuple[FigureRecord, ...]:
    """Return the figures of a study.

    `column` gives the column of the axis that a name means, or reports that there is none; `add`
    takes the key, the message and the value of a problem.
    """
    most = {"cell": math.prod(len(axis.labels) for axis in axes), "replica": replicas}
    figures: list[FigureRecord] = []
    for key, item in _each_table("figures", items, add):
        kind = item.get("kind", "axis")
        if not isinstance(kind, str) or kind not in FIGURES:
            add((*key, "kind"), f"there is no such figure{did_you_mean(str(kind), FIGURES)}", kind)
            continue
        figure: dict[str, Any] = {"kind": str(kind)}
        for name, value in item.items():
            allowed = ("kind", "title", *FIGURES[kind])
            if name not in allowed:
                hint = did_you_mean(name, allowed)
                add((*key, name), f"unknown key of a {kind} figure{hint}")
            elif name in _AXES:
                figure[name] = column((*key, name), value, axes) or ""
            elif name in most:
                whole = isinstance(value, int) and not isinstance(value, bool)
                if not whole or not 0 <= value < most[name]:
                    message = f"must be the number of a {name} of this study: 0 to {most[name] - 1}"
                    add((*key, name), message, value)
                figure[name] = value
            elif name == "freedom":
                degrees = number_of(value)
                if degrees is None or not 0.0 < degrees <= _MOST_FREEDOM:
                    message = "must be degrees of freedom: above 0, at most "
                    add((*key, name), f"{message}{_MOST_FREEDOM:g}", value)
                figure[name] = degrees
            elif name == "limit":
                figure["limits"] = _limits(value)
                if not figure["limits"]:
                    add((*key, name), "must be a finite number, or a list of them", value)
            elif name != "kind":
                figure[name] = value
        if kind != "run" and "metric" not in figure:
            add(key, "needs a metric: the name of a result")
            figure["metric"] = ""
        if kind in ("heat", "map") and len(axes) < 2:
            what = "heat map" if kind == "heat" else "map"
            add(key, f"a {what} needs two axes; the study has {len(axes)}")
        chosen = [axis for axis in axes if figure.get("axis", axes[0].column) == axis.column]
        if kind == "polar" and chosen and not chosen[0].numeric:
            add(key, f"a polar figure needs an axis in degrees; {chosen[0].column} is no number")
        # What is wrong with it is reported, and then no study is made.
        figures.append(FigureRecord.model_construct(**figure))
    return tuple(figures)


def _limits(value: Any) -> list[float]:
    """Return the limits that a figure draws contours of; none where one is no finite number."""
    numbers = [number_of(item) for item in (value if isinstance(value, list) else [value])]
    limits = [number for number in numbers if number is not None]
    return limits if len(limits) == len(numbers) else []


_KEYS = ("metric", "axis", "most", "least", "cheaper")


def read_requirements(
    items: Any,
    axes: tuple[Axis, ...],
    column: Callable[[Key, Any, tuple[Axis, ...]], str | None],
    add: Callable[..., None],
) -> tuple[Requirement, ...]:
    """Return the requirements of a study file.

    `column` and `add` are those of `read_figures`.
    """
    requirements = []
    for key, item in _each_table("requirements", items, add):
        for name in item:
            if name not in _KEYS:
                add((*key, name), f"unknown key of a requirement{did_you_mean(name, _KEYS)}")
        limits = [name for name in ("most", "least") if name in item]
        if len(limits) != 1:
            add(key, "needs one limit: most = NUMBER, or least = NUMBER")
            continue
        limit = number_of(item[limits[0]])
        if limit is None:
            add((*key, limits[0]), "must be a finite number", item[limits[0]])
        said = {
            "metric": "the name of a result", "axis": "along which the cheapest is looked for",
        }  # fmt: skip
        for name, what in said.items():
            if not isinstance(item.get(name), str):
                add((*key, name), f"is required: {what}")
        cheaper = item.get("cheaper", "first")
        if cheaper not in ("first", "last"):
            message = "must be 'first' or 'last': which end of the axis is the cheap one"
            add((*key, "cheaper"), message, cheaper)
        if not isinstance(item.get("axis"), str) or not isinstance(item.get("metric"), str):
            continue
        along = column((*key, "axis"), item["axis"], axes)
        if along is not None and limit is not None:
            below, last = limits[0] == "most", cheaper == "last"
            requirements.append(Requirement(str(item["metric"]), along, limit, below, last))
    return tuple(requirements)


def number_of(value: Any) -> float | None:
    """Return a finite number of a file, or None."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        return None
    return float(value)
