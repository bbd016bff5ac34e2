"""The tables of a study on the terminal."""

from collections.abc import Sequence
from typing import Any

from dsa_des.studies.output import Tables
from dsa_des.text.safe_text import shortened

#: Lines of a table that are printed.
_MOST_SHOWN = 1000


def show(console: Any, tables: Tables, only: Sequence[str] = ()) -> None:
    """Print the tables of a study on a ``rich.console.Console``.

    Parameters
    ----------
    console : rich.console.Console
    tables : Tables
    only : sequence of str
        Results to show; by default those that the study draws or waits for, or else all.
    """
    from rich.table import Table

    study = tables.record
    lines = tables.shown_lines(only)
    level = f"{100 * study.confidence:g} %"
    unit = "encounters" if study.over else "replicas"
    table = Table(title=shortened(study.title), title_justify="left", box=None, pad_edge=False)
    expected = any(line.expected is not None for line in lines)
    heads = [*tables.rows.axes, "result", "mean or share", f"{level} interval", unit, "without"]
    for heading in [*heads, *(["analytic"] if expected else [])]:
        table.add_column(heading)
    for line in lines[:_MOST_SHOWN]:
        e = line.estimate
        row = [*map(short, line.at), line.result.name, short(e.value)]
        row += [f"{short(e.low)} to {short(e.high)}" + (" *" if e.few else "")]
        row += [str(e.count), str(line.missing or "")]
        if expected:
            row.append("" if line.expected is None else short(line.expected))
        table.add_row(*row)
    console.print(table)
    if study.over:
        console.print(
            "intervals are over encounters like these, of which each counts once, whatever its "
            "replicas"
        )
    if tables.compared:
        console.print()
        console.print(_difference_table(tables, {line.result.name for line in lines}))
    longest = max(len(lines), len(tables.compared))
    if longest > _MOST_SHOWN:
        console.print(f"... and {longest - _MOST_SHOWN:,} more lines in summary.parquet")
    few = [line for line in lines if line.estimate.few and line.estimate.count]
    if few:
        console.print(
            f"* warning: too few values to rely on the interval in {len(few)} of {len(lines)} "
            f"lines; give more {unit}"
        )
    _note_unreached(console, tables)
    if len(lines) < len(tables.lines):
        console.print("all results: summary.parquet, or dsa-des study show FOLDER")
    if tables.rows.failed:
        console.print(f"{tables.rows.failed} runs failed; `error` and `command` of parts/ say why")
    if tables.rows.crashed:
        console.print(
            f"{tables.rows.crashed} of them crashed: the process that ran them died each time; "
            "--resume tries them again"
        )


def _note_unreached(console: Any, tables: Tables) -> None:
    stop = tables.record.stop_when
    if stop is None:
        return
    wide = [
        line
        for line in tables.lines
        if line.result.name == stop.metric and not line.estimate.half_width <= stop.half_width
    ]
    if wide:
        console.print(
            f"warning: after all {tables.record.replicas} replicas the half-width of {stop.metric} "
            f"is still above {stop.half_width:g} in {len(wide)} cells"
        )


def _difference_table(tables: Tables, names: set[str]) -> Any:
    from rich.table import Table

    assert tables.baseline is not None
    axis, baseline = tables.baseline
    title = f"less the same at {shortened(axis)} = {short(baseline)}, pair by pair"
    table = Table(title=title, title_justify="left", box=None, pad_edge=False)
    others = [name for name in tables.rows.axes if name != axis]
    for heading in (axis, *others, "result", "difference", "paired interval", "pairs",
                    "only one has it", "unpaired interval", "narrower"):  # fmt: skip
        table.add_column(heading)
    shown = [item for item in tables.compared if item.result.name in names]
    for item in shown[:_MOST_SHOWN]:
        d = item.difference
        only = f"{d.only_first}/{d.only_second}" if d.only_first or d.only_second else ""
        table.add_row(
            short(item.value), *map(short, item.at), item.result.name, short(d.paired.value),
            f"{short(d.paired.low)} to {short(d.paired.high)}" + (" *" if d.paired.few else ""),
            str(d.paired.count), only, f"{short(d.unpaired.low)} to {short(d.unpaired.high)}",
            times(d.narrower),
        )  # fmt: skip
    return table


#: Intervals that shrink more than this rest on the rounding of equal numbers.
_ROUNDING = 1e9


def times(ratio: float) -> str:
    """Return how many times narrower for a table; empty where nothing but rounding differs."""
    return f"{ratio:.1f} times" if ratio < _ROUNDING else ""


def short(value: Any) -> str:
    """Return a value for a table: numbers to five digits."""
    if isinstance(value, float):
        return "-" if value != value else f"{value:.5g}"
    return shortened(value)
