"""Changes between two conditions in sentences: events earlier, later, or no longer."""

import textwrap
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from dsa_des.arrays.types import FloatArray, IntArray
from dsa_des.results.differences import second_minus_first_without_rounding
from dsa_des.results.labels import short_text, unit_of
from dsa_des.results.record import EVENT, Result
from dsa_des.results.tables import Tables
from dsa_des.terminal.terminal import console, say
from dsa_des.text.safe_text import escape_unprintable, shorten

#: Combinations of axis values that are listed, and results that a line names.
_MOST_PLACES, _MOST_NAMED = 12, 8


class ConditionPair:
    """The runs that two conditions have in common, by (encounter, replica)."""

    def __init__(self, one: Tables, rows: IntArray, other: Tables, others: IntArray) -> None:
        self.tables = one, other
        first, second = _row_by_key(one, rows), _row_by_key(other, others)
        self.keys = [key for key in first if key in second]
        #: The rows of both.
        self.rows = [np.array([side[key] for key in self.keys], dtype=np.int64)
                     for side in (first, second)]  # fmt: skip

    def paired_values(self, metric: str) -> tuple[FloatArray, FloatArray]:
        """Return a result in both conditions, by run, as two arrays; NaN where a run has none."""
        first, second = (
            tables.rows.column(metric)[rows].astype(float)
            for tables, rows in zip(self.tables, self.rows, strict=True)
        )
        return first, second


def _row_by_key(tables: Tables, rows: IntArray) -> dict[tuple[Any, ...], int]:
    columns = [
        [str(label) for label in tables.rows.column(name)[rows]] for name in tables.rows.over
    ]
    columns.append(tables.rows.column("replica")[rows].tolist())
    return dict(zip(zip(*columns, strict=True), rows.tolist(), strict=True))


@dataclass(frozen=True)
class _Change:
    """How a result changed over pairs: how many fell, rose, were lost or gained, and the mean."""

    result: Result
    pairs: int
    fell: int
    rose: int
    gone: int
    come: int
    #: Mean change where both have a value.
    mean: float

    @property
    def has_change(self) -> bool:
        return bool(self.fell or self.rose or self.gone or self.come)

    def phrases_on_change(self) -> list[str]:
        """Return phrases on how many runs fell and rose, in the result's words, and mean change."""
        of, told = f" of {self.pairs} runs", self.result.told
        assert told is not None
        parts = [
            f"{words} in {many:,}{of}"
            for words, many in ((told.less, self.fell), (told.more, self.rose))
            if many
        ]
        if parts and self.result.kind != EVENT:
            parts[-1] += f" (mean {self.mean_change_text})"
        return parts

    @property
    def mean_change_text(self) -> str:
        """The mean change as text with its sign and unit; empty if it is unknown."""
        if self.mean != self.mean:
            return ""
        unit = unit_of(self.result.name)
        return (
            f"{'+' if self.mean > 0 else ''}{short_text(float(f'{self.mean:.3g}'))} {unit}".strip()
        )


def print_changes(
    names: tuple[str, str], places: Sequence[tuple[str, ConditionPair]], results: Iterable[Result]
) -> None:
    """Print what changed in the results from one condition to another.

    `places` are what is compared: where, and the runs of both conditions there. Both have
    `results`.
    """
    results = [result for result in results if result.is_number]
    width: int = console(160).width
    say(f"What changed from {shorten(names[0])} to {shorten(names[1])}:")
    for where, pair in places[:_MOST_PLACES]:
        changes = [_count_change(result, pair) for result in results]
        indent = "  "
        if where:
            say(f"  {where}")
            indent = "    "
        for line in _change_lines(changes):
            for part in textwrap.wrap(
                escape_unprintable(line), width, initial_indent=indent,
                subsequent_indent=f"{indent}  ",
                break_long_words=False, break_on_hyphens=False,
            ):  # fmt: skip
                say(part)
    if len(places) > _MOST_PLACES:
        say(f"  ... and {len(places) - _MOST_PLACES:,} more places in the tables")
    say()


def _change_lines(changes: Sequence[_Change]) -> list[str]:
    if not any(change.pairs for change in changes):
        return ["nothing can be said: no run is in both"]
    clauses: dict[str, list[str]] = {}
    for change in changes:
        if change.result.told is not None:
            clauses.setdefault(change.result.told.who, []).extend(change.phrases_on_change())
    lines = [f"{shorten(who)}: {'; '.join(said)}" for who, said in clauses.items() if said]
    same = [shorten(who) for who, said in clauses.items() if not said]
    if same:
        lines.append(f"as before: {', '.join(same)}")
    others = [change for change in changes if change.result.told is None]
    changed = [change for change in others if change.has_change]
    if changed:
        shown = [_brief_change_text(change) for change in changed[:_MOST_NAMED]]
        more = len(changed) - _MOST_NAMED
        lines.append(
            ("also changed: " if clauses else "changed: ")
            + ", ".join(shown)
            + (f", and {more} more" * (more > 0))
        )
    if len(changed) < len(others):
        lines.append(f"{len(others) - len(changed)} other results are the same in every run")
    return lines


def _brief_change_text(change: _Change) -> str:
    name = shorten(change.result.name)
    if change.mean_change_text:
        return f"{name} ({change.mean_change_text} on average)"
    return f"{name} (only one of the two has it in {change.gone + change.come})"


def _count_change(result: Result, pair: ConditionPair) -> _Change:
    before, after = pair.paired_values(result.name)
    known = ~np.isnan(before) & ~np.isnan(after)
    changes = second_minus_first_without_rounding(before[known], after[known])
    mean = float(changes.mean()) if known.any() else float("nan")
    fell, rose = changes < 0.0, changes > 0.0
    gone, come = ~np.isnan(before) & np.isnan(after), np.isnan(before) & ~np.isnan(after)
    counts = [int(which.sum()) for which in (fell, rose, gone, come)]
    return _Change(result, len(pair.keys), counts[0], counts[1], counts[2], counts[3], mean)


def print_changes_along_axis(tables: Tables, only: Sequence[str] = ()) -> None:
    """Print how results change from the compared axis's baseline to each of its other values."""
    if tables.baseline is None:
        return
    axis, baseline = tables.baseline
    names_of = [shorten(name) for name in tables.rows.axes if name != axis]
    by_value: dict[Any, list[tuple[str, ConditionPair]]] = {}
    for value, others, base, rows in tables.rows.comparisons_with_baseline(axis, baseline):
        where = [f"{n} = {short_text(other)}" for n, other in zip(names_of, others, strict=True)]
        pair = ConditionPair(tables, base, tables, rows)
        by_value.setdefault(value, []).append((", ".join(where), pair))
    results = [result for result in tables.results if not only or result.name in only]
    swap = axis.startswith("swap.")
    for value, places in by_value.items():
        names = [
            short_text(item) if swap else f"{axis} = {short_text(item)}"
            for item in (baseline, value)
        ]
        print_changes((names[0], names[1]), places, results)
