"""Curves of a study's results: along an axis, over bearing, of a series, spread over the runs."""

import math
import textwrap
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np

from dsa_des.arrays.types import FloatArray
from dsa_des.block.mark import BLUE, PALETTE
from dsa_des.record.drawing import draw_to_png, figure_text, fit_axes_to_texts
from dsa_des.results.labels import (
    axis_label,
    format_with_interval,
    readable_label,
    unit_of,
    value_label,
)
from dsa_des.results.maps import Target
from dsa_des.results.statistics import chi_square_bounds
from dsa_des.results.summary import Compared, Line

#: Colours and markers of series, in turn.
STYLES = tuple(zip(PALETTE, "osD^vPX", strict=True))
_MOST_LINES = 12
#: Letters of a title.
_TITLE = 80
#: Most texts below an axis that can be read.
_MOST_NAMES = 60
#: With room for the legend beside the axes, and between series at one value.
_WIDE_IN, _APART_PT = 9.0, 5.0
_FEWEST_BINS, _MOST_BINS = 5, 40


def _colour_and_marker_of_series(
    mark: tuple[str, str] | None, number: int, of: int
) -> tuple[str, str]:
    """Return series `number`'s (colour, marker): `mark` if alone, else the next of `STYLES`."""
    return mark if of == 1 and mark is not None else STYLES[number % len(STYLES)]


def _group_lines_by_series(
    axes: Sequence[str], lines: Sequence[Line], axis: str, by: str | None
) -> dict[str, list[Line]]:
    """Return series label → lines; a series has one combination of the axes other than `axis`."""
    others = [k for k, name in enumerate(axes) if name != axis]
    if by is not None:  # the named axis first, so that its values share a colour
        others.sort(key=lambda k: axes[k] != by)
    series: dict[str, list[Line]] = {}
    for line in lines:
        named = ", ".join(value_label(axes[k], line.at[k]) for k in others)
        series.setdefault(named, []).append(line)
    return series


def draw_result_against_axis(
    target: Target, axes: Sequence[str], lines: Sequence[Line], metric: str, axis: str,
    by: str | None, category: bool, shown: Sequence[Compared], title: str, confidence: float,
) -> None:  # fmt: skip
    """Draw a result against an axis, with intervals; below it the paired differences, if any."""
    index = axes.index(axis)
    values = list(dict.fromkeys(line.at[index] for line in lines))
    where, numeric = _tick_positions(values, category)
    series = list(_group_lines_by_series(axes, lines, axis, by).items())
    with draw_to_png(_WIDE_IN, 6.4 if shown else 4.2, target) as figure:
        grid = figure.subplots(2 if shown else 1, 1, squeeze=False, sharex=True)[:, 0]
        top = grid[0]
        for number, (series_label, some) in enumerate(series[:_MOST_LINES]):
            colour, marker = _colour_and_marker_of_series(some[0].result.mark, number, len(series))
            x = np.array([where[line.at[index]] for line in some])
            known = any(not np.isnan(line.estimate.half_width) for line in some)
            seen = series_label or "simulated" + f", {100 * confidence:g} % interval" * known
            drawn = _draw_points(top, x, some, colour, marker, seen, join=numeric)
            expected = [line.expected for line in some]
            if any(item is not None for item in expected):
                y = [np.nan if item is None else item for item in expected]
                # One entry for all: each is dotted in the colour of its series.
                note = "analytic" if number == 0 else None
                drawn += top.plot(
                    x, y, color=colour, ls=":" if numeric else "", marker="_", ms=9, label=note,
                    zorder=1,
                )  # fmt: skip
            _shift_series(top, drawn, number, len(series))
        top.set_ylabel(readable_label(metric))
        top.set_title(figure_text(title, _TITLE), loc="left")
        _put_legend_beside(top)
        if shown:
            _draw_differences(grid[1], shown, where, axes, axis, confidence)
        bottom = grid[-1]
        bottom.set_xlabel(axis_label(axis))
        _set_ticks(bottom, values, where, numeric)
        fit_axes_to_texts(figure)


def _tick_positions(values: list[Any], category: bool) -> tuple[dict[Any, float], bool]:
    numeric = all(isinstance(v, int | float) for v in values)
    if numeric and not category:
        return {v: float(v) for v in values}, True
    return {v: float(k) for k, v in enumerate(values)}, False


def _set_ticks(axes: Any, values: list[Any], where: dict[Any, float], numeric: bool) -> None:
    if not numeric:
        shown = values[:: -(-len(values) // _MOST_NAMES)]
        names = [f"{v:g}" if isinstance(v, float) else figure_text(v) for v in shown]
        axes.set_xticks([where[v] for v in shown], names)
        if sum(map(len, names)) > 60:
            axes.tick_params(axis="x", labelrotation=30)
            for label in axes.get_xticklabels():
                label.set_ha("right")
        axes.set_xlim(-0.5, len(values) - 0.5)
        return
    positive = [v for v in values if v > 0]
    if len(positive) == len(values) > 2 and max(values) / min(values) >= 8:
        axes.set_xscale("log")
        ticks = _values_with_separate_labels(values)
        axes.set_xticks(ticks, [f"{v:g}" for v in ticks])
        axes.set_xticks([], minor=True)


def _values_with_separate_labels(values: list[float]) -> list[float]:
    """Return the sorted values whose tick labels do not overlap on a log axis, always both ends."""
    low, high = math.log(min(values)), math.log(max(values))
    kept: list[float] = []
    for value in [min(values), max(values), *values]:
        at = (math.log(value) - low) / (high - low)
        if all(abs(at - (math.log(other) - low) / (high - low)) >= 0.055 for other in kept):
            kept.append(value)
    return sorted(kept)


def _put_legend_beside(axes: Any) -> None:
    """Put the legend to the right of the axes, with long labels folded into lines."""
    handles, names = axes.get_legend_handles_labels()
    if names:
        names = [textwrap.fill(name, 26) for name in names]
        axes.legend(handles, names, loc="upper left", bbox_to_anchor=(1.01, 1.0), borderaxespad=0.0)


def _shift_series(axes: Any, drawn: Sequence[Any], number: int, of: int) -> None:
    """Shift one series' drawn artists sideways, so that intervals of series do not overlap."""
    from matplotlib.transforms import ScaledTranslation

    apart_pt = min(_APART_PT, 30.0 / of)
    right_in = (number - (min(of, _MOST_LINES) - 1) / 2) * apart_pt / 72
    # After it was drawn: the limits of the axes are those of the data where they are.
    moved = axes.transData + ScaledTranslation(right_in, 0.0, axes.figure.dpi_scale_trans)
    for artist in drawn:
        artist.set_transform(moved)


def _draw_points(
    axes: Any, x: Any, lines: list[Line], colour: str, marker: str, series_label: str, *, join: bool
) -> list[Any]:
    y = np.array([line.estimate.value for line in lines])
    low = np.array([line.estimate.low for line in lines])
    high = np.array([line.estimate.high for line in lines])
    bars = np.nan_to_num(np.abs([y - low, high - y]))
    drawn = axes.errorbar(
        x, y, yerr=bars, color=colour, marker=marker, ms=5, capsize=3, lw=1.2,
        ls="-" if join else "none", label=series_label or None, zorder=2,
    )  # fmt: skip
    return list(drawn.get_children())


def _draw_differences(
    axes: Any,
    shown: Sequence[Compared],
    where: dict[Any, float],
    names: Sequence[str],
    axis: str,
    confidence: float,
) -> None:
    baseline = shown[0].baseline
    text = f"{baseline:g}" if isinstance(baseline, float) else figure_text(baseline)
    axes.axhline(0.0, color="#888888", lw=0.8)
    groups: dict[tuple[Any, ...], list[Compared]] = {}
    for item in shown:
        groups.setdefault(item.at, []).append(item)
    others = [name for name in names if name != axis]
    for number, (at, items) in enumerate(list(groups.items())[:_MOST_LINES]):
        colour, marker = _colour_and_marker_of_series(shown[0].result.mark, number, len(groups))
        x = np.array([where[item.value] for item in items])
        y = np.array([item.difference.paired.value for item in items])
        half = np.nan_to_num([item.difference.paired.half_width for item in items])
        series_label = ", ".join(value_label(n, v) for n, v in zip(others, at, strict=True))
        drawn = axes.errorbar(x, y, yerr=half, color=colour, marker=marker, ms=5, capsize=3, lw=1.2,
                      ls="none", label=series_label or None)  # fmt: skip
        _shift_series(axes, drawn.get_children(), number, len(groups))
        if len(groups) == 1:
            for px, item in zip(x, items, strict=True):
                e = item.difference.paired
                text_at = {"xytext": (7, 4), "textcoords": "offset points", "fontsize": 8}
                axes.annotate(format_with_interval(e.value, e.half_width), (px, e.value), **text_at)
    unit = unit_of(shown[0].result.name)
    axes.set_ylabel(f"Difference from\nthat at {text}{f' ({unit})' if unit else ''}")
    known = any(np.isfinite(item.difference.paired.half_width) for item in shown)
    intervals = f", {100 * confidence:g} % intervals" if known else ""
    axes.set_title(f"Paired differences on the same units{intervals}", loc="left")
    axes.margins(x=0.12, y=0.2)


def draw_polar(
    target: Target, axes: Sequence[str], lines: Sequence[Line], metric: str, axis: str, title: str,
    confidence: float,
) -> None:  # fmt: skip
    """Draw a result over bearing: the axis is in degrees, clockwise from ahead (up)."""
    index = axes.index(axis)
    with draw_to_png(6.2, 6.0, target) as figure:
        polar = figure.add_subplot(projection="polar")
        polar.set(theta_zero_location="N", theta_direction=-1)
        series = list(_group_lines_by_series(axes, lines, axis, None).items())
        for number, (series_label, some) in enumerate(series[:_MOST_LINES]):
            colour, marker = _colour_and_marker_of_series(some[0].result.mark, number, len(series))
            some = sorted(some, key=lambda line: line.at[index])
            angle = np.radians([line.at[index] for line in some])
            low, value, high = (
                np.array([getattr(line.estimate, name) for line in some])
                for name in ("low", "value", "high")
            )
            ring = slice(None)
            if len(some) > 2 and np.ptp(np.degrees(angle)) >= 270:
                ring = np.append(np.arange(len(some)), 0)  # type: ignore[assignment]
            polar.plot(
                angle[ring], value[ring], color=colour, marker=marker, ms=4, label=series_label
            )
            polar.fill_between(angle[ring], low[ring], high[ring], color=colour, alpha=0.2, lw=0)
        polar.set_ylim(bottom=0.0)
        over = f"{readable_label(metric)} over {axis_label(axis)[:1].lower()}{axis_label(axis)[1:]}"
        if any(np.isfinite(line.estimate.low) for line in lines):
            over += f"\nshaded: {100 * confidence:g} % interval"
        polar.set_title(f"{figure_text(title, _TITLE)}\n{over}", loc="left")
        if len(series) > 1:
            polar.legend(loc="upper left", bbox_to_anchor=(1.05, 1.0))
        fit_axes_to_texts(figure)


@contextmanager
def _titled_axes(
    target: Target, title: str, width_in: float = _WIDE_IN, height_in: float = 4.2
) -> Iterator[Any]:
    """Yield a new figure's axes; afterwards add title and legend and write the PNG to `target`."""
    with draw_to_png(width_in, height_in, target) as figure:
        axes = figure.add_subplot()
        yield axes
        axes.set_title(figure_text(title, _TITLE), loc="left")
        _put_legend_beside(axes)
        fit_axes_to_texts(figure)


#: A label, and the values of its runs, NaN where a run has none.
Spread = tuple[str, FloatArray]


def draw_histogram(
    path: Target, series: Sequence[Spread], metric: str, title: str, mark: tuple[str, str] | None
) -> None:
    """Draw how many runs have which value, one outline per series over common bins."""
    known = [
        (series_label, values[~np.isnan(values)], len(values))
        for series_label, values in series[:_MOST_LINES]
    ]
    every = np.concatenate([values for _, values, _ in known] or [np.empty(0)])
    with _titled_axes(path, title) as axes:
        edges = _bin_edges(every, max((len(values) for _, values, _ in known), default=0))
        for number, (series_label, values, runs) in enumerate(known):
            colour = _colour_and_marker_of_series(mark, number, len(known))[0]
            counts = np.histogram(values, edges)[0]
            axes.stairs(
                counts, edges, color=colour, lw=1.4, label=_count_label(series_label, values, runs)
            )
            axes.stairs(counts, edges, color=colour, fill=True, alpha=0.15)
        axes.set_ylim(bottom=0.0)
        axes.yaxis.get_major_locator().set_params(integer=True)
        axes.set(xlabel=readable_label(metric), ylabel="Runs")


def draw_cdf(
    path: Target, series: Sequence[Spread], metric: str, title: str, mark: tuple[str, str] | None
) -> None:
    """Draw the share of all runs whose value is at most x, one step curve per series.

    Runs without a value count as well: where some have none, a curve ends below 1.
    """
    shown = series[:_MOST_LINES]
    with _titled_axes(path, title) as axes:
        for number, (series_label, values) in enumerate(shown):
            ascending = np.sort(values[~np.isnan(values)])
            colour = _colour_and_marker_of_series(mark, number, len(shown))[0]
            if not len(ascending):
                axes.plot([], [], color=colour, label=f"{series_label}: no value")
                continue
            share = np.arange(1, len(ascending) + 1) / len(values)
            # Wider the earlier: of curves that are alike all are seen.
            wider = min(len(shown) - 1 - number, 3)
            axes.step(
                np.concatenate((ascending[:1], ascending)), np.concatenate(([0.0], share)),
                where="post", color=colour, lw=1.4 + 1.3 * wider,
                label=_count_label(series_label, ascending, len(values)),
            )  # fmt: skip
        axes.set_ylim(0.0, 1.02)
        axes.set(xlabel=readable_label(metric), ylabel="Share of the runs at or below")
        axes.grid(color="#DDDDDD", linewidth=0.5)


def _count_label(series_label: str, values: FloatArray, runs: int) -> str:
    of = f"{len(values):,} of {runs:,}" if len(values) < runs else f"{runs:,}"
    return f"{series_label}: {of} runs" if series_label else f"{of} runs"


def _bin_edges(values: FloatArray, most: int) -> FloatArray:
    """Return edges of equal bins over all values' range, about √`most` (the size of a series)."""
    if not len(values):
        return np.array([0.0, 1.0])
    low, high = float(values.min()), float(values.max())
    if low == high:
        half = max(abs(low) * 0.01, 0.5)
        return np.array([low - half, low + half])
    bins = int(np.clip(np.ceil(np.sqrt(most)), _FEWEST_BINS, _MOST_BINS))
    return np.linspace(low, high, bins + 1)


#: A label, numbers, and the line at each.
Series = tuple[str, Sequence[float], Sequence[Line]]


def draw_numbered_results(
    path: Target,
    series: Sequence[Series],
    metric: str,
    title: str,
    confidence: float,
    freedom: float | None,
    limits: Sequence[float] = (),
) -> None:
    """Draw ``METRIC.NUMBER`` with interval against NUMBER, a line per combination of axis values.

    With degrees of `freedom` of chi-square: the bounds of the mean over the runs that have a value.
    `limits` are one for all, or one for each number of the series.
    """
    name, _, along = metric.partition(".")
    with _titled_axes(path, title) as axes:
        if freedom is not None and series:
            _draw_chi_square_bounds(axes, series[0][1], series[0][2], freedom, confidence)
        for index, (series_label, x, lines) in enumerate(series[:_MOST_LINES]):
            colour, marker = STYLES[index % len(STYLES)]
            value, low, high = (
                np.array([getattr(line.estimate, part) for line in lines])
                for part in ("value", "low", "high")
            )
            of = lines[0].result.quantile
            what = "mean of the runs" if of is None else f"{100 * of:g} % quantile"
            label = series_label or f"{what}, {100 * confidence:g} % interval"
            drawn = axes.plot(x, value, color=colour, marker=marker, ms=4, lw=1.2, label=label,
                              zorder=2)  # fmt: skip
            drawn.append(axes.vlines(x, low, high, color=colour, lw=1.0, zorder=2))
            _shift_series(axes, drawn, index, len(series))
        if limits and series:
            x = series[0][1]
            known = list(limits) if len(limits) == len(x) else [limits[0]] * len(x)
            axes.plot(x, known, color="#000000", ls="--", lw=1.2, label="limit", zorder=1)
        axes.set_ylim(bottom=0.0)
        axes.set(xlabel=axis_label(along) if along else "", ylabel=readable_label(name))


def _draw_chi_square_bounds(
    axes: Any, x: Sequence[float], lines: Sequence[Line], freedom: float, confidence: float
) -> None:
    # The mean of n variables, each with so many degrees, is one with n times as many, by n.
    bounds = [
        np.array(chi_square_bounds(freedom * n, confidence)) / n if n else (math.nan, math.nan)
        for n in (line.estimate.count for line in lines)
    ]
    low, high = np.array(bounds).T
    axes.fill_between(
        x, low, high, color="#999999", alpha=0.3, linewidth=0, zorder=0,
        label=f"{100 * confidence:g} % bounds of χ², {freedom:g} degrees",
    )  # fmt: skip
    axes.axhline(freedom, color="#999999", lw=0.8, zorder=1)


def draw_scatter(
    path: Target, first: Any, second: Any, names: tuple[str, str], metric: str, title: str
) -> None:
    """Draw one result under two conditions, a point per encounter or replica, and line y = x."""
    both = ~np.isnan(first) & ~np.isnan(second)
    with _titled_axes(path, title, 5.4, 5.2) as axes:
        if both.any():
            held = np.concatenate([first[both], second[both]])
            ends = [held.min(), held.max()]
            axes.plot(ends, ends, color="#888888", lw=0.8)
        axes.plot(first[both], second[both], ls="none", marker="o", ms=4, color=BLUE,
                  alpha=0.6, markeredgewidth=0)  # fmt: skip
        across, up = (f"{readable_label(metric)}: {figure_text(name)}" for name in names)
        axes.set(xlabel=across, ylabel=up)
