"""The results of a cost study as a table on the terminal, a Parquet file and a figure."""

import io
import math
from collections.abc import Mapping, Sequence
from itertools import groupby
from pathlib import Path
from textwrap import wrap
from typing import Any

from dsa_des.block.mark import RED
from dsa_des.costs.climb import Comparison, RungCost, format_change_value
from dsa_des.files.output_file import write_file
from dsa_des.record.drawing import draw_to_png, figure_text, fit_axes_to_texts, set_plain_log_ticks
from dsa_des.terminal import terminal
from dsa_des.terminal.tables import print_table
from dsa_des.text.safe_text import shorten

_NO_ERROR = "-"


def write_rows_as_parquet(path: Path, rows: Sequence[Mapping[str, Any]]) -> None:
    """Write rows as Parquet; nested tables become columns with a prefix, lists become text."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    flat = [_flatten_nested_columns(row) for row in rows]
    names = list(dict.fromkeys(name for row in flat for name in row))
    # To memory first: a Parquet writer on a full disk fails a second time when it is collected.
    content = io.BytesIO()
    pq.write_table(pa.table({name: [row.get(name) for row in flat] for name in names}), content)
    write_file(path, content.getvalue())


def _flatten_nested_columns(row: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    flat: dict[str, Any] = {}
    for name, value in row.items():
        if isinstance(value, Mapping):
            flat.update(_flatten_nested_columns(value, f"{prefix}{name}_"))
        else:
            flat[f"{prefix}{name}"] = ", ".join(value) if isinstance(value, list) else value
    return flat


def print_ladder(rungs: Sequence[RungCost], comparison: Comparison) -> None:
    """Print the table of one ladder."""
    console = terminal.console(150)
    effects = [change.heading for change in comparison.changes]
    headings = ["rung", "us/target-scan", "mean", "p95", "max", *effects, "remark"]
    first = rungs[0]
    unit = first.ladder.quantities[0]
    what = f"{first.ladder.name}: errors in {unit.name}, {unit.unit}, against {first.reference}"
    console.print()
    rows = [_cost_cells(cost, comparison) for cost in rungs]
    last = len(headings) - 1
    title = f"{shorten(first.block)}, {what}"
    print_table(console, title, headings, rows, below=last, right=range(1, last))


def print_chain_and_notes(
    chain: Sequence[Mapping[str, Any]], notes: Sequence[str], comparison: Comparison
) -> None:
    """Print the front of the whole chain, and notes."""
    console = terminal.console(150)
    if chain:
        _print_chain(console, chain, comparison)
    for note in notes:
        console.print(f"note: {note}", highlight=False)


def _cost_cells(cost: RungCost, comparison: Comparison) -> list[str]:
    name = cost.rung + (" (scene)" if cost.in_scene else "")
    if cost.unavailable:
        missing = f"not available: {cost.unavailable}"
        return [name, *[_NO_ERROR] * (4 + len(comparison.changes)), missing]
    errors = [
        cost.first_quantity_error.mean,
        cost.first_quantity_error.p95,
        cost.first_quantity_error.maximum,
    ]
    effects = [format_change_value(change, cost.effect, _NO_ERROR) for change in comparison.changes]
    return [
        name,
        f"{_rounded_number_text(cost.cpu_us_per_target_scan)} ± "
        f"{_rounded_number_text(cost.cpu_spread_us, 1)}",
        *(_NO_ERROR if math.isnan(error) else _rounded_number_text(error) for error in errors),
        *effects,
        "; ".join(_cost_notes(cost) + comparison.describe_changes(cost.effect)),
    ]


def _cost_notes(cost: RungCost) -> list[str]:
    remarks = ["front"] if cost.pareto else []
    if cost.cheapest_inside:
        remarks.append("cheapest inside the budget")
    elif cost.inside_budget:
        remarks.append("inside the budget")
    if cost.rung == cost.reference:
        remarks.append(f"own error {cost.error_note}" if cost.errors else cost.error_note)
    return remarks


def _print_chain(console: Any, chain: Sequence[Mapping[str, Any]], comparison: Comparison) -> None:
    console.print()
    telling = comparison.changes[:1]
    headings = ["us/target-scan", comparison.difference.name, *(c.heading for c in telling)]
    rows = [
        [
            _rounded_number_text(row["cpu_us_per_target_scan"]),
            f"{row['error_p95']:.2%}",
            *(format_change_value(change, row["effect"], _NO_ERROR) for change in telling),
            row["rung"],
        ]
        for row in sorted(chain, key=lambda row: float(row["cpu_us_per_target_scan"]))
        if row["pareto"]
    ]
    last = len(headings)
    title = "whole chain, the front"
    print_table(console, title, [*headings, "rungs"], rows, below=last, right=range(last))


def _rounded_number_text(value: float, digits: int = 3) -> str:
    """Return a number rounded to so many digits; a large one without a power of ten."""
    text = f"{value:.{digits}g}"
    return f"{float(text):,.0f}" if float(text) >= 10**digits else text


def draw_error_against_cost(path: Path, title: str, costs: Sequence[RungCost]) -> None:
    """Draw error against cost, one panel per ladder, the front as a line and rungs by name."""
    panels = [
        [cost for cost in group if not cost.unavailable]
        for _, group in groupby(costs, key=lambda c: (c.block, c.ladder.name))
    ]
    # A block that saw no target says nothing of its rungs.
    panels = [rungs for rungs in panels if any(cost.first_quantity_error.count for cost in rungs)]
    columns = min(3, max(1, len(panels)))
    rows = max(1, math.ceil(len(panels) / columns))
    with draw_to_png(4.3 * columns, 3.5 * rows + 0.5, path) as figure:
        heading = f"{figure_text(title, 80)}: what each model costs and what it gets wrong"
        figure.suptitle("\n".join(wrap(heading, _LETTERS * columns)))
        drawn = []
        for number, rungs in enumerate(panels):
            axes = figure.add_subplot(rows, columns, number + 1)
            drawn.append((axes, _draw_panel(axes, rungs)))
        fit_axes_to_texts(figure)
        for axes, labels in drawn:  # where points are is known only now
            place_labels_without_overlap(axes, labels)


#: So many letters of the figure's title stand above one panel.
_LETTERS = 46

#: What is written, at which point, how far its error bar reaches, in which colour.
Label = tuple[str, tuple[float, float], float, str]


def _draw_panel(axes: Any, rungs: Sequence[RungCost]) -> list[Label]:
    """Draw a ladder's points and front, and return their labels."""
    first, quantity = rungs[0], rungs[0].ladder.quantities[0]
    others = [cost.first_quantity_error.p95 for cost in rungs if cost.rung != first.reference]
    known = [error for error in others if error > 0.0]
    # Errors of rounding, of 0 and unknown ones stand on the floor, open, with their number: on a
    # true scale they would press all others together, and a log axis has no zero.
    floor = 0.1 * min(known) if known else 1e-3
    points: list[tuple[tuple[float, float], bool]] = []
    labels: list[Label] = []
    for cost in sorted(rungs, key=lambda c: c.cpu_us_per_target_scan):
        error, label = (
            cost.first_quantity_error.p95,
            cost.rung + (" (scene)" if cost.in_scene else ""),
        )
        on_floor = not error > floor
        if on_floor:
            label += (
                ": error unknown"
                if math.isnan(error)
                else f": {_error_text(error)} {quantity.unit}"
            )
        at = (cost.cpu_us_per_target_scan, floor if on_floor else error)
        colour = RED if cost.pareto else "#777777"
        axes.errorbar(
            *at, xerr=cost.cpu_spread_us, fmt="o", color=colour, capsize=2, zorder=3,
            markerfacecolor="white" if on_floor else colour,
        )  # fmt: skip
        labels.append((label, at, cost.cpu_spread_us, colour))
        points.append((at, cost.pareto))
    front = [at for at, pareto in points if pareto]
    axes.plot(*zip(*front, strict=True), color=RED, linewidth=1, zorder=2)
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlim(*_log_limits([x for (x, _), _ in points], right=1.2))
    axes.set_ylim(*_log_limits([y for (_, y), _ in points]))
    axes.grid(True, which="major", color="#dddddd", linewidth=0.6)
    axes.set_title(
        f"{figure_text(first.block)}: {first.ladder.name}, against {first.reference}", fontsize=9
    )
    axes.set_xlabel("CPU time of the block (µs per target-scan)", fontsize=8)
    what = quantity.name.replace("_", " ")
    axes.set_ylabel(f"{what}: 95 % of errors\nbelow ({quantity.unit})", fontsize=8)
    set_plain_log_ticks(axes.xaxis)
    set_plain_log_ticks(axes.yaxis)
    axes.tick_params(which="both", labelsize=7)
    return labels


def _error_text(error: float) -> str:
    return f"{error:.0e}" if error else "0"


def place_labels_without_overlap(axes: Any, labels: Sequence[Label]) -> None:
    """Write each label beside its point, moved until it covers no point and no other label."""
    high, wide, gap, mark = 12.0, 6.4, 5.0, 5.0  # a line, a letter, a gap, half a point; pixels
    places = []
    for label, (cost, error), spread, colour in labels:
        x, y = axes.transData.transform((cost, error))
        bar = max(mark, axes.transData.transform((cost + spread, error))[0] - x)
        places.append((y, x, bar, label, (cost, error), colour))
    put = [(x - bar, x + bar, y) for y, x, bar, *_ in places]
    edge, end, top = axes.bbox.x0, axes.bbox.x1, axes.bbox.y1
    for y, x, bar, label, at, colour in sorted(places, reverse=True):
        width = wide * len(label)

        def free(corner: tuple[float, float], width: float = width) -> bool:
            left, middle = corner
            return (
                edge < left
                and left + width < end
                and middle + high / 2 < top
                and all(
                    abs(middle - other_y) >= high or left + width < other_x or other_end < left
                    for other_x, other_end, other_y in put
                )
            )

        tries = [
            (x + left, y + up)
            for up in (0.0, -13.0, 13.0, -26.0, 26.0, -39.0, 39.0, -52.0, 52.0)
            for left in (bar + gap, -bar - gap - width, -width / 2)
        ]
        left, middle = next(filter(free, tries), tries[0])
        put.append((left, left + width, middle))
        axes.annotate(
            label, at, xytext=(left - x, middle - y), textcoords="offset pixels", fontsize=7,
            color=colour, va="center_baseline",
        )  # fmt: skip


def _log_limits(values: Sequence[float], right: float = 0.4) -> tuple[float, float]:
    """Return limits of a log axis: some room on both sides, whole decades inside."""
    low, high = math.log10(min(values)), math.log10(max(values))
    return 10.0 ** (math.floor(low) - 0.2), 10.0 ** max(high + right, math.floor(low) + 1.2)
