"""A study's figure of results that make a series: ``NAME.5``, ``NAME.10`` and so on."""

import math
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from dsa_des.record.drawing import drawing, figure_text, tight
from dsa_des.studies.figures import STYLES, Target, beside_or_inside
from dsa_des.studies.labels import axis_label, readable
from dsa_des.studies.statistics import chi_square_bounds
from dsa_des.studies.summary import Line

_MOST_LINES = 12
_TITLE = 80


def of_series(metric: str, names: Iterable[str]) -> dict[str, float]:
    """Return the results of a series by name, with the number that each is of, ascending.

    Parameters
    ----------
    metric : str
        What stands before the last dot, such as ``track_nees.time_s``.
    names : iterable of str
        Of all results.
    """
    found = {}
    for name in names:
        number = name.removeprefix(f"{metric}.")
        if number == name:
            continue
        try:
            found[name] = float(number)
        except ValueError:
            continue
    return dict(sorted(found.items(), key=lambda item: item[1]))


def draw_series(
    path: Target,
    series: Sequence[tuple[str, Sequence[float], Sequence[Line]]],
    metric: str,
    title: str,
    confidence: float,
    freedom: float | None,
) -> None:
    """Draw the means of a series with their intervals, one line for each place of the axes.

    Parameters
    ----------
    path : Path or stream
    series : sequence of (label, numbers, lines)
    metric : str
        Whatever comes behind its first dot names the numbers.
    title : str
    confidence : float
    freedom : float, optional
        Degrees of freedom of chi-square: the bounds of the mean over the runs that have a value.
    """
    name, _, along = metric.partition(".")
    with drawing(9.6 if len(series) > 4 else 7.5, 4.2, path) as figure:
        axes = figure.add_subplot()
        if freedom is not None and series:
            _bounds(axes, series[0][1], series[0][2], freedom, confidence)
        for place, (who, x, lines) in enumerate(series[:_MOST_LINES]):
            colour, marker = STYLES[place % len(STYLES)]
            value, low, high = (
                np.array([getattr(line.estimate, part) for line in lines])
                for part in ("value", "low", "high")
            )
            label = who or f"mean of the runs, {100 * confidence:g} % interval"
            axes.plot(x, value, color=colour, marker=marker, ms=4, lw=1.2, label=label, zorder=2)
            axes.vlines(x, low, high, color=colour, lw=1.0, zorder=2)
        axes.set_ylim(bottom=0.0)
        axes.set_xlabel(axis_label(along) if along else "")
        axes.set_ylabel(readable(name))
        axes.set_title(figure_text(title, _TITLE), loc="left")
        if len(series) > 4:
            beside_or_inside(axes)
        else:  # from 0 on there is room below
            axes.legend(loc="lower left")
        tight(figure)


def _bounds(
    axes: Any, x: Sequence[float], lines: Sequence[Line], freedom: float, confidence: float
) -> None:
    counts = [line.estimate.count for line in lines]
    # The mean of n variables, each with so many degrees, is one with n times as many, by n.
    found = [
        np.array(chi_square_bounds(freedom * n, confidence)) / n if n else (math.nan, math.nan)
        for n in counts
    ]
    low, high = np.array(found).T
    axes.fill_between(
        x, low, high, color="#999999", alpha=0.3, linewidth=0, zorder=0,
        label=f"{100 * confidence:g} % bounds of χ², {freedom:g} degrees",
    )  # fmt: skip
    axes.axhline(freedom, color="#999999", lw=0.8, zorder=1)
