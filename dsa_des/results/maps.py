"""Maps of a result over two axes: as a heat map, or panel by panel with contours."""

import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from dsa_des.arrays.types import FloatArray
from dsa_des.block.mark import RED
from dsa_des.record.drawing import draw_to_png, figure_text, fit_axes_to_texts
from dsa_des.results.labels import axis_label, readable_label, value_label
from dsa_des.results.summary import Line

#: Where a figure is drawn to.
Target = Path | BinaryIO
_MOST_PANELS, _TITLE = 6, 80
_PARTS = ("value", "low", "high")


def draw_heat_map(
    path: Target,
    axes_of: Sequence[str],
    lines: Sequence[Line],
    metric: str,
    x: str,
    y: str,
    title: str,
) -> None:
    """Draw a result over two axes; values of further axes are averaged."""
    across, up = axes_of.index(x), axes_of.index(y)
    columns, rows = _axis_values(lines, across), _axis_values(lines, up)
    total, many = np.zeros((len(rows), len(columns))), np.zeros((len(rows), len(columns)))
    for line in lines:
        if not np.isnan(line.estimate.value):
            at = rows.index(line.at[up]), columns.index(line.at[across])
            total[at] += line.estimate.value
            many[at] += 1
    with np.errstate(invalid="ignore"):
        values = np.where(many > 0, total / many, np.nan)
    width = min(12.0, 3.0 + 0.62 * len(columns))
    with draw_to_png(max(5.0, width), min(10.0, 1.8 + 0.42 * len(rows) + 0.8), path) as figure:
        axes = figure.add_subplot()
        image = axes.imshow(values, aspect="auto", origin="lower", cmap="viridis")
        axes.spines[:].set_visible(False)
        for items, put in ((columns, axes.set_xticks), (rows, axes.set_yticks)):
            step = max(1, len(items) // 16)
            shown = range(0, len(items), step)
            put(list(shown), [_short_text(items[k]) for k in shown])
        if values.size <= 150:
            middle = np.nanmean(values) if (many > 0).any() else 0.0
            for (r, c), value in np.ndenumerate(values):
                if not np.isnan(value):
                    ink = "white" if value < middle else "black"
                    axes.text(
                        c,
                        r,
                        format_three_digits(value),
                        ha="center",
                        va="center",
                        color=ink,
                        size=8,
                    )
        axes.set_xlabel(axis_label(x))
        axes.set_ylabel(axis_label(y))
        axes.set_title(textwrap.fill(figure_text(title, _TITLE), 44), loc="left")
        figure.colorbar(image, label=readable_label(metric))
        fit_axes_to_texts(figure)


def _short_text(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, float) else figure_text(value)


def format_three_digits(value: float) -> str:
    """Return a number as text with three significant digits, or as a whole number from 100 on."""
    return f"{value:.0f}" if abs(value) >= 100 else f"{value:.3g}"


def draw_contour_map(
    path: Target, axes_of: Sequence[str], lines: Sequence[Line], metric: str, x: str, y: str,
    limits: Sequence[float], title: str, confidence: float,
) -> None:  # fmt: skip
    """Draw a result over two axes; solid contours are of its estimate, dashed ones of its interval.

    Between two values of an axis contours are interpolated along straight lines. To the side of a
    dashed contour that lies farther within the limit, the whole interval lies within it.
    """
    across, up = axes_of.index(x), axes_of.index(y)
    others = [k for k in range(len(axes_of)) if k not in (across, up)]
    columns, rows = (_axis_values(lines, k) for k in (across, up))
    panels: dict[tuple[Any, ...], list[Line]] = {}
    for line in lines:
        panels.setdefault(tuple(line.at[k] for k in others), []).append(line)
    # Panels of the last of the other axes stand side by side, those before it below each other.
    wide = min(_MOST_PANELS, len(_axis_values(lines, others[-1])) if others else 1)
    wide = min(wide, len(panels))
    tall = min(_MOST_PANELS, -(-len(panels) // wide))
    values = np.array([line.estimate.value for line in lines])
    known = values[np.isfinite(values)]
    least, most = (float(known.min()), float(known.max())) if len(known) else (0.0, 1.0)
    size = 1.2 + 2.6 * wide + 1.0, 1.3 + 2.3 * tall + 0.3
    with draw_to_png(*size, path) as figure:
        grid = figure.subplots(tall, wide, squeeze=False, sharex=True, sharey=True)
        image = None
        for number, (at, some) in enumerate(list(panels.items())[: wide * tall]):
            axes = grid[number // wide, number % wide]
            parts = _result_grids(some, across, up, columns, rows)
            image = axes.pcolormesh(
                np.arange(len(columns)), np.arange(len(rows)), parts["value"], cmap="viridis_r",
                vmin=least, vmax=most, shading="nearest",
            )  # fmt: skip
            _draw_contours(axes, parts, limits)
            axes.set_xticks(range(len(columns)), [_short_text(v) for v in columns])
            axes.set_yticks(range(len(rows)), [_short_text(v) for v in rows])
            names = [value_label(axes_of[k], v) for k, v in zip(others, at, strict=True)]
            axes.set_title("\n".join(names), loc="left", fontsize=8)
        for empty in range(len(panels), wide * tall):
            grid[empty // wide, empty % wide].set_visible(False)
        for axes in grid[-1]:
            axes.set_xlabel(axis_label(x))
        for axes in grid[:, 0]:
            axes.set_ylabel(axis_label(y))
        limits_text = ", ".join(f"{limit:g}" for limit in limits)
        notes = [figure_text(title, _TITLE)]
        if limits:
            notes.append(
                f"contours of {limits_text}: solid the estimate, dashed and dotted the upper"
            )
            notes.append(f"and lower end of its {100 * confidence:g} % interval")
        figure.suptitle("\n".join(notes), x=0.02, ha="left", fontsize=9)
        fit_axes_to_texts(figure)
        if image is not None:
            figure.colorbar(image, ax=list(grid.flat), label=readable_label(metric), shrink=0.9)


def _axis_values(lines: Sequence[Line], index: int) -> list[Any]:
    return list(dict.fromkeys(line.at[index] for line in lines))


def _result_grids(
    lines: Sequence[Line], across: int, up: int, columns: list[Any], rows: list[Any]
) -> dict[str, FloatArray]:
    grids = {part: np.full((len(rows), len(columns)), np.nan) for part in _PARTS}
    for line in lines:
        at = rows.index(line.at[up]), columns.index(line.at[across])
        for part in _PARTS:
            grids[part][at] = getattr(line.estimate, part)
    return grids


def _draw_contours(axes: Any, parts: dict[str, FloatArray], limits: Sequence[float]) -> None:
    for part, style in (("value", "-"), ("high", "--"), ("low", ":")):
        grid = parts[part]
        known = grid[np.isfinite(grid)]
        if min(grid.shape) < 2 or not len(known):
            continue  # no contour without an area
        crossed = [limit for limit in limits if known.min() < limit < known.max()]
        if crossed:
            drawn = axes.contour(
                np.ma.masked_invalid(grid), levels=sorted(crossed), colors=RED,
                linestyles=style, linewidths=1.6 if part == "value" else 1.1,
            )  # fmt: skip
            if part == "value":
                axes.clabel(drawn, fmt="%g", fontsize=7)
