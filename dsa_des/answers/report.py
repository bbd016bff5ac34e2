"""What the models of a study come to, in a table and in sentences, for the terminal and a page."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

from dsa_des.answers.alternatives import AS_IT_IS, COLUMN
from dsa_des.answers.changes import PairedChange, confidence_per_interval
from dsa_des.answers.models_in_turns import TurnTimes
from dsa_des.answers.verdicts import (
    BEYOND,
    NOTHING,
    OPEN,
    SAME,
    WITHIN,
    Limit,
    ModelVerdict,
    flag_verdicts_on_cost_front,
    format_change,
    judge_by_worst_change,
)
from dsa_des.results.labels import short_text, texts_rounded_to_interval, unit_of
from dsa_des.results.printing import rounded_value_and_interval
from dsa_des.results.record import NUMBER, Result
from dsa_des.terminal import terminal
from dsa_des.terminal.tables import print_table
from dsa_des.text.safe_text import escape_unprintable

#: Columns of the table of one result.
HEADS = (COLUMN, "CPU", "change", "interval", "where it weighs most", "runs that differ", "verdict")
_MOST_NAMED = 12


@dataclass
class AnswerReport:
    """All that is said of a study's models; of an interrupted one what is there."""

    title: str
    #: What the sample is of: ``replicas`` or ``encounters``.
    unit: str
    #: Columns of the study's own axes, without those that are a sample.
    axes: Sequence[str]
    #: Names of the models that were compared, in order.
    models: Sequence[str]
    results: Sequence[Result]
    limits: dict[str, Limit]
    confidence: float
    comparisons: int
    changes: Sequence[PairedChange]
    turn_times: TurnTimes
    #: Model → why its runs gave nothing.
    failed: dict[str, str]
    #: Models that the scene has, and those that cannot run in it.
    own: Sequence[str]
    unavailable: Sequence[tuple[str, str]]
    notes: Sequence[str]

    def __post_init__(self) -> None:
        self.costs = {
            name: self.turn_times.relative_cpu_and_spread(k)
            for k, name in enumerate(self.models, start=1)
        }
        cheap = {name: cost for name, (cost, _) in self.costs.items()}
        #: Result → the verdicts of all models, in their order.
        self.verdicts: dict[str, list[ModelVerdict]] = {}
        for result in self.results:
            some = [
                judge_by_worst_change(
                    name, result,
                    [c for c in self.changes if c.model == name and c.result.name == result.name],
                    self.limits[result.name], self.failed.get(name, ""),
                )
                for name in self.models
            ]  # fmt: skip
            front = flag_verdicts_on_cost_front(some, cheap)
            self.verdicts[result.name] = [
                replace(one, on_front=best) for one, best in zip(some, front, strict=True)
            ]

    # -- the table ----------------------------------------------------------------------------

    def table_rows(self, name: str) -> Iterator[list[str]]:
        """Yield a result's table rows as texts under `HEADS`: first the scene, then each model."""
        own_ms, spread_ms = self.turn_times.run_cpu_ms_and_spread(0)
        yield [
            AS_IT_IS,
            f"{_format_plus_minus(own_ms, spread_ms)} ms a run",
            *[""] * (len(HEADS) - 2),
        ]
        for verdict in self.verdicts[name]:
            change = verdict.change
            cost = _format_plus_minus(*self.costs[verdict.model])
            said = f"{verdict.kind}{', front' if verdict.on_front else ''}"
            if change is None or verdict.kind == NOTHING:
                yield [verdict.model, cost, "", "", "", "", f"{said}: {verdict.reason}"]
                continue
            value, interval = rounded_value_and_interval(change.difference)
            yield [
                verdict.model, cost, value, interval,
                "" if change.has_only_identical_runs else self._location_text(change),
                f"{change.differing:,} of {change.runs:,}", said + _change_notes(change),
            ]  # fmt: skip

    def _location_text(self, change: PairedChange) -> str:
        return ", ".join(
            f"{n} = {short_text(v)}" for n, v in zip(self.axes, change.at, strict=True)
        )

    def table_heading(self, name: str) -> str:
        """Return the heading of a result's table."""
        unit = unit_of(name)
        return f"{name}{f', {unit}' if unit else ''}: each model in place of the scene's own"

    def rows(self) -> list[dict[str, Any]]:
        """Return a row for each result, model and place, for files."""
        by = {(v.model, v.result.name): v for some in self.verdicts.values() for v in some}
        numbers = {name: k for k, name in enumerate(self.models, start=1)}
        rows = []
        for change in self.changes:
            verdict, d = by[change.model, change.result.name], change.difference
            per_run, _ = self.turn_times.run_cpu_ms_and_spread(numbers[change.model])
            cost, spread = self.costs[change.model]
            rows.append(
                {
                    "result": change.result.name, "model": change.model,
                    "where": self._location_text(change) or None,
                    "as_it_is": _finite_or_none(change.own.value),
                    "as_it_is_low": _finite_or_none(change.own.low),
                    "as_it_is_high": _finite_or_none(change.own.high),
                    "change": _finite_or_none(d.value), "low": _finite_or_none(d.low),
                    "high": _finite_or_none(d.high),
                    "limit": _finite_or_none(
                        self.limits[change.result.name].absolute_limit(change.own.value)
                    ),
                    "few": d.few, "pairs": d.count, "runs": change.runs,
                    "differing": change.differing, "lost": change.lost, "gained": change.gained,
                    "neither": change.neither, "cut_off": change.cut_off,
                    "cpu_ms_per_run": _finite_or_none(per_run), "cpu_of_own": _finite_or_none(cost),
                    "cpu_of_own_spread": _finite_or_none(spread), "verdict": verdict.kind,
                    "front": verdict.on_front, "wanted": _finite_or_none(verdict.wanted),
                    "reason": change.reason or None,
                }
            )  # fmt: skip
        there = {(row["model"], row["result"]) for row in rows}
        rows += [
            {"result": name, "model": verdict.model, "verdict": verdict.kind,
             "reason": verdict.reason}
            for name, some in self.verdicts.items() for verdict in some
            if (verdict.model, name) not in there
        ]  # fmt: skip
        return rows

    # -- the sentences ------------------------------------------------------------------------

    def conclusion_sentences(self, name: str) -> list[str]:
        """Return the conclusions of a result's table, the decision first."""
        some = self.verdicts[name]
        result = next(one for one in self.results if one.name == name)
        lines = [self._result_text(result)]
        taken = sorted(
            (v for v in some if v.is_same_or_within_limit),
            key=lambda v: self._cost_or_infinity(v.model),
        )
        limit = self._limit_text(name)
        sure = f"{100 * self.confidence:g} %"
        if taken:
            lines.append(f"May be taken without changing it by more than {limit}, {sure} sure of "
                         f"all, each alone: {len(taken)} of {len(some)} models.")  # fmt: skip
        else:
            lines.append(f"No model is surely within {limit}.")
        lines.append(self._cheapest_model_text(taken))
        lines += self._sentence_on_verdict_kind(
            taken, WITHIN, "Within it:", self._within_limit_text
        )
        lines += self._sentence_on_verdict_kind(
            taken, SAME, self._explain_sameness(taken), self._cost_text
        )
        lines += self._sentence_on_verdict_kind(some, BEYOND,
        f"Surely changed by more than {limit}, or no longer "
                               "there:", self._beyond_limit_text)  # fmt: skip
        lines += self._sentence_on_verdict_kind(
            some, OPEN, f"Not told by so many {self.unit}:", self._undecided_text
        )
        lines += self._sentence_on_verdict_kind(
            some, NOTHING, "Not compared:", lambda verdict: verdict.reason
        )
        return [line for line in lines if line]

    def _result_text(self, result: Result) -> str:
        owns = {c.at: c for c in self.changes if c.result.name == result.name}
        if not owns:
            return f"{result.name}: no model has runs to compare."
        texts = []
        for at, change in owns.items():
            value, interval = rounded_value_and_interval(change.own)
            where = f" where {self._location_text(change)}" if at else ""
            texts.append(f"{value} ({interval.rstrip(' *') or 'no interval'}){where}")
        shown = texts if len(texts) <= _MOST_NAMED else [*texts[:_MOST_NAMED], "..."]
        many = max(change.own.count for change in owns.values())
        unit = unit_of(result.name)
        return (
            f"With the scene as it is {result.name}{f', {unit},' if unit else ''} is "
            f"{'; '.join(shown)}, of {many:,} {self.unit}."
        )

    def _limit_text(self, name: str) -> str:
        limit, unit = self.limits[name], unit_of(name)
        if not limit.is_share:
            return f"{short_text(limit.amount)} {unit}".strip()
        text = f"{100 * limit.amount:g} %"
        amounts = {limit.absolute_limit(c.own.value) for c in self.changes if c.result.name == name}
        known = sorted(amount for amount in amounts if amount == amount)
        if not known:
            return text
        ends = dict.fromkeys(_format_three_digits(amount) for amount in (known[0], known[-1]))
        return f"{text} of it ({' to '.join(ends)}{f' {unit}' if unit else ''})"

    def _cost_or_infinity(self, model: str) -> float:
        cost = self.costs[model][0]
        return cost if cost == cost else math.inf

    def _cost_text(self, verdict: ModelVerdict) -> str:
        return f"{self._cost_or_infinity(verdict.model):.2g} of the CPU"

    def _within_limit_text(self, verdict: ModelVerdict) -> str:
        assert verdict.change is not None
        return f"{format_change(verdict.change)}, {self._cost_text(verdict)}"

    def _explain_sameness(self, taken: Sequence[ModelVerdict]) -> str:
        """Return text that opens the sentence on models whose runs were all the same: how many
        runs, and how rarely a run could still differ.
        """
        runs = min((v.change.runs for v in taken if v.kind == SAME and v.change), default=0)
        least = -runs / math.log((1.0 - self.confidence) / max(1, self.comparisons))
        rare = f" (as sure: at most 1 in {math.floor(least):,} would differ)"
        return f"The same in every run, each of {runs:,} here{rare if least >= 2.0 else ''}:"

    def _cheapest_model_text(self, taken: Sequence[ModelVerdict]) -> str:
        if not taken:
            return ""
        cheapest = taken[0]
        cost, spread = self.costs[cheapest.model]
        front = [v for v in self.verdicts[cheapest.result.name] if v.on_front]
        front.sort(key=lambda verdict: self._cost_or_infinity(verdict.model))
        named = "; ".join(f"{v.model} ({self._cost_and_bound_text(v)})" for v in front)
        its = f" Front, cheapest first: {named}; as it is." if front else ""
        if cost + spread < 1.0 / 1.1:
            return f"The cheapest is {cheapest.model}, at {cost:.2g} of the scene's CPU.{its}"
        return f"None of them surely saves a tenth of the CPU.{its}"

    def _cost_and_bound_text(self, verdict: ModelVerdict) -> str:
        """Return text with a model's CPU cost relative to the scene's own and the largest change of
        the result that the intervals leave possible.
        """
        unit = unit_of(verdict.result.name)
        mine = [c.largest_possible_change for c in self.changes
                if (c.model, c.result.name) == (verdict.model, verdict.result.name)]  # fmt: skip
        most = _format_three_digits(max(mine))
        return f"{self._cost_or_infinity(verdict.model):.2g}, at most {most} {unit}".rstrip()

    def _sentence_on_verdict_kind(
        self, some: Sequence[ModelVerdict], kind: str, words: str, text: Any
    ) -> list[str]:
        models: dict[str, list[str]] = {}
        for verdict in some:
            if verdict.kind == kind:
                models.setdefault(text(verdict), []).append(verdict.model)
        named = "; ".join(f"{', '.join(those)} ({said})" for said, those in models.items())
        return [f"{words} {named}."] if models else []

    def _beyond_limit_text(self, verdict: ModelVerdict) -> str:
        change = verdict.change
        assert change is not None
        parts = (
            [format_change(change)] if change.difference.value == change.difference.value else []
        )
        if change.presence is not None:
            parts.append(_lost_and_gained_values_text(change))
        where = self._location_text(change)
        return ", ".join(parts) + (f" where {where}" if where else "")

    def _undecided_text(self, verdict: ModelVerdict) -> str:
        change, wanted = verdict.change, verdict.wanted
        assert change is not None
        parts = [
            format_change(change) + (" where " + self._location_text(change) if change.at else "")
        ]
        if change.has_only_identical_runs:
            parts[0] = f"the same in all {change.runs:,} runs, which leaves {parts[0]}"
        if change.presence is not None:
            parts.append(_lost_and_gained_values_text(change))
        if change.difference.few:
            parts.append("too few events or values to rely on")
        if change.cut_off:
            parts.append(
                f"{change.cut_off:,} of {change.runs:,} cut off where the run begins or ends"
            )
        if wanted == math.inf:
            parts.append(f"no such number of {self.unit} is foreseen to tell")
        elif wanted == wanted:
            parts.append(f"some {wanted:,.0f} {self.unit} would")
        return ", ".join(parts)

    def notes_on_tables(self) -> list[str]:
        """Return the lines below all tables: on intervals, CPU time and models not compared."""
        each = 100 * confidence_per_interval(self.confidence, self.comparisons)
        turns = len({turn for turn, _ in self.turn_times.cpu_s})
        lines = [
            f"All intervals hold together, {100 * self.confidence:g} % sure: each of the "
            f"{self.comparisons:,} is a paired difference on the same seeds, draws and encounters, "
            f"at {each:.4g} % (Bonferroni). Each model stands alone for the scene's own: two of "
            "them together were not run.",
            "CPU: by that of the scene as it is in the same turn, median of "
            f"{turns:,} turn{'s' * (turns > 1)} ± half the distance between the quartiles. Front: "
            "no other is both as cheap and surely as near.",
        ]
        if self.own:
            lines.append(f"The scene as it is: {', '.join(self.own)}.")
        whys: dict[str, list[str]] = {}
        for name, why in self.unavailable:
            whys.setdefault(why, []).append(name)
        lines += [f"Not available here: {', '.join(them)} ({why})." for why, them in whys.items()]
        lines += [f"Note: {note}." for note in self.notes]
        return lines


def _lost_and_gained_values_text(change: PairedChange) -> str:
    """Return how many runs lose their value, or come to have one: they are in no difference."""
    parts = [f"{many:,} of {change.runs:,} {words}" for many, words in (
        (change.lost, "have no value with it"), (change.gained, "have a value only with it"))
        if many]  # fmt: skip
    return " and ".join(parts)


def _change_notes(change: PairedChange) -> str:
    parts = [_lost_and_gained_values_text(change)] if change.lost or change.gained else []
    if change.neither and change.result.kind == NUMBER:
        parts.append(f"{change.neither:,} without a value with either")
    if change.cut_off:
        parts.append(f"{change.cut_off:,} cut off by the run, which may hide more")
    return "".join(f"; {part}" for part in parts)


def _format_plus_minus(value: float, spread: float) -> str:
    if value != value:
        return ""
    return (
        " ± ".join(texts_rounded_to_interval(spread, value, spread))
        if spread > 0.0
        else f"{value:.2g}"
    )


def _format_three_digits(value: float) -> str:
    """Return three digits of a number, without a power of ten."""
    return f"{float(f'{value:.3g}'):,.10g}"


def _finite_or_none(value: float) -> float | None:
    return None if math.isnan(value) or math.isinf(value) else value


def print_report(report: AnswerReport) -> None:
    """Print the tables and sentences on the terminal."""
    console = terminal.console(160)
    for result in report.results:
        console.print()
        rows = list(report.table_rows(result.name))
        last = len(HEADS) - 1
        print_table(
            console, report.table_heading(result.name), HEADS, rows, below=last, right=(1, 2, 3)
        )
        console.print()
        for line in report.conclusion_sentences(result.name):
            console.print(escape_unprintable(line), markup=False, highlight=False)
    console.print()
    for line in report.notes_on_tables():
        console.print(escape_unprintable(line), markup=False, highlight=False)
