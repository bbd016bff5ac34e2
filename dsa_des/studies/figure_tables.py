"""The tables ``[[figures]]`` of a study file: which figures there are, and what each needs."""

import math
from collections.abc import Callable
from typing import Any

from dsa_des.errors import did_you_mean
from dsa_des.scene.keys import Key
from dsa_des.studies.axes import Axis
from dsa_des.studies.requirements import number_of

FIGURES = {
    "axis": ("metric", "axis", "lines"),
    "heat": ("metric", "x", "y"),
    "map": ("metric", "x", "y", "limit"),
    "polar": ("metric", "axis"),
    "histogram": ("metric", "axis"),
    "cdf": ("metric", "axis"),
    "series": ("metric", "freedom"),
    "run": ("cell", "replica"),
}
_MOST_FREEDOM = 1e6
_AXES = ("axis", "lines", "x", "y")


def read_figures(
    items: Any,
    axes: tuple[Axis, ...],
    replicas: int,
    column: Callable[[Key, Any, tuple[Axis, ...]], str | None],
    add: Callable[..., None],
) -> tuple[dict[str, Any], ...]:
    """Return the figures of a study.

    Parameters
    ----------
    items : object
        What the file holds under ``figures``.
    axes : tuple of Axis
    replicas : int
        Of a cell.
    column : callable
        Gives the column of the axis that a name means, or reports that there is none.
    add : callable
        Takes the key, the message and the value of a problem.
    """
    if not isinstance(items, list):
        add(("figures",), "must be a list of tables ([[figures]])")
        return ()
    most = {"cell": math.prod(len(axis.labels) for axis in axes), "replica": replicas}
    found: list[dict[str, Any]] = []
    for number, item in enumerate(items):
        key: Key = ("figures", number)
        if not isinstance(item, dict):
            add(key, "must be a table ([[figures]])", item)
            continue
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
        found.append(figure)
    return tuple(found)


def _limits(value: Any) -> list[float]:
    """Return the limits that a figure draws contours of; none where one is no finite number."""
    numbers = [number_of(item) for item in (value if isinstance(value, list) else [value])]
    found = [number for number in numbers if number is not None]
    return found if len(found) == len(numbers) else []
