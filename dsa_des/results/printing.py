"""The tables of a study on the terminal."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from dsa_des.record.failure_counts import failure_sentences
from dsa_des.results.labels import short_text, texts_rounded_to_interval
from dsa_des.results.statistics import Estimate
from dsa_des.results.summary import Answer, Compared, Line, one_sided_confidence
from dsa_des.results.tables import Tables, cut_off_text
from dsa_des.terminal.tables import print_table
from dsa_des.text.safe_text import shorten

_LONGEST = 300
#: Lines of a table that are printed.
_MOST_SHOWN = 1000


def print_study_tables(console: Any, tables: Tables, only: Sequence[str] = ()) -> None:
    """Print the tables of a study on a ``rich.console.Console``.

    `only` names results; by default those that the study draws or waits for, or else all.
    """
    study = tables.record
    lines = tables.shown_lines(only)
    level = f"{100 * study.confidence:g} %"
    unit = "encounters" if study.sample_columns else "replicas"
    expected = any(line.expected is not None for line in lines)
    headings = [*tables.rows.axes, "result", "mean or share", "cut off", f"{level} interval", unit]
    headings += ["without"]
    rows = []
    for line in lines[:_MOST_SHOWN]:
        e = line.estimate
        cut_off = cut_off_text(line)
        value, interval = rounded_value_and_interval(e)
        row = [*map(short_text, line.at), line.result.name, value]
        row += [f"({cut_off})" if cut_off else "", interval, str(e.count)]
        row += ["" if sum(many for _, many in line.cut_off) >= line.missing else str(line.missing)]
        if expected:
            row.append("" if line.expected is None else short_text(line.expected))
        rows.append(row)
    headings += ["analytic"] if expected else []
    notes = {result.name: result.meaning for result in tables.results}
    group = len(tables.rows.axes)
    print_table(console, shorten(study.title), headings, rows, group=group, notes=notes)
    if study.sample_columns:
        console.print(
            "intervals are over encounters like these, of which each counts once, whatever its "
            "replicas"
        )
    ratios = [line for line in lines if line.ratio is not None]
    if ratios:
        console.print()
        _show_ratios(console, tables, ratios)
    if tables.answers:
        console.print()
        _show_answers(console, tables)
    if tables.compared:
        console.print()
        _show_differences(console, tables, {line.result.name for line in lines})
    longest = max(len(lines), len(tables.compared))
    if longest > _MOST_SHOWN:
        console.print(f"... and {longest - _MOST_SHOWN:,} more lines in summary.parquet")
    few = [line for line in lines if line.estimate.few and line.estimate.count]
    if few:
        console.print(
            f"* warning: too few values to rely on the interval in {len(few)} of {len(lines)} "
            f"lines; give more {unit}"
        )
    if any(line.cut_off for line in lines):
        console.print(
            "(N of RUNS at the start): so many values are only where the run began or ended; "
            "without that they would lie beyond it"
        )
    _warn_of_wide_intervals(console, tables)
    if len(lines) < len(tables.lines):
        console.print("all results: summary.parquet, or dsa-des study show FOLDER")
    for sentence in failure_sentences(tables.folder.failure_counts()):
        console.print(shorten(sentence, _LONGEST), markup=False, soft_wrap=True)
    if tables.rows.failed:
        console.print(f"{tables.rows.failed} runs failed; `error` and `command` of parts/ say why")
        first = str(tables.rows.stored.failed[0]["error"])
        console.print(shorten(f"the first: {first}", _LONGEST), markup=False, soft_wrap=True)
    if tables.rows.crashed:
        console.print(
            f"{tables.rows.crashed} of them crashed: the process that ran them died each time; "
            "--resume tries them again"
        )


#: Columns of the table of requirements.
ANSWER_HEADS = (
    "requirement", "along", "where", "cheapest", "value there", "interval", "by the estimate alone",
    "note",
)  # fmt: skip


def answer_cells(tables: Tables, answer: Answer) -> list[str]:
    """Return the table row of the answer to a requirement, one text for each of `ANSWER_HEADS`."""
    estimate = answer.line.estimate
    notes = ["uneven: a cheaper one meets it, a dearer one does not"] if answer.uneven else []
    notes += ["few"] if estimate.few else []
    return [
        answer.requirement.text(), answer.requirement.axis, tables.other_axis_values_text(answer),
        "none" if answer.value is None else short_text(answer.value),
        *rounded_value_and_interval(estimate),
        "none" if answer.estimated is None else short_text(answer.estimated),
        "; ".join(notes),
    ]  # fmt: skip


def _show_answers(console: Any, tables: Tables) -> None:
    """Print the cheapest value that meets each requirement, by the values of the other axes."""
    rows = [answer_cells(tables, answer) for answer in tables.answers[:_MOST_SHOWN]]
    sure = f"{100 * one_sided_confidence(tables.record.confidence):g} %"
    print_table(console, f"cheapest that meets a limit, {sure} sure", ANSWER_HEADS, rows, group=0)
    if any(answer.value is None for answer in tables.answers):
        console.print(
            "none: the interval of the dearest does not lie within the limit, or is marked *"
        )


#: Columns of the table of ratios, behind those of the axes.
RATIO_HEADS = (
    "ratio of events", "unresolved", "induced", "gamma", "bootstrap", "effective size",
    "nominal, mitigated, induced", "without",
)  # fmt: skip


def ratio_cells(line: Line) -> list[str]:
    """Return a ratio's table row (parts, both intervals, event counts), texts for `RATIO_HEADS`."""
    ratio = line.ratio
    assert ratio is not None
    by = {r.method: r for r in (ratio, line.other) if r is not None}

    def interval(method: str) -> str:
        if method not in by or by[method].interval[0] != by[method].interval[0]:
            return ""
        low, high = by[method].interval
        return f"{short_text(low)} to {short_text(high)}" + (" *" if by[method].few else "")

    return [
        line.result.name, short_text(ratio.unresolved), short_text(ratio.induced),
        interval("gamma"),
        interval("bootstrap"), f"{ratio.effective_sample_size:.1f} of {ratio.encounters}",
        ratio.reason
        or f"{ratio.nominal_events}, {ratio.mitigated_events}, {ratio.induced_events}",
        str(line.missing) if line.missing else "",
    ]  # fmt: skip


def _show_ratios(console: Any, tables: Tables, lines: Sequence[Line]) -> None:
    """Print a table of the parts of each ratio and of both of its intervals."""
    rows = [[*map(short_text, line.at), *ratio_cells(line)] for line in lines[:_MOST_SHOWN]]
    level = f"{100 * tables.record.confidence:g} %"
    headings = [*tables.rows.axes, *RATIO_HEADS]
    print_table(console, f"parts of the ratios, {level} intervals", headings, rows,
                group=len(tables.rows.axes))  # fmt: skip
    if tables.record.geometry:
        for line in lines[:_MOST_SHOWN]:
            if line.ratio is not None and line.ratio.encounters:
                console.print(sampling_gain_text(line))


def sampling_gain_text(line: Line) -> str:
    """Return a sentence: how many runs were flown for a ratio, and how much more an interval as
    wide would cost with all flown.
    """
    ratio = line.ratio
    assert ratio is not None
    at = "".join(f"{short_text(value)}: " for value in line.at)
    if ratio.flown == ratio.encounters:
        return f"{at}{line.result.name}: all {ratio.flown:,} runs were flown: nothing is gained"
    said = f"{at}{line.result.name}: {ratio.flown:,} of {ratio.encounters:,} runs were flown"
    if not ratio.reason and not ratio.mitigated_events:
        return f"{said}; the event came in none of them, so what is gained is not known"
    if ratio.reason or not ratio.gain > 0.0:
        return said
    if ratio.gain < 1.05:
        return f"{said}; as wide an interval costs no more with all of them: nothing is gained"
    return f"{said}; as wide an interval costs {ratio.gain:.2g} times as much with all of them"


def _warn_of_wide_intervals(console: Any, tables: Tables) -> None:
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


def _show_differences(console: Any, tables: Tables, names: set[str]) -> None:
    assert tables.baseline is not None
    axis, baseline = tables.baseline
    others = [name for name in tables.rows.axes if name != axis]
    headings = [axis, *others, "result", "difference", "paired interval", "pairs",
             "only one has it", "unpaired interval"]  # fmt: skip
    rows = []
    shown = [item for item in tables.compared if item.result.name in names]
    for item in shown[:_MOST_SHOWN]:
        d = item.difference
        only = f"{d.only_first}/{d.only_second}" if d.only_first or d.only_second else ""
        rows.append(
            [short_text(item.value), *map(short_text, item.at), item.result.name,
            *rounded_value_and_interval(d.paired),
             str(d.paired.count), only, rounded_value_and_interval(d.unpaired)[1].rstrip(" *")]
        )  # fmt: skip
    title = f"less the same at {shorten(axis)} = {short_text(baseline)}, pair by pair"
    print_table(console, title, headings, rows, group=1 + len(others))
    if tables.record.compare_weight is not None:
        _show_event_ratios(console, tables, shown)


def _show_event_ratios(console: Any, tables: Tables, shown: Sequence[Compared]) -> None:
    """Print each event's weighted frequency relative to the baseline, with its interval."""
    assert tables.baseline is not None
    axis, baseline = tables.baseline
    others = [name for name in tables.rows.axes if name != axis]
    rows = [
        [short_text(item.value), *map(short_text, item.at), item.result.name,
        short_text(item.ratio.ratio),
         f"{short_text(item.ratio.interval[0])} to {short_text(item.ratio.interval[1])}"
         + (" *" if item.ratio.few else ""),
         short_text(item.ratio.unresolved), short_text(item.ratio.induced),
         f"{item.ratio.effective_sample_size:.1f} of {item.ratio.encounters}", item.ratio.reason]
        for item in shown[:_MOST_SHOWN] if item.ratio is not None
    ]  # fmt: skip
    if rows:
        console.print()
        title = f"events by those at {shorten(axis)} = {short_text(baseline)}, weighted by "
        headings = [axis, *others, "event", "ratio", "interval", "unresolved", "induced",
                 "effective size", ""]  # fmt: skip
        print_table(console, title + str(tables.record.compare_weight), headings, rows,
                    group=1 + len(others))  # fmt: skip


def interval_text(estimate: Estimate) -> str:
    """Return the interval as ``LOW to HIGH``; empty if none, with an asterisk if on few values."""
    if estimate.low != estimate.low:
        return ""
    return f"{short_text(estimate.low)} to {short_text(estimate.high)}" + (
        " *" if estimate.few else ""
    )


def rounded_value_and_interval(estimate: Estimate) -> tuple[str, str]:
    """Return (value, interval) texts, rounded to two significant digits of its half-width."""
    value, low, high = (
        0.0 if abs(number) < _NOTHING else number
        for number in (estimate.value, estimate.low, estimate.high)
    )
    half = (high - low) / 2
    if not _NOTHING < half < math.inf:
        return short_text(value), interval_text(replace(estimate, low=low, high=high))
    shown = texts_rounded_to_interval(half, value, low, high)
    return shown[0], f"{shown[1]} to {shown[2]}" + (" *" if estimate.few else "")


#: What is smaller is the rounding of equal numbers: nothing that is measured is so small.
_NOTHING = 1e-12
