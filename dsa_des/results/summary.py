"""From the rows of a study to its tables: estimates, paired differences, cheapest values."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from dsa_des.arrays.types import IntArray
from dsa_des.results.differences import EstimatedDifference, ratio_as_estimate
from dsa_des.results.ratio import PairedRatio, paired_ratio
from dsa_des.results.record import (
    EVENT,
    RATIO,
    Requirement,
    Result,
)
from dsa_des.results.rows import Rows
from dsa_des.results.statistics import Estimate, clip_estimate


@dataclass(frozen=True)
class Line:
    """The estimate of one result at one combination of the axis values of a summary."""

    at: tuple[Any, ...]
    result: Result
    estimate: Estimate
    missing: int
    expected: float | None
    #: Runs of this combination, and (where, how many) of those whose value the run cut off.
    runs: int = 0
    cut_off: tuple[tuple[str, int], ...] = ()
    #: Of a ratio: all its numbers, by the study's own kind of interval and by the other.
    ratio: PairedRatio | None = None
    other: PairedRatio | None = None


def summarise(
    rows: Rows,
    results: Sequence[Result],
    confidence: float,
    method: str,
    expected: Mapping[tuple[str, tuple[Any, ...]], float],
) -> list[Line]:
    """Return lines with estimates of all summarised results per combination of axis values."""
    lines = []
    for at, chosen in rows.row_indices_by_axis_values():
        for result in results:
            if not result.is_summarised:
                continue
            ratio = other = None
            if result.kind == RATIO:
                ratio, missing = rows.ratio(result, chosen, confidence, method)
                estimate = ratio_as_estimate(ratio)
                # Drawing sets again takes a while; of classes it is done only where it is asked.
                if method == "bootstrap":
                    other, _ = rows.ratio(result, chosen, confidence, "t")
                elif result.ratio is not None and result.ratio.only is None:
                    other, _ = rows.ratio(result, chosen, confidence, "bootstrap")
            else:
                estimate, missing = rows.estimate(result, chosen, confidence, method)
                estimate = clip_estimate(estimate, result.least, result.most)
            known = expected.get((result.name, at))
            cut_off = rows.cut_off_counts(result, chosen)
            lines.append(
                Line(at, result, estimate, missing, known, len(chosen), cut_off, ratio, other)
            )
    return lines


@dataclass(frozen=True)
class Compared:
    """The difference of a result between one value of the compared axis and its baseline."""

    at: tuple[Any, ...]
    value: Any
    baseline: Any
    result: Result
    difference: EstimatedDifference
    #: Of an event: how often it happens, by how often at the baseline.
    ratio: PairedRatio | None = None


def compare_axis(
    rows: Rows, axis: str, baseline: Any, results: Sequence[Result], confidence: float,
    method: str, weight: str | None = None,
) -> list[Compared]:  # fmt: skip
    """Return paired differences of results between each other value of an axis and its baseline.

    Rows are paired that share the unit and the values of all other axes. `weight` names the result
    that weighs units in ratios of events.
    """
    compared = []
    for value, others, base, chosen in rows.comparisons_with_baseline(axis, baseline):
        for result in results:
            if not result.is_summarised or result.quantile is not None:
                continue  # paired differences are of means
            if result.kind != RATIO and rows.is_missing_unless_flown(result.name):
                continue  # other runs were flown here than there
            change = rows.difference(result, base, chosen, confidence, method)
            ratio = None
            if result.kind == EVENT:
                ratio = _event_frequency_ratio(rows, result.name, base, chosen, weight, confidence)
            compared.append(Compared(others, value, baseline, result, change, ratio))
    return compared


def _event_frequency_ratio(
    rows: Rows, name: str, first: IntArray, second: IntArray, weight: str | None, confidence: float
) -> PairedRatio:
    """Return an event's frequency in rows `second` over that in rows `first`, over runs of both.

    Rows `first` are below the line, `second` above; runs that only one has do not count. The
    result `weight` says how often each unit happens.
    """
    sides = []
    for side in (first, second):
        known = ~np.isnan(rows.column(name)[side].astype(float))
        if weight is not None:
            known &= ~np.isnan(rows.column(weight)[side].astype(float))
        sides.append(side[known])
    below, above = rows.pair_rows_by_run(*sides)
    weights = None if weight is None else rows.column(weight)[below].astype(float)
    return paired_ratio(
        rows.column(name)[below].astype(float), rows.column(name)[above].astype(float),
        weights, cluster=rows.units[below], confidence=confidence,
    )  # fmt: skip


@dataclass(frozen=True)
class Answer:
    """The cheapest value that meets a requirement at one combination of the other axes' values."""

    requirement: Requirement
    #: Values of the other axes.
    at: tuple[Any, ...]
    #: Cheapest value whose interval, and that of all dearer ones, meets the limit; None if none.
    value: Any
    #: The same by the estimates alone, which is sure of nothing.
    estimated: Any
    #: The summary's line at `value`, or at the dearest value where none meets it.
    line: Line
    #: Whether a cheaper value meets the limit though a dearer one does not: more runs would tell.
    uneven: bool


def cheapest_values(
    requirement: Requirement, axes: Sequence[str], lines: Sequence[Line]
) -> list[Answer]:
    """Return the cheapest value that meets the requirement, by combination of the other axes."""
    if requirement.axis not in axes:
        return []
    index = list(axes).index(requirement.axis)
    by_others: dict[tuple[Any, ...], list[Line]] = {}
    for line in lines:
        if line.result.name == requirement.metric:
            others = (*line.at[:index], *line.at[index + 1 :])
            by_others.setdefault(others, []).append(line)
    sentences = []
    for at, some in by_others.items():
        dearest_first = some if requirement.cheap_last else some[::-1]
        sure = [
            not line.estimate.few and requirement.is_met(line.estimate.low, line.estimate.high)
            for line in dearest_first
        ]
        likely = [
            requirement.is_met(line.estimate.value, line.estimate.value) for line in dearest_first
        ]
        last, guess = _count_leading(sure), _count_leading(likely)
        sentences.append(
            Answer(
                requirement, at,
                dearest_first[last - 1].at[index] if last else None,
                dearest_first[guess - 1].at[index] if guess else None,
                dearest_first[max(last - 1, 0)],
                any(sure[last:]),
            )
        )  # fmt: skip
    return sentences


def _count_leading(good: Sequence[bool]) -> int:
    """Return the number of leading values that are true."""
    return next((k for k, one in enumerate(good) if not one), len(good))


def one_sided_confidence(confidence: float) -> float:
    """Return the confidence of one end alone of a two-sided interval: 0.975 for 0.95."""
    return 0.5 + confidence / 2.0


def numbers_by_series_result(metric: str, names: Iterable[str]) -> dict[str, float]:
    """Return result name → its number, ascending, for ``METRIC.5``, ``METRIC.10`` ..."""
    numbers = {}
    for name in names:
        number = name.removeprefix(f"{metric}.")
        if number == name:
            continue
        try:
            numbers[name] = float(number)
        except ValueError:
            continue
    return dict(sorted(numbers.items(), key=lambda item: item[1]))
