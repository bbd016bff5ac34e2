"""How two conditions differ on the same units: of means, shares, quantiles and ratios."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from dsa_des.arrays.types import AnyArray, BoolArray, FloatArray, IntArray
from dsa_des.results.ratio import PairedRatio, error_share_of_encounters, paired_ratio
from dsa_des.results.statistics import (
    FEW,
    Estimate,
    clip_estimate,
    estimate_from_standard_error,
    estimate_mean,
    estimate_quantile,
    scale_by_power_of_two,
    standard_error,
    standard_error_from_interval,
    two_sided_normal_quantile,
    two_sided_t_quantile,
    unseen_event_mean_and_square,
)

_RESAMPLES = 1000
#: Of the largest of some values: a smaller difference is one of rounding.
_ALIKE = 1e-9


def second_minus_first_without_rounding(first: FloatArray, second: FloatArray) -> FloatArray:
    """Return second minus first by element, 0 where they differ by no more than rounding.

    That is, within 1e-9 of the largest of them: a quantity is never known so well, and rounding
    adds up to far less.
    """
    changes = second - first
    both = np.abs(np.concatenate([first, second]))
    finite = both[np.isfinite(both)]
    resolution = _ALIKE * float(finite.max(initial=0.0))
    return np.where(np.abs(changes) <= resolution, 0.0, changes)


def paired_unit_means(
    units: IntArray, first: FloatArray, second: FloatArray
) -> tuple[IntArray, FloatArray, FloatArray]:
    """Return (units, means of `first`, means of `second`) per unit over the runs that have both.

    Of a unit without such a run one condition keeps its mean, and the other has no value: runs
    with a value on one side only would compare other draws.

    A run without a value has NaN.
    """
    result, index = np.unique(units, return_inverse=True)

    def means(values: FloatArray, used: AnyArray) -> FloatArray:
        many = np.bincount(index[used], minlength=len(result))
        total = np.bincount(index[used], weights=values[used], minlength=len(result))
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.where(many > 0, total / many, np.nan)

    here, there = ~np.isnan(first), ~np.isnan(second)
    one, two = means(first, here & there), means(second, here & there)
    without = np.isnan(one)
    alone = np.where(without, means(first, here), np.nan)
    one = np.where(without, alone, one)
    two = np.where(without & np.isnan(alone), means(second, there), two)
    return result, one, two


@dataclass(frozen=True)
class EstimatedDifference:
    """Paired and unpaired estimates of a result's difference by condition on the same units."""

    #: Mean of the differences, unit by unit.
    paired: Estimate
    #: The same mean with the interval it would have on independent units (Welch).
    unpaired: Estimate
    #: Units that have a value in one condition only; they are in neither estimate.
    only_first: int
    only_second: int

    @property
    def narrowing_factor(self) -> float:
        """How many times narrower the paired interval is; infinite where nothing differs."""
        if self.paired.half_width == 0.0:
            return math.inf if self.unpaired.half_width > 0.0 else math.nan
        return self.unpaired.half_width / self.paired.half_width


def estimate_difference(
    first: FloatArray,
    second: FloatArray,
    confidence: float,
    method: str = "t",
    *,
    kind: str = "number",
) -> EstimatedDifference:
    """Return mean second minus first over units with both, with paired and unpaired intervals.

    NaN is a unit without a value. Of all kinds but numbers no interval reaches beyond -1 and 1.
    Events, and shares of which each unit has all or nothing, are counted: their paired interval is
    that of Bonett and Price, "Adjusted Wald confidence interval for a difference of binomial
    proportions based on paired data", Journal of Educational and Behavioral Statistics 37 (2012);
    the unpaired one is that of Agresti and Caffo, "Simple and effective confidence intervals for
    proportions and differences of proportions", The American Statistician 54 (2000). Neither is a
    point where no unit differs.
    """
    here, there = ~np.isnan(first), ~np.isnan(second)
    both = here & there
    changes = second_minus_first_without_rounding(first[both], second[both])
    whole = kind == "share" and bool(np.isin(changes, (-1.0, 0.0, 1.0)).all())
    counted = len(changes) > 1 and (kind == "event" or whole)
    paired = (
        _bonett_price_difference(changes, confidence)
        if counted
        else estimate_mean(changes, confidence, method)
    )
    apart = counted and bool(np.isin((first[both], second[both]), (0.0, 1.0)).all())
    if apart:
        unpaired = _agresti_caffo_difference(first[both], second[both], confidence)
    else:
        unpaired = _welch_difference(first[both], changes, confidence)
    if kind != "number":
        paired, unpaired = _clip_share_difference(paired), _clip_share_difference(unpaired)
    return EstimatedDifference(
        paired,
        unpaired,
        int((here & ~there).sum()),
        int((there & ~here).sum()),
    )


def quantile_difference(
    first: FloatArray, second: FloatArray, share: float, confidence: float
) -> EstimatedDifference:
    """Return the quantile `share` of `second` minus that of `first` over units that have both, with
    a paired and an unpaired interval.

    The interval is the normal distribution's with the spread of 1000 resamples of the units, always
    the same ones, each with its values under both conditions (Efron and Tibshirani, chapter 8.6).
    NaN is a unit without a value. Where a quantile has no interval of its own, this has none.
    """
    here, there = ~np.isnan(first), ~np.isnan(second)
    one, two = first[here & there], second[here & there]
    alone = int((here & ~there).sum()), int((there & ~here).sum())
    ends = [estimate_quantile(values, share, confidence) for values in (one, two)]
    value = ends[1].value - ends[0].value
    if any(end.few for end in ends):
        none = Estimate(value, math.nan, math.nan, len(one), True)
        return EstimatedDifference(none, none, *alone)
    index = max(0, math.ceil(share * len(one) - 1e-9) - 1)
    generator = np.random.Generator(np.random.Philox(len(one)))
    drawn = np.empty(_RESAMPLES)
    for k in range(len(drawn)):
        units = generator.integers(0, len(one), len(one))
        low, high = (np.partition(values[units], index)[index] for values in (one, two))
        drawn[k] = high - low
    apart = math.hypot(*(standard_error_from_interval(end, confidence) for end in ends))
    return EstimatedDifference(
        estimate_from_standard_error(value, float(drawn.std(ddof=1)), len(one), False, confidence),
        estimate_from_standard_error(value, apart, len(one), False, confidence),
        *alone,
    )


def _clip_share_difference(result: Estimate) -> Estimate:
    """Return the estimate, its interval cut to [-1, 1], the range of a difference of shares."""
    return clip_estimate(result, -1.0, 1.0)


def _bonett_price_difference(changes: FloatArray, confidence: float) -> Estimate:
    """Return the mean paired change with Bonett and Price's interval: a gain and a loss are added.

    Units of several runs differ by parts of an event: there the two lie the smallest part that is
    seen to either side of the mean.
    """
    count = len(changes)
    value = math.fsum(changes) / count
    sizes = np.abs(changes)
    step = float(sizes[sizes > 1e-9].min(initial=1.0))
    about = 0.0 if step == 1.0 else value
    more = np.append(changes, [about - step, about + step])
    middle = math.fsum(more) / len(more)
    error = math.sqrt(math.fsum((more - middle) ** 2)) / len(more)
    half = two_sided_t_quantile(count - 1, confidence) * error
    return Estimate(value, middle - half, middle + half, count, count < FEW)


def _agresti_caffo_difference(first: FloatArray, second: FloatArray, confidence: float) -> Estimate:
    """Return the share in `second` minus that in `first` with Agresti and Caffo's interval: one
    success and one failure are added to each.
    """
    count = len(first)
    one, other = ((result.sum() + 1.0) / (count + 2.0) for result in (first, second))
    error = math.sqrt((one * (1.0 - one) + other * (1.0 - other)) / (count + 2.0))
    half = two_sided_normal_quantile(confidence) * error
    value, middle = float(second.mean() - first.mean()), float(other - one)
    return Estimate(value, middle - half, middle + half, count, count < FEW)


def _welch_difference(first: FloatArray, changes: FloatArray, confidence: float) -> Estimate:
    count = len(first)
    if count < 2:
        return Estimate(math.nan, math.nan, math.nan, count, True)
    value = estimate_mean(changes, confidence).value
    errors, exponent = scale_by_power_of_two(
        np.array([standard_error(first), standard_error(first + changes)])
    )
    one, other = (errors**2).tolist()
    if one + other == 0.0:
        return Estimate(value, value, value, count, count < FEW)
    degrees = (one + other) ** 2 * (count - 1) / (one**2 + other**2)
    half = two_sided_t_quantile(degrees, confidence) * math.ldexp(math.sqrt(one + other), exponent)
    return Estimate(value, value - half, value + half, count, count < FEW)


class RatioTerms(NamedTuple):
    """The columns that a ratio of weighted events is computed from, one entry per run."""

    below: FloatArray
    above: FloatArray
    weight: FloatArray
    #: What hangs together.
    cluster: AnyArray
    #: For how many runs each one stands; None where all are flown.
    stands_for: FloatArray | None
    #: What each was predicted before it was flown; None where nothing is.
    predicted: FloatArray | None = None

    def select_runs(self, some: IntArray | BoolArray) -> "RatioTerms":
        """Return the terms of only the given runs (indices or mask)."""
        columns: list[Any] = [None if column is None else column[some] for column in self]
        return RatioTerms(*columns)


def ratio_difference(
    first: RatioTerms, second: RatioTerms, alone: Sequence[int], confidence: float
) -> EstimatedDifference:
    """Return second ratio minus first on the same runs, with paired and unpaired intervals.

    What each run adds to the error of either ratio is subtracted run by run, so what they share
    falls out; the interval is that of the normal distribution. Its variance holds one run more that
    gains the event and one that loses it, of the weight of those below the line: as Bonett and
    Price do for events without weights (`estimate_difference`), so that runs which all agree still
    leave as much open as so many can. `alone` says how many runs only one condition has.
    """
    parts, ratios = [], []
    for below, above, weight, _, some, predicted in (first, second):
        ratio = paired_ratio(
            below, above, weight, cluster=first.cluster, stands_for=some, predicted=predicted,
            confidence=confidence, method="delta",
        )  # fmt: skip
        ratios.append(ratio)
        if not ratio.reason:
            parts.append(
                error_share_of_encounters(below, above, weight, ratio.ratio, some, predicted)
            )
    if len(parts) < 2:
        none = Estimate(np.nan, np.nan, np.nan, 0, True)
        return EstimatedDifference(none, none, *alone)
    _, index = np.unique(first.cluster, return_inverse=True)
    each = np.array([np.bincount(index, weights=part) for part in parts])
    value, few = ratios[1].ratio - ratios[0].ratio, any(ratio.few for ratio in ratios)
    events = np.bincount(index, weights=second.weight * second.below).astype(float)
    more = 2.0 * _variance_of_unseen_event(events)
    joint = float(np.sqrt(((each[1] - each[0]) ** 2).sum() + more))
    # A ratio whose runs all agree has no such error; its interval tells another.
    alike = sum(
        standard_error_from_interval(ratio_as_estimate(ratio), confidence) ** 2
        for ratio, part in zip(ratios, each, strict=True)
        if np.abs(part).max() < 1e-12
    )
    apart = float(np.sqrt((each**2).sum() + alike + more))
    return EstimatedDifference(
        estimate_from_standard_error(value, joint, each.shape[1], few, confidence),
        estimate_from_standard_error(value, apart, each.shape[1], few, confidence),
        *alone,
    )


def _variance_of_unseen_event(nominal: FloatArray) -> float:
    """Return how much one event more, or less, than were seen adds to the variance of a ratio.

    `nominal` are the clusters' terms below the line; one event more weighs what those do, drawn in
    proportion to their weights.
    """
    part, _ = scale_by_power_of_two(nominal)
    return unseen_event_mean_and_square(part)[1] / math.fsum(part) ** 2


def ratio_as_estimate(ratio: PairedRatio) -> Estimate:
    """Return the ratio, its interval and its number of clusters as an `Estimate`."""
    return Estimate(ratio.ratio, *ratio.interval, ratio.clusters, ratio.few)
