"""By how much each model changes a study's results: paired differences, and what cannot be paired.

All intervals hold together: each is one of 1 - (1 - confidence) / comparisons (Bonferroni's
inequality, which asks nothing of how the comparisons hang together). How many there are is known
before the runs.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from dsa_des.answers.alternatives import AS_IT_IS, COLUMN
from dsa_des.arrays.types import AnyArray, IntArray
from dsa_des.results.differences import EstimatedDifference, estimate_difference
from dsa_des.results.record import EVENT, RATIO, SHARE, TRIALS, Result
from dsa_des.results.rows import Rows
from dsa_des.results.statistics import Estimate

#: Events that a ratio without a word of caution rests on, on either side.
FEW_EVENTS = 20


@dataclass(frozen=True)
class PairedChange:
    """By how much one model changes one result, at one place of the study's own axes."""

    model: str
    result: Result
    at: tuple[Any, ...]
    #: Of the scene as it is, at the study's own confidence.
    own: Estimate
    #: The paired difference, at the confidence of one of all comparisons.
    difference: Estimate
    #: Pairs of runs, and those of them whose results are not equal.
    runs: int
    differing: int
    #: Units that have a value with the scene's own model only, or with this one only.
    lost: int
    gained: int
    #: Pairs of runs without a value on either side.
    neither: int
    #: Pairs of runs of which one value or both lie where the run began or ended.
    cut_off: int
    #: Where some are lost or gained: by how much the share of units with a value changes.
    presence: Estimate | None
    #: Events that a ratio rests on where they are too few; infinite elsewhere.
    events: float = math.inf
    #: Why there is no difference; empty where there is one.
    reason: str = ""

    @property
    def has_only_identical_runs(self) -> bool:
        """Whether every run gave the same to the last bit."""
        return self.runs > 0 and self.differing == 0

    @property
    def half_width(self) -> float:
        """The larger distance from the estimate to an end of its confidence interval."""
        low, value, high = self.difference.low, self.difference.value, self.difference.high
        return max(high - value, value - low)

    @property
    def largest_possible_change(self) -> float:
        """Largest absolute change in the interval; NaN if runs lack or cut values, or are few."""
        if self.reason or self.lost or self.gained or self.cut_off or self.difference.few:
            return math.nan
        return max(abs(self.difference.low), abs(self.difference.high))


def confidence_per_interval(confidence: float, comparisons: int) -> float:
    """Return the confidence each of `comparisons` intervals needs for `confidence` (Bonferroni)."""
    return 1.0 - (1.0 - confidence) / max(1, comparisons)


def changes_by_model(
    rows: Rows, results: Sequence[Result], confidence: float, method: str, comparisons: int
) -> list[PairedChange]:
    """Return each result's paired change by model, per axis combination where both have runs."""
    each = confidence_per_interval(confidence, comparisons)
    owns: dict[tuple[str, tuple[Any, ...]], Estimate] = {}
    changes = []
    for model, at, base, chosen in rows.comparisons_with_baseline(COLUMN, AS_IT_IS):
        for result in results:
            key = result.name, at
            if key not in owns:
                owns[key] = rows.estimate(result, base, confidence, method)[0]
            changes.append(
                _estimate_change(rows, result, str(model), at, owns[key], (base, chosen), each)
            )
    return changes


def _estimate_change(
    rows: Rows, result: Result, model: str, at: tuple[Any, ...], own: Estimate,
    sides: tuple[IntArray, IntArray], confidence: float,
) -> PairedChange:  # fmt: skip
    pair = rows.pair_rows_by_run(*sides)
    runs = len(pair[0])
    differing = np.zeros(runs, dtype=bool)
    for one, other in _paired_columns(rows, result, pair):
        differing |= ~(
            (one == other) | (_mask_of_missing_values(one) & _mask_of_missing_values(other))
        )
    cut_off, neither = np.zeros(runs, dtype=bool), 0
    if result.kind != RATIO:
        missing = [_mask_of_missing_values(rows.column(result.name)[side]) for side in pair]
        neither = int((missing[0] & missing[1]).sum())
        if result.cut_off is not None:  # of what never comes nothing was cut off: it is lost
            for side, without in zip(pair, missing, strict=True):
                cut_off |= ~_mask_of_missing_values(rows.column(result.cut_off)[side]) & ~without
    found, reason, events = _difference_and_ratio_problems(rows, result, pair, confidence)
    if not reason and math.isnan(found.paired.value):
        reason = "no run has a value with both"
    elif not reason and found.paired.count < 2:
        reason = "one run cannot tell how much others would differ"
    elif not reason and math.isnan(found.paired.low):
        reason = f"{found.paired.count} runs are too few for an interval"
    presence = None
    if result.kind != RATIO and (found.only_first or found.only_second):
        _, first, second = rows.paired_means_by_unit(result.name, *pair)
        has = [(~np.isnan(values)).astype(float) for values in (first, second)]
        presence = estimate_difference(has[0], has[1], confidence, kind=EVENT).paired
    return PairedChange(
        model, result, at, own, found.paired, runs, int(differing.sum()),
        found.only_first, found.only_second, neither, int(cut_off.sum()), presence,
        events, reason,
    )  # fmt: skip


def _difference_and_ratio_problems(
    rows: Rows, result: Result, pair: tuple[IntArray, IntArray], confidence: float
) -> tuple[EstimatedDifference, str, float]:
    """Return the paired difference, the reason why a risk ratio cannot be computed (else empty),
    and the number of events if these are too few (else infinity).
    """
    # Student's t also where the study's own means are bootstrapped: so many comparisons ask for
    # ends farther out than its resamples reach.
    found = rows.difference(result, *pair, confidence, "t")
    if result.kind != RATIO:
        return found, "", math.inf
    ratios = [rows.ratio(result, side, confidence, "t")[0] for side in pair]
    events = min(ratio.mitigated_events for ratio in ratios)
    few = float(events) if found.paired.few else math.inf
    return found, next((ratio.reason for ratio in ratios if ratio.reason), ""), few


def _paired_columns(
    rows: Rows, result: Result, pair: tuple[IntArray, IntArray]
) -> Iterator[tuple[AnyArray, AnyArray]]:
    """Yield each column a result needs: its values in the first and second run of every pair."""
    names: tuple[str, ...] = (result.name,)
    if result.ratio is not None:
        names = result.ratio.columns_read()
    elif result.kind == SHARE:
        names = result.name, result.name + TRIALS
    for name in names:
        values = rows.column(name)
        yield values[pair[0]], values[pair[1]]


def _mask_of_missing_values(values: AnyArray) -> AnyArray:
    """Return whether each is a missing number or a missing text."""
    if values.dtype == object:
        return np.array([value is None for value in values.tolist()], dtype=bool)
    missing: AnyArray = np.isnan(values.astype(float))
    return missing
