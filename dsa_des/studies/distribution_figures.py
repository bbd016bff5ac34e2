"""Figures of how a result is spread over the runs of a study: histograms, cumulative shares."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from dsa_des.arrays.types import FloatArray
from dsa_des.record.drawing import drawing, figure_text, tight
from dsa_des.studies.figures import STYLES, Target, beside_or_inside
from dsa_des.studies.labels import readable

_MOST_LINES = 12
_TITLE = 80
_FEWEST_BINS, _MOST_BINS = 5, 40

#: A label, and the values of its runs, NaN where a run has none.
Series = tuple[str, FloatArray]


def draw_histogram(
    path: Target, series: Sequence[Series], metric: str, title: str, mark: tuple[str, str] | None
) -> None:
    """Draw how many runs have which value, one outline per series over common bins.

    Parameters
    ----------
    path : Path or stream
    series : sequence of (label, values)
    metric : str
        Name of the result.
    title : str
    mark : (colour, marker), optional
        Of the block it is of; for a single series.
    """
    known = [(who, values[~np.isnan(values)], len(values)) for who, values in series[:_MOST_LINES]]
    every = np.concatenate([values for _, values, _ in known] or [np.empty(0)])
    with drawing(9.0 if len(known) > 4 else 7.5, 4.2, path) as figure:
        axes = figure.add_subplot()
        edges = _edges(every, max((len(values) for _, values, _ in known), default=0))
        for number, (who, values, runs) in enumerate(known):
            colour = _colour(number, len(known), mark)
            counts = np.histogram(values, edges)[0]
            axes.stairs(counts, edges, color=colour, lw=1.4, label=_counted(who, values, runs))
            axes.stairs(counts, edges, color=colour, fill=True, alpha=0.15)
        axes.set_ylim(bottom=0.0)
        axes.yaxis.get_major_locator().set_params(integer=True)
        axes.set_ylabel("Runs")
        _finish(figure, axes, metric, title)


def draw_cdf(
    path: Target, series: Sequence[Series], metric: str, title: str, mark: tuple[str, str] | None
) -> None:
    """Draw the share of all runs whose value is at most x, one step curve per series.

    Runs without a value count as well: where some have none, a curve ends below 1. Parameters are
    those of `draw_histogram`.
    """
    shown = series[:_MOST_LINES]
    with drawing(9.0 if len(shown) > 4 else 7.5, 4.2, path) as figure:
        axes = figure.add_subplot()
        for number, (who, values) in enumerate(shown):
            ascending = np.sort(values[~np.isnan(values)])
            if not len(ascending):
                axes.plot([], [], color=_colour(number, len(shown), mark), label=f"{who}: no value")
                continue
            share = np.arange(1, len(ascending) + 1) / len(values)
            axes.step(
                np.concatenate((ascending[:1], ascending)), np.concatenate(([0.0], share)),
                where="post", color=_colour(number, len(shown), mark), lw=1.4,
                label=_counted(who, ascending, len(values)),
            )  # fmt: skip
        axes.set_ylim(0.0, 1.02)
        axes.set_ylabel("Share of the runs at or below")
        axes.grid(color="#DDDDDD", linewidth=0.5)
        _finish(figure, axes, metric, title)


def _colour(number: int, of: int, mark: tuple[str, str] | None) -> str:
    return mark[0] if of == 1 and mark is not None else STYLES[number % len(STYLES)][0]


def _counted(who: str, values: FloatArray, runs: int) -> str:
    of = f"{len(values):,} of {runs:,}" if len(values) < runs else f"{runs:,}"
    return f"{who}: {of} runs" if who else f"{of} runs"


def _edges(values: FloatArray, most: int) -> FloatArray:
    """Return the edges of bins that all series share: about the square root of the runs of one."""
    if not len(values):
        return np.array([0.0, 1.0])
    low, high = float(values.min()), float(values.max())
    if low == high:
        half = max(abs(low) * 0.01, 0.5)
        return np.array([low - half, low + half])
    bins = int(np.clip(np.ceil(np.sqrt(most)), _FEWEST_BINS, _MOST_BINS))
    return np.linspace(low, high, bins + 1)


def _finish(figure: Any, axes: Any, metric: str, title: str) -> None:
    axes.set_xlabel(readable(metric))
    axes.set_title(figure_text(title, _TITLE), loc="left")
    beside_or_inside(axes)
    tight(figure)
