"""The tables ``[[requirements]]`` of a study file: limits on results, which the user sets."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from dsa_des.errors import did_you_mean
from dsa_des.scene.keys import Key
from dsa_des.studies.axes import Axis

_KEYS = ("metric", "axis", "most", "least", "cheaper")


@dataclass(frozen=True)
class Requirement:
    """A limit on a result, and the axis along which the cheapest value is looked for.

    Parameters
    ----------
    metric, axis : str
        Name of the result, and column of the axis.
    limit : float
    below : bool
        Whether the result must be at most the limit; otherwise at least.
    cheap_last : bool
        Whether the last value of the axis is the cheapest; otherwise the first.
    """

    metric: str
    axis: str
    limit: float
    below: bool = True
    cheap_last: bool = False

    def said(self) -> str:
        """Return ``nmac_risk_ratio at most 0.3``."""
        return f"{self.metric} at {'most' if self.below else 'least'} {self.limit:g}"

    def met(self, low: float, high: float) -> bool:
        """Return whether an interval (or a value, given twice) lies within the limit."""
        return high <= self.limit if self.below else low >= self.limit


def read_requirements(
    items: Any,
    axes: tuple[Axis, ...],
    column: Callable[[Key, Any, tuple[Axis, ...]], str | None],
    add: Callable[..., None],
) -> tuple[Requirement, ...]:
    """Return the requirements of a study file.

    Parameters
    ----------
    items : object
        What the file holds under ``requirements``.
    axes : tuple of Axis
    column : callable
        Gives the column of the axis that a name means, or reports that there is none.
    add : callable
        Takes the key, the message and the value of a problem.
    """
    if not isinstance(items, list):
        add(("requirements",), "must be a list of tables ([[requirements]])")
        return ()
    found = []
    for number, item in enumerate(items):
        key: Key = ("requirements", number)
        if not isinstance(item, dict):
            add(key, "must be a table ([[requirements]])", item)
            continue
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
            found.append(Requirement(str(item["metric"]), along, limit, below, last))
    return tuple(found)


def number_of(value: Any) -> float | None:
    """Return a finite number of a file, or None."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        return None
    return float(value)
