"""Maps of a result over two axes, one panel for each value of the others, with contours."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from dsa_des.arrays.types import FloatArray
from dsa_des.record.drawing import drawing, figure_text, tight
from dsa_des.studies.figures import SummaryPlaces, Target
from dsa_des.studies.labels import axis_label, readable, value_label
from dsa_des.studies.summary import Line

_MOST_PANELS, _TITLE = 6, 80
_PARTS = ("value", "low", "high")


def draw_map(
    path: Target, places: SummaryPlaces, metric: str, x: str, y: str, limits: Sequence[float],
    title: str, confidence: float,
) -> None:  # fmt: skip
    """Draw a result over two axes; solid contours are of its estimate, dashed ones of its interval.

    Between two values of an axis contours are interpolated along straight lines. To the side of a
    dashed contour that lies farther within the limit, the whole interval lies within it.

    Parameters
    ----------
    path : Target
    places : SummaryPlaces
    metric, x, y : str
    limits : sequence of float
        What contours are drawn of.
    title : str
    confidence : float
        Of the intervals, for the legend.
    """
    lines = places.of(metric)
    across, up = places.axes.index(x), places.axes.index(y)
    others = [k for k in range(len(places.axes)) if k not in (across, up)]
    columns, rows = (_values(lines, k) for k in (across, up))
    panels: dict[tuple[Any, ...], list[Line]] = {}
    for line in lines:
        panels.setdefault(tuple(line.at[k] for k in others), []).append(line)
    # Panels of the last of the other axes stand side by side, those before it below each other.
    wide = min(_MOST_PANELS, len(_values(lines, others[-1])) if others else 1)
    wide = min(wide, len(panels))
    tall = min(_MOST_PANELS, -(-len(panels) // wide))
    values = np.array([line.estimate.value for line in lines])
    known = values[np.isfinite(values)]
    least, most = (float(known.min()), float(known.max())) if len(known) else (0.0, 1.0)
    size = 1.2 + 2.6 * wide + 1.0, 1.3 + 2.3 * tall + 0.3
    with drawing(*size, path) as figure:
        grid = figure.subplots(tall, wide, squeeze=False, sharex=True, sharey=True)
        image = None
        for number, (at, some) in enumerate(list(panels.items())[: wide * tall]):
            axes = grid[number // wide, number % wide]
            parts = _grids(some, across, up, columns, rows)
            image = axes.pcolormesh(
                np.arange(len(columns)), np.arange(len(rows)), parts["value"], cmap="viridis_r",
                vmin=least, vmax=most, shading="nearest",
            )  # fmt: skip
            _contours(axes, parts, limits)
            axes.set_xticks(range(len(columns)), [_short(v) for v in columns])
            axes.set_yticks(range(len(rows)), [_short(v) for v in rows])
            names = [value_label(places.axes[k], v) for k, v in zip(others, at, strict=True)]
            axes.set_title("\n".join(names), loc="left", fontsize=8)
        for empty in range(len(panels), wide * tall):
            grid[empty // wide, empty % wide].set_visible(False)
        for axes in grid[-1]:
            axes.set_xlabel(axis_label(x))
        for axes in grid[:, 0]:
            axes.set_ylabel(axis_label(y))
        told = ", ".join(f"{limit:g}" for limit in limits)
        notes = [figure_text(title, _TITLE)]
        if limits:
            notes.append(f"contours of {told}: solid the estimate, dashed and dotted the upper")
            notes.append(f"and lower end of its {100 * confidence:g} % interval")
        figure.suptitle("\n".join(notes), x=0.02, ha="left", fontsize=9)
        tight(figure)
        if image is not None:
            figure.colorbar(image, ax=list(grid.flat), label=readable(metric), shrink=0.9)


def _values(lines: Sequence[Line], place: int) -> list[Any]:
    return list(dict.fromkeys(line.at[place] for line in lines))


def _grids(
    lines: Sequence[Line], across: int, up: int, columns: list[Any], rows: list[Any]
) -> dict[str, FloatArray]:
    found = {part: np.full((len(rows), len(columns)), np.nan) for part in _PARTS}
    for line in lines:
        at = rows.index(line.at[up]), columns.index(line.at[across])
        for part in _PARTS:
            found[part][at] = getattr(line.estimate, part)
    return found


def _contours(axes: Any, parts: dict[str, FloatArray], limits: Sequence[float]) -> None:
    for part, style in (("value", "-"), ("high", "--"), ("low", ":")):
        grid = parts[part]
        known = grid[np.isfinite(grid)]
        if min(grid.shape) < 2 or not len(known):
            continue  # no contour without an area
        crossed = [limit for limit in limits if known.min() < limit < known.max()]
        if crossed:
            drawn = axes.contour(
                np.ma.masked_invalid(grid), levels=sorted(crossed), colors="#D55E00",
                linestyles=style, linewidths=1.6 if part == "value" else 1.1,
            )  # fmt: skip
            if part == "value":
                axes.clabel(drawn, fmt="%g", fontsize=7)


def _short(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, float) else figure_text(value)
