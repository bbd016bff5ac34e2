"""Confidence intervals: Wilson for shares, t or bootstrap for means, gamma for ratios of counts."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from statistics import NormalDist

import numpy as np

from dsa_des.arrays.types import FloatArray, IntArray

#: Below this many values (effective trials, for a share) an interval says little.
FEW = 10
#: Below this many units with a trial that went otherwise than most, an interval of a share of
#: trials that hang together says little.
FEW_UNLIKE = 5
_RESAMPLES = 2000
# Counts of drawn units that are in memory at once.
_AT_ONCE = 2_000_000
#: No interval of a logarithm is wider.
_MOST_LOG = 700.0


@dataclass(frozen=True)
class Estimate:
    """A mean, share, quantile or other estimate with its interval."""

    #: NaN where there are too few values to say.
    value: float
    low: float
    high: float
    #: Values it rests on.
    count: int
    #: Whether those are too few to rely on the interval.
    few: bool

    @property
    def half_width(self) -> float:
        """Half of the interval's width."""
        return (self.high - self.low) / 2.0


def clip_estimate(result: Estimate, least: float | None, most: float | None) -> Estimate:
    """Return the estimate with its interval cut to the possible values, `least` to `most`."""
    low = result.low if least is None else max(least, result.low)
    high = result.high if most is None else min(most, result.high)
    # A NaN is kept: the comparison with it is false.
    return replace(result, low=low, high=high) if result.low <= result.high else result


def wilson_interval(successes: float, trials: float, confidence: float) -> tuple[float, float]:
    """Return (low, high) of Wilson's score interval for a share.

    Trials may be an effective number, and need not be whole.

    Notes
    -----
    Wilson, "Probable inference, the law of succession, and statistical inference", JASA 22 (1927).
    """
    if trials <= 0:
        return math.nan, math.nan
    z = two_sided_normal_quantile(confidence)
    share = successes / trials
    middle = (share + z * z / (2.0 * trials)) / (1.0 + z * z / trials)
    spread = share * (1.0 - share) / trials + z * z / (4.0 * trials * trials)
    half = z / (1.0 + z * z / trials) * math.sqrt(max(spread, 0.0))
    low = 0.0 if successes == 0 else max(0.0, middle - half)
    high = 1.0 if successes == trials else min(1.0, middle + half)
    return low, high


def two_sided_normal_quantile(confidence: float) -> float:
    """Return the central normal interval's half-width in standard deviations: 1.96 for 0.95."""
    return NormalDist().inv_cdf(0.5 + confidence / 2.0)


def estimate_share(successes: FloatArray, trials: FloatArray, confidence: float) -> Estimate:
    """Return the share of successes over independent units; trials may correlate within a unit.

    The interval is Wilson's with the effective number of trials: units that differ more from each
    other than chance allows count for less (Rao and Scott, "A simple method for the analysis of
    clustered binary data", Biometrics 48, 1992). How much they differ is itself known from so many
    units only, for which the number is reduced once more (Korn and Graubard, "Confidence intervals
    for proportions with small expected number of positive counts", Survey Methodology 24, 1998).
    Where all trials went alike nothing tells how they hang together, and each unit counts once; of
    one unit with several trials there is no interval.
    """
    used = trials > 0
    successes, trials = successes[used], trials[used]
    total = math.fsum(trials)
    if total == 0:
        return Estimate(math.nan, math.nan, math.nan, 0, True)
    value = math.fsum(successes) / total
    effective, units = total, len(trials)
    clustered = float(trials.max()) > 1.0
    if clustered and units == 1:
        return Estimate(value, math.nan, math.nan, 1, True)
    plain = value * (1.0 - value) / total
    if plain > 0.0 and units > 1:
        residuals = successes - value * trials
        spread = units / (units - 1) * math.fsum(residuals**2) / total**2
        if clustered:
            spread *= (
                two_sided_t_quantile(units - 1, confidence) / two_sided_normal_quantile(confidence)
            ) ** 2
        effective = total / max(1.0, spread / plain)
    elif clustered:
        effective = float(units)
    low, high = wilson_interval(value * effective, effective, confidence)
    few = effective < FEW or (clustered and _has_few_units(successes, trials))
    return Estimate(value, low, high, units, few)


def _has_few_units(successes: FloatArray, trials: FloatArray) -> bool:
    """Return whether there are too few units, successes or failures for an interval."""
    unlike = min(np.count_nonzero(successes < trials), np.count_nonzero(successes > 0))
    return bool(len(trials) < FEW or unlike < FEW_UNLIKE)


def estimate_mean(values: FloatArray, confidence: float, method: str = "t") -> Estimate:
    """Return the mean of independent values with its interval; NaN values are left out.

    `method` is "t" or "bootstrap": Student's t, or the studentised bootstrap over 2000 resamples
    (always the same ones), which leans to the side of the longer tail (Efron and Tibshirani, "An
    introduction to the bootstrap", 1993, chapter 12.5).
    """
    values = values[~np.isnan(values)]
    count = len(values)
    if count == 0:
        return Estimate(math.nan, math.nan, math.nan, 0, True)
    part, exponent = scale_by_power_of_two(values)
    value = math.ldexp(math.fsum(part) / count, exponent)
    if count == 1:
        return Estimate(value, math.nan, math.nan, 1, True)
    error = standard_error(values)
    below = above = two_sided_t_quantile(count - 1, confidence)
    if method == "bootstrap":
        below, above = _bootstrap_reach(part, confidence) or (below, above)
    low, high = value - below * error, value + above * error
    return Estimate(value, low, high, count, count < FEW)


def estimate_rare_probability(values: FloatArray, more: FloatArray, confidence: float) -> Estimate:
    """Return the mean of independent estimates of one rare probability; NaN ones are left out.

    Such estimates are products, and skewed: the interval is that of Student's t for the logarithm
    of the mean, and they are few where that is no surer than so many events counted. Where all are
    0 it ends where Poisson's law lets nothing be seen as often as an end may err; `more` is what
    one event more would have added to each.
    """
    plain = estimate_mean(values, confidence)
    if plain.count < 2:
        return plain
    if plain.value > 0.0:
        relative = plain.half_width / plain.value
        factor = math.exp(min(relative, _MOST_LOG))
        few = (
            plain.few
            or FEW * (relative / two_sided_t_quantile(plain.count - 1, confidence)) ** 2 > 1.0
        )
        return replace(
            plain, low=plain.value / factor, high=min(1.0, plain.value * factor), few=few
        )
    expected = -math.log((1.0 - confidence) / 2.0)
    known = more[~np.isnan(more)]
    return replace(plain, high=min(1.0, expected * float(known.mean()) / len(known)))


def estimate_quantile(values: FloatArray, share: float, confidence: float) -> Estimate:
    """Return the quantile `share` over independent units, with two order statistics as interval.

    Either end errs with at most half the probability that is left (H. A. David and H. N. Nagaraja,
    "Order statistics", 3rd edition, 2003, section 7.1). Of too few units an end is infinite.
    """
    known = np.sort(values[~np.isnan(values)])
    count = len(known)
    if count == 0:
        return Estimate(math.nan, math.nan, math.nan, 0, True)
    from scipy.special import bdtr

    tail = (1.0 - confidence) / 2.0
    below = np.asarray(bdtr(np.arange(count), count, share))  # of at most so many
    # The ends are the values with these numbers, from 1; none is number 0, or count + 1.
    first = int(np.count_nonzero(below <= tail))
    last = int(np.count_nonzero(1.0 - below > tail)) + 1
    low = known[first - 1] if first else -math.inf
    high = known[last - 1] if last <= count else math.inf
    value = known[max(0, math.ceil(share * count - 1e-9) - 1)]
    few = not (first and last <= count)
    return Estimate(float(value), float(low), float(high), count, few)


def estimate_bounded_mean(values: FloatArray, confidence: float) -> Estimate:
    """Return the mean of independent values between 0 and 1; NaN ones are left out.

    The interval is Wilson's with as many trials as would make a share as uncertain as the mean is
    by Student's t, so it stays between 0 and 1; where all values are alike each is one trial.
    """
    plain = estimate_mean(values, confidence)
    if plain.count < 2:
        return plain
    error = standard_error_from_interval(plain, confidence)
    spread = plain.value * (1.0 - plain.value)
    trials = spread / error**2 if spread > 0.0 and error > 1e-9 else float(plain.count)
    low, high = wilson_interval(plain.value * trials, trials, confidence)
    return Estimate(plain.value, low, high, plain.count, plain.few)


def estimate_from_standard_error(
    value: float, error: float, count: int, few: bool, confidence: float
) -> Estimate:
    """Return an estimate with the normal interval of a given standard error."""
    half = two_sided_normal_quantile(confidence) * error
    return Estimate(value, value - half, value + half, count, few)


def standard_error_from_interval(estimate: Estimate, confidence: float) -> float:
    """Return the standard error whose normal interval is as wide as the estimate's."""
    return estimate.half_width / two_sided_normal_quantile(confidence)


def standard_error(values: FloatArray) -> float:
    """Return the standard error of a mean."""
    count = len(values)
    part, exponent = scale_by_power_of_two(values)
    middle = math.fsum(part) / count
    error = math.sqrt(math.fsum((part - middle) ** 2) / (count - 1) / count)
    return math.ldexp(error, exponent)


def scale_by_power_of_two(values: FloatArray) -> tuple[FloatArray, int]:
    """Return (values, exponent): divided by a power of two so that the largest lies below 1.

    The division is exact, so what is computed of them has the same digits; but sums and squares of
    values near the largest number there is are numbers then.
    """
    largest = float(np.abs(values).max(initial=0.0))
    exponent = math.frexp(largest)[1] if math.isfinite(largest) else 0
    return np.ldexp(values, -exponent), exponent


def two_sided_t_quantile(degrees: float, confidence: float) -> float:
    """Return the half-width, in standard errors, of the central interval of Student's t."""
    from scipy.special import stdtrit

    return float(stdtrit(degrees, 0.5 + confidence / 2.0))


def _bootstrap_reach(values: FloatArray, confidence: float) -> tuple[float, float] | None:
    """Return how many standard errors the studentised bootstrap reaches (below, above) the mean.

    None where most resamples hold one value only, so that they tell nothing.
    """
    generator = np.random.Generator(np.random.Philox(len(values)))
    middle, root = values.mean(), math.sqrt(len(values))
    pivots = []
    step = max(1, 1_000_000 // len(values))  # memory stays flat in the number of values
    for start in range(0, _RESAMPLES, step):
        some = min(step, _RESAMPLES - start)
        drawn = values[generator.integers(0, len(values), (some, len(values)))]
        errors = drawn.std(axis=1, ddof=1) / root
        good = np.ptp(drawn, axis=1) > 0.0
        pivots.append((drawn[good].mean(axis=1) - middle) / errors[good])
    known = np.concatenate(pivots)
    if len(known) < _RESAMPLES // 2:
        return None
    tail = (1.0 - confidence) / 2.0
    low, high = np.quantile(known, [tail, 1.0 - tail])
    return float(high), -float(low)


def chi_square_bounds(freedom: float, share: float = 0.95) -> tuple[float, float]:
    """Return (low, high) that hold a chi-square variable with probability `share`, equal tails."""
    from scipy.special import gammaincinv

    tail = 0.5 * (1.0 - share)
    low, high = (2.0 * float(gammaincinv(0.5 * freedom, p)) for p in (tail, 1.0 - tail))
    return low, high


def unseen_event_mean_and_square(terms: FloatArray) -> tuple[float, float]:
    """Return (mean, mean square) of the term of one more event, drawn in proportion to the terms:
    what it would add to a Poisson sum, and to its variance.
    """
    once = math.fsum(terms)
    return math.fsum(terms**2) / once, math.fsum(terms**3) / once


def resampled_ratios(below: FloatArray, above: FloatArray, resamples: int, seed: int) -> FloatArray:
    """Return bootstrapped sum(above) / sum(below) over units, without those where sum(below) is 0.

    Units without any event are drawn together: they add nothing to either sum. Those that are
    alike in both sums are too, which leaves few kinds where weights repeat.
    """
    pairs = np.stack([below, above], axis=1)
    pairs = pairs[pairs.any(axis=1)]
    kinds, many = np.unique(pairs, axis=0, return_counts=True)
    # The last kind: all units without an event.
    kinds = np.concatenate([kinds, np.zeros((1, 2))])
    many = np.append(many, len(below) - len(pairs))
    generator = np.random.Generator(np.random.Philox(seed))
    step = max(1, _AT_ONCE // len(kinds))
    parts = []
    for start in range(0, resamples, step):
        some = min(step, resamples - start)
        drawn: IntArray = generator.multinomial(len(below), many / len(below), size=some)
        sums = drawn @ kinds
        good = sums[:, 0] > 0.0
        parts.append(sums[good, 1] / sums[good, 0])
    return np.concatenate(parts)


def gamma_interval_of_ratio(
    below: FloatArray, above: FloatArray, ratio: float, tail: float
) -> tuple[float, float]:
    """Return (low, high) of sum(above) / sum(below); each end errs with probability `tail` at most.

    `below` and `above` are the clusters' terms below and above the line.

    Made for few events of uneven weights. That R is below some R0 means that the terms y - R0 x,
    which are positive for a risk that stays and negative for one that went, sum to less than
    nothing. Either sum is one of independent weighted Poisson counts, whose interval is a gamma
    distribution's with the sum's mean and variance, and on the side that must be certain those of
    one event more (M. P. Fay and E. J. Feuer, "Confidence intervals for directly standardized
    rates", Statistics in Medicine 16, 1997; for a ratio of two, M. P. Fay, Communications in
    Statistics 28, 1999). That event is one that nobody has seen. Above the line it weighs what
    those seen do, drawn in proportion to their weights, for that is how one enters the sum; on the
    other side as much as the heaviest nominal one. With equal weights and nothing induced the lower
    end is Clopper and Pearson's; the upper lies a little above theirs, because the event more may
    be an induced one.
    """
    # In order of above/below, the terms y - R x that are negative are the first ones, for any R.
    some = (below > 0.0) | (above > 0.0)
    x, y = below[some], above[some]
    with np.errstate(divide="ignore"):
        each = y / x
    order = np.argsort(each, kind="stable")
    each, x, y = each[order], x[order], y[order]
    moments = np.stack([x, y, x * x, x * y, y * y])
    first = np.concatenate([np.zeros((5, 1)), np.cumsum(moments, axis=1)], axis=1)
    last = np.concatenate([np.cumsum(moments[:, ::-1], axis=1)[:, ::-1], np.zeros((5, 1))], axis=1)

    def negative_and_positive_sums(limit: float) -> tuple[tuple[float, float], tuple[float, float]]:
        """Return (sum, sum of squares) of the terms ``y - limit * x`` that are negative, with the
        sign turned, and of those that are positive.
        """
        index = int(np.searchsorted(each, limit))
        went, stay = (part[:, index].tolist() for part in (first, last))
        return (
            (limit * went[0] - went[1], limit**2 * went[2] - 2.0 * limit * went[3] + went[4]),
            (stay[1] - limit * stay[0], limit**2 * stay[2] - 2.0 * limit * stay[3] + stay[4]),
        )

    more, heaviest = unseen_event_mean_and_square(np.maximum(x, y)), float(x.max())

    def confidence_below(limit: float) -> float:
        """Return the confidence that the ratio is below `limit`."""
        went, stay = negative_and_positive_sums(limit)
        return _probability_gamma_exceeds(went, (stay[0] + more[0], stay[1] + more[1]))

    def confidence_above(limit: float) -> float:
        went, stay = negative_and_positive_sums(limit)
        had = limit * heaviest
        return _probability_gamma_exceeds(stay, (went[0] + had, went[1] + had * had))

    sure = 1.0 - tail
    low = 0.0 if ratio == 0.0 else _ratio_at_certainty(confidence_above, sure, ratio, 0.5)
    return low, _ratio_at_certainty(confidence_below, sure, ratio or 1.0 / len(x), 2.0)


def _probability_gamma_exceeds(one: tuple[float, float], other: tuple[float, float]) -> float:
    """Return the probability that gamma variable `one` exceeds `other`, each (mean, variance)."""
    from scipy.special import betainc

    if not (one[0] > 0.0 and one[1] > 0.0):
        return 0.0
    scales = one[1] / one[0], other[1] / other[0]
    shapes = one[0] / scales[0], other[0] / scales[1]
    return float(betainc(shapes[1], shapes[0], scales[0] / (scales[0] + scales[1])))


def _ratio_at_certainty(
    certainty: Callable[[float], float], sure: float, start: float, factor: float
) -> float:
    """Return where `certainty` reaches `sure`, from `start` in steps of `factor`; else 0 or inf."""
    inner = outer = start
    while certainty(outer) < sure:
        if not 1e-300 < outer < 1e300:
            return 0.0 if factor < 1.0 else math.inf
        inner, outer = outer, outer * factor
    for _ in range(60):
        middle = math.sqrt(inner * outer)
        if certainty(middle) < sure:
            inner = middle
        else:
            outer = middle
    return outer
