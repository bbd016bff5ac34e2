"""What each model changes of a study's results, against what it costs, as a figure."""

import math
from pathlib import Path
from typing import Any

from dsa_des.answers.alternatives import AS_IT_IS
from dsa_des.answers.report import AnswerReport
from dsa_des.answers.verdicts import ModelVerdict
from dsa_des.block.mark import RED
from dsa_des.costs.cost_report import Label, place_labels_without_overlap
from dsa_des.record.drawing import draw_to_png, figure_text, fit_axes_to_texts, set_plain_log_ticks
from dsa_des.results.labels import unit_of

_GREY, _ALLOWED = "#777777", "#e4efe4"
#: Costs that are named in any case: by so much dearer or cheaper than the scene as it is.
_FAR = 2.0
_WIDE_IN, _HIGH_IN, _COLUMNS = 5.2, 3.9, 2


def draw_changes_against_cpu(path: Path, report: AnswerReport) -> None:
    """Draw the change of each result with its interval against CPU: a panel for each result.

    The limit is a band, the front is red. Models are named that are on the front, whose intervals
    reach beyond the limit, or whose costs are far from the scene's own.
    """
    columns = min(_COLUMNS, len(report.results))
    rows = math.ceil(len(report.results) / columns)
    with draw_to_png(_WIDE_IN * columns, _HIGH_IN * rows + 0.5, path) as figure:
        figure.suptitle(f"{figure_text(report.title, 70)}:\nwhat each model changes, and costs")
        drawn = []
        for number, result in enumerate(report.results, start=1):
            axes = figure.add_subplot(rows, columns, number)
            drawn.append((axes, _draw_result_and_list_labels(axes, report, result.name)))
        fit_axes_to_texts(figure)
        for axes, labels in drawn:  # where points are is known only now
            place_labels_without_overlap(axes, labels)


def _draw_result_and_list_labels(axes: Any, report: AnswerReport, name: str) -> list[Label]:
    """Draw the models of one result, and return their labels."""
    shown = [v for v in report.verdicts[name] if _can_be_drawn(report, v)]
    limits = {verdict.limit for verdict in shown}
    # Where places have limits of their own, a change is shown by that of its place.
    by_limit = len(limits) > 1 and min(limits) > 0.0
    limit = 1.0 if by_limit else min(limits, default=0.0)
    axes.axhspan(-limit, limit, color=_ALLOWED, linewidth=0, zorder=0)
    axes.axhline(0.0, color="#bbbbbb", linewidth=0.8, zorder=1)
    axes.plot(1.0, 0.0, "D", color="black", markersize=5, zorder=4)
    labels: list[Label] = [(AS_IT_IS, (1.0, 0.0), 0.0, "black")]
    most = limit
    for verdict in shown:
        assert verdict.change is not None
        cost, spread = report.costs[verdict.model]
        change = verdict.change.difference
        low, value, high = (
            one / (verdict.limit if by_limit else 1.0)
            for one in (change.low, change.value, change.high)
        )
        most = max(most, abs(low), abs(high))
        colour = RED if verdict.on_front else _GREY
        axes.errorbar(
            cost, value, xerr=min(spread, 0.9 * cost), yerr=[[value - low], [high - value]],
            fmt="o", markersize=4, color=colour, ecolor=colour, elinewidth=0.9, capsize=2, zorder=3,
        )  # fmt: skip
        apart = max(abs(low), abs(high)) > limit or not 1.0 / _FAR < cost < _FAR
        named = verdict.on_front or apart  # labels keep clear of the points of others too
        labels.append((verdict.model if named else "", (cost, value), spread, colour))
    costs = [1.0, *(report.costs[verdict.model][0] for verdict in shown)]
    axes.set_xscale("log")
    axes.set_xlim(min(costs) / 1.4, max(costs) * 2.0)
    if limit > 0.0 and most > 20.0 * limit:  # linear within the limit, logarithmic beyond
        axes.set_yscale("symlog", linthresh=limit)
        axes.yaxis.set_major_formatter("{x:g}")
    reach = 1.15 * most if most > 0.0 else 1.0  # no model changes anything
    axes.set_ylim(-reach, reach)
    axes.set_title(figure_text(name, 60))
    axes.set_xlabel("CPU, by that of the scene as it is")
    unit = unit_of(name)
    axes.set_ylabel("change, by the limit" if by_limit else f"change{f' ({unit})' if unit else ''}")
    set_plain_log_ticks(axes.xaxis)
    return labels


def _can_be_drawn(report: AnswerReport, verdict: ModelVerdict) -> bool:
    if verdict.change is None or math.isnan(report.costs[verdict.model][0]):
        return False
    change = verdict.change.difference
    return not any(map(math.isnan, (change.low, change.value, change.high)))
