"""Figures of a study: a result against an axis with intervals, heat maps, polar plots."""

import math
import textwrap
from collections.abc import Collection, Sequence
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from dsa_des.record.drawing import drawing, figure_text, tight
from dsa_des.studies.labels import axis_label, readable, unit_of, value_label
from dsa_des.studies.summary import Compared, Line

#: Okabe and Ito's colours and markers, told apart with any kind of colour vision.
STYLES = (
    ("#0072B2", "o"), ("#D55E00", "s"), ("#009E73", "D"), ("#E69F00", "^"), ("#CC79A7", "v"),
    ("#56B4E9", "P"), ("#000000", "X"),
)  # fmt: skip
_MOST_LINES = 12
#: Letters in a title.
_TITLE = 80
#: More texts than this below an axis cannot be told apart.
_MOST_NAMES = 60
#: Where a figure is drawn to.
Target = Path | BinaryIO


class SummaryPlaces:
    """Lines of a summary by axis value.

    Parameters
    ----------
    axes : sequence of str
        Columns of the axes, in the order of `Line.at`.
    lines : sequence of Line
    categories : collection of str
        Axes of numbers that are names: there is nothing between two of them.
    """

    def __init__(
        self, axes: Sequence[str], lines: Sequence[Line], categories: Collection[str] = ()
    ) -> None:
        self.axes = list(axes)
        self.lines = lines
        self.categories = categories

    def style(self, metric: str, number: int, of: int) -> tuple[str, str]:
        """Return colour and marker of a series: a lone one has those of the block it is of."""
        marks = [line.result.mark for line in self.of(metric)[:1] if line.result.mark is not None]
        return marks[0] if of == 1 and marks else STYLES[number % len(STYLES)]

    def of(self, metric: str) -> list[Line]:
        """Return the lines of one result."""
        return [line for line in self.lines if line.result.name == metric]

    def series(self, metric: str, axis: str, by: str | None) -> dict[str, list[Line]]:
        """Return label → lines along `axis`, one series per value of all other axes."""
        place = self.axes.index(axis)
        others = [k for k in range(len(self.axes)) if k != place]
        if by is not None:  # the named axis first, so that its values share a colour
            others.sort(key=lambda k: self.axes[k] != by)
        found: dict[str, list[Line]] = {}
        for line in self.of(metric):
            named = ", ".join(value_label(self.axes[k], line.at[k]) for k in others)
            found.setdefault(named, []).append(line)
        return found


def draw_axis(
    path: Target,
    places: SummaryPlaces,
    metric: str,
    axis: str,
    by: str | None,
    compared: Sequence[Compared],
    title: str,
    confidence: float,
) -> None:
    """Draw a result against an axis, with intervals; below it the paired differences, if any."""
    shown = [item for item in compared if item.result.name == metric]
    place = places.axes.index(axis)
    values = list(dict.fromkeys(line.at[place] for line in places.of(metric)))
    where, numeric = _positions(values, axis in places.categories)
    many = len(places.series(metric, axis, by)) > 4
    with drawing(9.6 if many else 7.5, 6.4 if shown else 4.2, path) as figure:
        grid = figure.subplots(2 if shown else 1, 1, squeeze=False, sharex=True)[:, 0]
        top = grid[0]
        series = list(places.series(metric, axis, by).items())
        for number, (who, lines) in enumerate(series[:_MOST_LINES]):
            colour, marker = places.style(metric, number, len(series))
            shift = 0.0 if numeric else (number - (min(len(series), 12) - 1) / 2) * 0.06
            x = np.array([where[line.at[place]] for line in lines]) + shift
            known = any(not np.isnan(line.estimate.half_width) for line in lines)
            seen = who or "simulated" + f", {100 * confidence:g} % interval" * known
            _points(top, x, lines, colour, marker, seen, join=numeric)
            expected = [line.expected for line in lines]
            if any(item is not None for item in expected):
                y = [np.nan if item is None else item for item in expected]
                # One entry for all: each is dotted in the colour of its series.
                note = "analytic" if number == 0 else None
                top.plot(
                    x,
                    y,
                    color=colour,
                    ls=":" if numeric else "",
                    marker="_",
                    ms=9,
                    label=note,
                    zorder=1,
                )
        top.set_ylabel(readable(metric))
        top.set_title(figure_text(title, _TITLE), loc="left")
        if len(series) > 1 or top.get_legend_handles_labels()[1][1:]:
            beside_or_inside(top)
        else:
            top.legend()
        if shown:
            _differences(grid[1], shown, where, places, axis, confidence)
        bottom = grid[-1]
        bottom.set_xlabel(axis_label(axis))
        _ticks(bottom, values, where, numeric)
        tight(figure)


def _positions(values: list[Any], category: bool) -> tuple[dict[Any, float], bool]:
    numeric = all(isinstance(v, int | float) for v in values)
    if numeric and not category:
        return {v: float(v) for v in values}, True
    return {v: float(k) for k, v in enumerate(values)}, False


def _ticks(axes: Any, values: list[Any], where: dict[Any, float], numeric: bool) -> None:
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
        ticks = _apart(values)
        axes.set_xticks(ticks, [f"{v:g}" for v in ticks])
        axes.set_xticks([], minor=True)


def _apart(values: list[float]) -> list[float]:
    """Return those values whose labels do not touch on a log axis, the first and the last first."""
    low, high = math.log(min(values)), math.log(max(values))
    kept: list[float] = []
    for value in [min(values), max(values), *values]:
        at = (math.log(value) - low) / (high - low)
        if all(abs(at - (math.log(other) - low) / (high - low)) >= 0.055 for other in kept):
            kept.append(value)
    return sorted(kept)


def beside_or_inside(axes: Any) -> None:
    """Put the legend inside where it is short, and beside the axes where it would cover them."""
    names = axes.get_legend_handles_labels()[1]
    if len(names) > 4:
        axes.legend(loc="upper left", bbox_to_anchor=(1.01, 1.0), borderaxespad=0.0)
    else:
        axes.legend()


def _points(
    axes: Any, x: Any, lines: list[Line], colour: str, marker: str, who: str, *, join: bool
) -> None:
    y = np.array([line.estimate.value for line in lines])
    low = np.array([line.estimate.low for line in lines])
    high = np.array([line.estimate.high for line in lines])
    bars = np.nan_to_num(np.abs([y - low, high - y]))
    axes.errorbar(
        x, y, yerr=bars, color=colour, marker=marker, ms=5, capsize=3, lw=1.2,
        ls="-" if join else "none", label=who or None, zorder=2,
    )  # fmt: skip


def _differences(
    axes: Any,
    shown: Sequence[Compared],
    where: dict[Any, float],
    places: SummaryPlaces,
    axis: str,
    confidence: float,
) -> None:
    baseline = shown[0].baseline
    text = f"{baseline:g}" if isinstance(baseline, float) else figure_text(baseline)
    axes.axhline(0.0, color="#888888", lw=0.8)
    groups: dict[tuple[Any, ...], list[Compared]] = {}
    for item in shown:
        groups.setdefault(item.at, []).append(item)
    others = [name for name in places.axes if name != axis]
    for number, (at, items) in enumerate(list(groups.items())[:_MOST_LINES]):
        colour, marker = places.style(shown[0].result.name, number, len(groups))
        x = np.array([where[item.value] for item in items])
        y = np.array([item.difference.paired.value for item in items])
        half = np.nan_to_num([item.difference.paired.half_width for item in items])
        who = ", ".join(value_label(n, v) for n, v in zip(others, at, strict=True))
        axes.errorbar(x, y, yerr=half, color=colour, marker=marker, ms=5, capsize=3, lw=1.2,
                      ls="none", label=who or None)  # fmt: skip
        if len(groups) == 1:
            for px, item in zip(x, items, strict=True):
                e = item.difference.paired
                width = "" if np.isnan(e.half_width) else f" ± {_digits(e.half_width)}"
                text_at = {"xytext": (7, 4), "textcoords": "offset points", "fontsize": 8}
                axes.annotate(f"{_signed(e.value)}{width}", (px, e.value), **text_at)
    unit = unit_of(shown[0].result.name)
    axes.set_ylabel(f"Difference from\nthat at {text}{f' ({unit})' if unit else ''}")
    axes.set_title(
        f"Paired differences on the same units, {100 * confidence:g} % intervals", loc="left"
    )
    axes.margins(x=0.12, y=0.2)


def _digits(value: float) -> str:
    return f"{value:.0f}" if abs(value) >= 100 else f"{value:.3g}"


def _signed(value: float) -> str:
    return ("+" if value > 0 else "") + _digits(value)


def draw_heat(path: Target, places: SummaryPlaces, metric: str, x: str, y: str, title: str) -> None:
    """Draw a result over two axes; values of further axes are averaged."""
    across, up = places.axes.index(x), places.axes.index(y)
    lines = places.of(metric)
    columns = list(dict.fromkeys(line.at[across] for line in lines))
    rows = list(dict.fromkeys(line.at[up] for line in lines))
    total, many = np.zeros((len(rows), len(columns))), np.zeros((len(rows), len(columns)))
    for line in lines:
        if not np.isnan(line.estimate.value):
            at = rows.index(line.at[up]), columns.index(line.at[across])
            total[at] += line.estimate.value
            many[at] += 1
    with np.errstate(invalid="ignore"):
        values = np.where(many > 0, total / many, np.nan)
    width = min(12.0, 3.0 + 0.62 * len(columns))
    with drawing(max(5.0, width), min(10.0, 1.8 + 0.42 * len(rows) + 0.8), path) as figure:
        axes = figure.add_subplot()
        image = axes.imshow(values, aspect="auto", origin="lower", cmap="viridis")
        axes.spines[:].set_visible(False)
        for items, put in ((columns, axes.set_xticks), (rows, axes.set_yticks)):
            step = max(1, len(items) // 16)
            shown = range(0, len(items), step)
            put(list(shown), [_short(items[k]) for k in shown])
        if values.size <= 150:
            middle = np.nanmean(values) if (many > 0).any() else 0.0
            for (r, c), value in np.ndenumerate(values):
                if not np.isnan(value):
                    ink = "white" if value < middle else "black"
                    axes.text(c, r, _digits(value), ha="center", va="center", color=ink, size=8)
        axes.set_xlabel(axis_label(x))
        axes.set_ylabel(axis_label(y))
        axes.set_title(textwrap.fill(figure_text(title, _TITLE), 44), loc="left")
        figure.colorbar(image, label=readable(metric))
        tight(figure)


def _short(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, float) else figure_text(value)


def draw_polar(path: Target, places: SummaryPlaces, metric: str, axis: str, title: str) -> None:
    """Draw a result over bearing: the axis is in degrees, clockwise from ahead (up)."""
    place = places.axes.index(axis)
    with drawing(6.2, 6.0, path) as figure:
        axes = figure.add_subplot(projection="polar")
        axes.set_theta_zero_location("N")
        axes.set_theta_direction(-1)
        series = list(places.series(metric, axis, None).items())
        for number, (who, lines) in enumerate(series[:_MOST_LINES]):
            colour, marker = places.style(metric, number, len(series))
            lines = sorted(lines, key=lambda line: line.at[place])
            angle = np.radians([line.at[place] for line in lines])
            low, value, high = (
                np.array([getattr(line.estimate, name) for line in lines])
                for name in ("low", "value", "high")
            )
            ring = slice(None)
            if len(lines) > 2 and np.ptp(np.degrees(angle)) >= 270:
                ring = np.append(np.arange(len(lines)), 0)  # type: ignore[assignment]
            axes.plot(angle[ring], value[ring], color=colour, marker=marker, ms=4, label=who)
            axes.fill_between(angle[ring], low[ring], high[ring], color=colour, alpha=0.2, lw=0)
        axes.set_ylim(bottom=0.0)
        over = f"{readable(metric)} over {axis_label(axis)[:1].lower()}{axis_label(axis)[1:]}"
        axes.set_title(f"{figure_text(title, _TITLE)}\n{over}", loc="left")
        if len(series) > 1:
            axes.legend(loc="upper left", bbox_to_anchor=(1.05, 1.0))
        tight(figure)


def draw_scatter(
    path: Target, first: Any, second: Any, names: tuple[str, str], metric: str, title: str
) -> None:
    """Draw a result of two conditions against each other, one point per encounter or replica."""
    both = ~np.isnan(first) & ~np.isnan(second)
    with drawing(5.4, 5.2, path) as figure:
        axes = figure.add_subplot()
        if both.any():
            ends = [
                min(first[both].min(), second[both].min()),
                max(first[both].max(), second[both].max()),
            ]
            axes.plot(ends, ends, color="#888888", lw=0.8)
        axes.plot(first[both], second[both], ls="none", marker="o", ms=4, color="#0072B2",
                  alpha=0.6, markeredgewidth=0)  # fmt: skip
        axes.set_xlabel(f"{readable(metric)}: {figure_text(names[0])}")
        axes.set_ylabel(f"{readable(metric)}: {figure_text(names[1])}")
        axes.set_title(figure_text(title, _TITLE), loc="left")
        tight(figure)
