"""Figures of a study: those its file asks for, and two conditions against each other."""

import hashlib
import io
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from dsa_des.arrays.types import FloatArray
from dsa_des.results.curves import (
    Series,
    draw_cdf,
    draw_histogram,
    draw_numbered_results,
    draw_polar,
    draw_result_against_axis,
    draw_scatter,
)
from dsa_des.results.labels import value_label
from dsa_des.results.maps import Target, draw_contour_map, draw_heat_map
from dsa_des.results.record import FigureRecord
from dsa_des.results.summary import Line, numbers_by_series_result
from dsa_des.results.tables import Tables

#: Letters of a figure's title.
_LONGEST_TITLE = 200
#: Bytes of a file's name, with room for what is put around it while it is written.
_LONGEST_NAME = 200

#: Draws a replica of a cell as ``dsa-des run`` does, and returns the paths.
DrawRun = Callable[[int, int], list[Path]]


def draw_figures(
    tables: Tables, only: Sequence[str] = (), draw_run: DrawRun | None = None
) -> list[Path]:
    """Draw the study's figures into its folder and return their paths.

    `only` names the results whose conditions are drawn against each other where there is a swap; by
    default those that the figures show, or the first ones. Without `draw_run` no run is drawn.
    """
    paths: list[Path] = []
    for number, figure in enumerate(tables.record.figures):
        if figure.kind == "run":
            paths += [] if draw_run is None else draw_run(figure.cell, figure.replica)
            continue
        drawn = _named_figure_buffer(f"figure-{number + 1:02d}-{figure.kind}.png")
        if draw_figure(drawn, tables, figure):
            paths.append(_write_figure(tables, drawn))
    if tables.compared and tables.baseline is not None and tables.baseline[0].startswith("swap."):
        paths += _draw_scatters(tables, *tables.baseline, only)
    return paths


def _named_figure_buffer(name: str) -> io.BytesIO:
    drawn = io.BytesIO()
    drawn.name = name
    return drawn


def _write_figure(tables: Tables, drawn: io.BytesIO) -> Path:
    tables.folder.write_file(drawn.name, drawn.getvalue())
    return tables.folder.path / drawn.name


def draw_figure(target: Target, tables: Tables, figure: FigureRecord) -> bool:
    """Draw one figure; return False, and draw nothing, where the tables lack what it shows."""
    axes, metric = tables.rows.axes, str(figure.metric)
    if any(n is not None and n not in axes for n in (figure.axis, figure.x, figure.y)):
        return False
    title = _shorten_title(tables.record.title if figure.title is None else figure.title)
    confidence = tables.record.confidence
    if figure.kind in ("histogram", "cdf"):
        return _draw_spread(target, tables, figure, title)
    if figure.kind == "series":
        series = _numbered_result_series(tables, metric)
        draw_numbered_results(target, series, metric, title, confidence, figure.freedom,
                    figure.limits)  # fmt: skip
        return True
    if not axes:
        return False
    lines = [line for line in tables.lines if line.result.name == metric]
    if figure.kind in ("heat", "map"):
        x = axes[axes.index(figure.x or axes[0])]  # which knows its words
        y = axes[axes.index(figure.y)] if figure.y else next((a for a in axes if a != x), x)
        if x == y:
            return False
        if figure.kind == "heat":
            draw_heat_map(target, axes, lines, metric, x, y, title)
        else:
            draw_contour_map(target, axes, lines, metric, x, y, figure.limits, title, confidence)
        return True
    axis = axes[axes.index(figure.axis or axes[0])]
    if figure.kind == "polar":
        draw_polar(target, axes, lines, metric, axis, title, confidence)
    else:
        own = tables.baseline is not None and tables.baseline[0] == axis
        compared = [c for c in tables.compared if own and c.result.name == metric]
        category = any(a.category for a in tables.record.axes if a.column == axis)
        draw_result_against_axis(target, axes, lines, metric, axis, figure.lines, category,
        compared, title,
                   confidence)  # fmt: skip
    return True


def _shorten_title(title: str) -> str:
    return title if len(title) <= _LONGEST_TITLE else f"{title[: _LONGEST_TITLE - 1]}…"


def _draw_spread(target: Target, tables: Tables, figure: FigureRecord, title: str) -> bool:
    """Draw a result's histogram or cumulative distribution by axis value; False if not a number."""
    rows, metric = tables.rows, str(figure.metric)
    (result,) = (result for result in tables.results if result.name == metric)
    if not result.is_number:
        return False
    axis = next((name for name in rows.axes if figure.axis in (None, name)), None)
    by_value: dict[Any, list[FloatArray]] = {}
    for at, chosen in rows.row_indices_by_axis_values():
        value = None if axis is None else at[rows.axes.index(axis)]
        by_value.setdefault(value, []).append(rows.column(metric)[chosen].astype(float))
    series = [
        ("" if axis is None else value_label(axis, value), np.concatenate(values))
        for value, values in by_value.items()
    ]
    draw = draw_histogram if figure.kind == "histogram" else draw_cdf
    draw(target, series, metric, title, result.mark)
    return True


def _numbered_result_series(tables: Tables, metric: str) -> list[Series]:
    """Return (label, numbers, lines) of ``METRIC.NUMBER`` for each combination of axis values."""
    known = numbers_by_series_result(metric, [line.result.name for line in tables.lines])
    by_place: dict[tuple[Any, ...], dict[str, Line]] = {}
    for line in tables.lines:
        if line.result.name in known:
            by_place.setdefault(line.at, {})[line.result.name] = line
    axes = tables.rows.axes
    return [
        (
            ", ".join(value_label(a, v) for a, v in zip(axes, at, strict=True)),
            list(known.values()),
            [lines[name] for name in known],
        )
        for at, lines in by_place.items()
    ]


def _draw_scatters(tables: Tables, axis: str, baseline: Any, only: Sequence[str]) -> list[Path]:
    """Draw results at each axis value against the baseline, one figure each; return the paths."""
    index = tables.rows.axes.index(axis)
    paths = []
    for value, others, base, chosen in tables.rows.comparisons_with_baseline(axis, baseline):
        at = (*others[:index], value, *others[index:])
        for metric in tables.names_of_scatter_results(only):
            _, first, second = tables.rows.paired_means_by_unit(metric, base, chosen)
            name = "-".join(["scatter", metric, *map(str, at)])
            drawn = _named_figure_buffer(f"{safe_file_name(name)}.png")
            names = str(baseline), str(value)
            draw_scatter(drawn, first, second, names, metric, _shorten_title(tables.record.title))
            paths.append(_write_figure(tables, drawn))
    return paths


def safe_file_name(name: str) -> str:
    """Return a text as a file name: signs other than letters, digits and ``-_.`` become ``_``, and
    a long one is cut and gets a hash.
    """
    plain = "".join(c if c.isalnum() or c in "-_." else "_" for c in name)
    if len(plain.encode()) <= _LONGEST_NAME:
        return plain
    digest = hashlib.sha256(name.encode("utf-8", "surrogatepass")).hexdigest()[:8]
    cut = plain.encode()[: _LONGEST_NAME - 9].decode("utf-8", "ignore")
    return f"{cut}-{digest}"
