"""The results of a cost study as a table on the terminal, a Parquet file and a figure."""

import math
from collections.abc import Mapping, Sequence
from itertools import groupby
from pathlib import Path
from typing import Any

from dsa_des.costs.study import RungCost

_EFFECT_COLUMNS = (
    ("first seen, m", "first_detection_range_change_m", "+,.0f"),
    ("s", "first_detection_time_change_s", "+.2f"),
    ("gained", "detections_gained", "d"),
    ("lost", "detections_lost", "d"),
    ("fused", "fused_share", ".1%"),
)
_NO_ERROR = "-"


def write_table(path: Path, rows: Sequence[Mapping[str, Any]]) -> None:
    """Write rows as Parquet; nested tables become columns with a prefix, lists become text."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    flat = [_flattened(row) for row in rows]
    names = list(dict.fromkeys(name for row in flat for name in row))
    pq.write_table(pa.table({name: [row.get(name) for row in flat] for name in names}), path)


def _flattened(row: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    found: dict[str, Any] = {}
    for name, value in row.items():
        if isinstance(value, Mapping):
            found.update(_flattened(value, f"{prefix}{name}_"))
        else:
            found[f"{prefix}{name}"] = ", ".join(value) if isinstance(value, list) else value
    return found


def print_costs(
    costs: Sequence[RungCost], chain: Sequence[Mapping[str, Any]], notes: Sequence[str]
) -> None:
    """Print one table per ladder."""
    from rich.console import Console
    from rich.table import Table

    console = Console(width=None if Console().is_terminal else 150)
    for (block, ladder_name), group in groupby(costs, key=lambda c: (c.block, c.ladder.name)):
        rungs = list(group)
        unit = rungs[0].ladder.quantities[0]
        console.print(
            f"\n[bold]{block}[/bold], {ladder_name}: errors in {unit.name}, {unit.unit}, against "
            f"{rungs[0].reference}",
            highlight=False,
        )
        table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
        table.add_column("rung", no_wrap=True)
        for heading in ("us/target-scan", "mean", "p95", "max",
                        *(heading for heading, _, _ in _EFFECT_COLUMNS)):  # fmt: skip
            table.add_column(heading, justify="right", no_wrap=True)
        table.add_column("")
        for cost in rungs:
            table.add_row(*_cells(cost))
        console.print(table, highlight=False, markup=False)
    if chain:
        _print_chain(console, chain)
    for note in notes:
        console.print(f"note: {note}", highlight=False, markup=False)


def _cells(cost: RungCost) -> list[str]:
    name = cost.rung + (" (scene)" if cost.in_scene else "")
    if cost.unavailable:
        missing = f"not available: {cost.unavailable}"
        return [name, *[_NO_ERROR] * (4 + len(_EFFECT_COLUMNS)), missing]
    errors = [cost.error.mean, cost.error.p95, cost.error.maximum]
    effects = [
        _NO_ERROR if (value := cost.effect.get(key)) is None else format(value, form)
        for _, key, form in _EFFECT_COLUMNS
    ]
    return [
        name,
        f"{cost.cpu_us_per_target_scan:.3g} ± {cost.cpu_spread_us:.1g}",
        *(_NO_ERROR if math.isnan(error) else f"{error:.3g}" for error in errors),
        *effects,
        "; ".join(_remarks(cost)),
    ]


def _remarks(cost: RungCost) -> list[str]:
    remarks = ["front"] if cost.pareto else []
    if cost.cheapest_inside:
        remarks.append("cheapest inside the budget")
    elif cost.inside_budget:
        remarks.append("inside the budget")
    if cost.rung == cost.reference:
        remarks.append(f"own error {cost.error_note}" if cost.errors else cost.error_note)
    missed = cost.effect.get("never_detected")
    if missed:
        remarks.append(f"never sees {', '.join(missed)}")
    return remarks


def _print_chain(console: Any, chain: Sequence[Mapping[str, Any]]) -> None:
    from rich.table import Table

    console.print("\n[bold]whole chain[/bold], the front", highlight=False)
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
    for heading in ("us/target-scan", "detections that differ", "first seen, m", "rungs"):
        table.add_column(heading, justify="left" if heading == "rungs" else "right")
    for row in sorted(chain, key=lambda row: float(row["cpu_us_per_target_scan"])):
        if row["pareto"]:
            first = row["effect"].get("first_detection_range_change_m")
            table.add_row(
                f"{row['cpu_us_per_target_scan']:.3g}",
                f"{row['error_p95']:.2%}",
                _NO_ERROR if first is None else f"{first:+,.0f}",
                row["rung"],
            )
    console.print(table, highlight=False, markup=False)


def draw_costs(path: Path, title: str, costs: Sequence[RungCost]) -> None:
    """Draw error against cost, one panel per ladder, the front as a line and rungs by name."""
    panels = [
        [cost for cost in group if not cost.unavailable]
        for _, group in groupby(costs, key=lambda c: (c.block, c.ladder.name))
    ]
    columns = min(3, max(1, len(panels)))
    rows = max(1, math.ceil(len(panels) / columns))
    figure = _figure(4.3 * columns, 3.5 * rows + 0.5)
    figure.suptitle(f"{title}: what each model costs and what it gets wrong")
    for number, rungs in enumerate(panels):
        _draw_panel(figure.add_subplot(rows, columns, number + 1), rungs)
    figure.tight_layout()
    figure.savefig(path, metadata={"Software": None})


def _figure(width_in: float, height_in: float) -> Any:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width_in, height_in), dpi=110)
    FigureCanvasAgg(figure)
    return figure


def _draw_panel(axes: Any, rungs: Sequence[RungCost]) -> None:
    if not rungs:
        axes.set_axis_off()
        return
    first, quantity = rungs[0], rungs[0].ladder.quantities[0]
    errors = {cost.rung: cost.error.p95 for cost in rungs}
    known = [error for error in errors.values() if error > 0.0]
    # A log axis has no zero: errors of 0 and unknown ones stand on the floor, open.
    floor = 0.1 * min(known) if known else 1e-3
    front = []
    for place, cost in enumerate(sorted(rungs, key=lambda c: c.cpu_us_per_target_scan)):
        error = errors[cost.rung]
        at = error if error > 0.0 else floor
        colour = "#D55E00" if cost.pareto else "#777777"
        axes.errorbar(
            cost.cpu_us_per_target_scan, at, xerr=cost.cpu_spread_us, fmt="o", color=colour,
            markerfacecolor=colour if error > 0.0 else "white", capsize=2, zorder=3,
        )  # fmt: skip
        label = cost.rung + (" (scene)" if cost.in_scene else "")
        if not error > 0.0:
            label += ", no error known" if error != error else ", error 0"
        axes.annotate(
            label, (cost.cpu_us_per_target_scan, at), xytext=(6, 7 if place % 2 else -11),
            textcoords="offset points", fontsize=7.5, color=colour,
        )  # fmt: skip
        if cost.pareto:
            front.append((cost.cpu_us_per_target_scan, at))
    axes.plot(*zip(*front, strict=True), color="#D55E00", linewidth=1, zorder=2) if front else None
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.margins(x=0.35, y=0.18)
    axes.grid(True, which="major", color="#dddddd", linewidth=0.6)
    axes.set_title(f"{first.block}: {first.ladder.name}, against {first.reference}", fontsize=9)
    axes.set_xlabel("CPU time of the block, µs per target-scan", fontsize=8)
    axes.set_ylabel(f"{quantity.name}: 95 % of errors below, {quantity.unit}", fontsize=8)
    axes.tick_params(labelsize=7)
