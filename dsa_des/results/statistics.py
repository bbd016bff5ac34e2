"""Confidence intervals: Wilson for shares, t or bootstrap for means, paired for differences."""

import math
from dataclasses import dataclass, replace
from statistics import NormalDist

import numpy as np

from dsa_des.arrays.types import FloatArray

#: Below this many values (effective trials, for a share) an interval says little.
FEW = 10
#: Below this many units with a trial that went otherwise than most, an interval of a share of
#: trials that hang together says little.
FEW_UNLIKE = 5
_RESAMPLES = 2000
#: Of the largest of some values: a smaller difference is one of rounding.
_ALIKE = 1e-9
#: No interval of a logarithm is wider.
_MOST_LOG = 700.0


@dataclass(frozen=True)
class Estimate:
    """A mean or a share, and its interval."""

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


def within(result: Estimate, least: float | None, most: float | None) -> Estimate:
    """Return an estimate whose interval holds nothing that no value can be."""
    low = result.low if least is None else max(least, result.low)
    high = result.high if most is None else min(most, result.high)
    # A NaN is kept: the comparison with it is false.
    return replace(result, low=low, high=high) if result.low <= result.high else result


def changes_of(first: FloatArray, second: FloatArray) -> FloatArray:
    """Return second minus first; 0 where the two are alike but for how they were rounded.

    That is, within 1e-9 of the largest of them: a quantity is never known so well, and rounding
    adds up to far less.
    """
    changes = second - first
    both = np.abs(np.concatenate([first, second]))
    finite = both[np.isfinite(both)]
    resolution = _ALIKE * float(finite.max(initial=0.0))
    return np.where(np.abs(changes) <= resolution, 0.0, changes)


def wilson(successes: float, trials: float, confidence: float) -> tuple[float, float]:
    """Return Wilson's score interval of a share.

    Trials may be an effective number, and need not be whole.

    Notes
    -----
    Wilson, "Probable inference, the law of succession, and statistical inference", JASA 22 (1927).
    """
    if trials <= 0:
        return math.nan, math.nan
    z = _z(confidence)
    share = successes / trials
    middle = (share + z * z / (2.0 * trials)) / (1.0 + z * z / trials)
    spread = share * (1.0 - share) / trials + z * z / (4.0 * trials * trials)
    half = z / (1.0 + z * z / trials) * math.sqrt(max(spread, 0.0))
    low = 0.0 if successes == 0 else max(0.0, middle - half)
    high = 1.0 if successes == trials else min(1.0, middle + half)
    return low, high


def _z(confidence: float) -> float:
    """Return the two-sided quantile of the normal distribution."""
    return NormalDist().inv_cdf(0.5 + confidence / 2.0)


def share(successes: FloatArray, trials: FloatArray, confidence: float) -> Estimate:
    """Return a share over independent units, each with trials that may hang together.

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
            spread *= (t_quantile(units - 1, confidence) / _z(confidence)) ** 2
        effective = total / max(1.0, spread / plain)
    elif clustered:
        effective = float(units)
    low, high = wilson(value * effective, effective, confidence)
    few = effective < FEW or (clustered and _rests_on_few(successes, trials))
    return Estimate(value, low, high, units, few)


def _rests_on_few(successes: FloatArray, trials: FloatArray) -> bool:
    """Return whether few units say how trials hang together: few in all, or few unlike the rest."""
    unlike = min(np.count_nonzero(successes < trials), np.count_nonzero(successes > 0))
    return bool(len(trials) < FEW or unlike < FEW_UNLIKE)


def mean(values: FloatArray, confidence: float, method: str = "t") -> Estimate:
    """Return the mean of independent values; NaN ones are left out.

    `method` is "t" or "bootstrap": Student's t, or the studentised bootstrap over 2000 resamples
    (always the same ones), which leans to the side of the longer tail (Efron and Tibshirani, "An
    introduction to the bootstrap", 1993, chapter 12.5).
    """
    values = values[~np.isnan(values)]
    count = len(values)
    if count == 0:
        return Estimate(math.nan, math.nan, math.nan, 0, True)
    part, exponent = scaled(values)
    value = math.ldexp(math.fsum(part) / count, exponent)
    if count == 1:
        return Estimate(value, math.nan, math.nan, 1, True)
    error = standard_error(values)
    below = above = t_quantile(count - 1, confidence)
    if method == "bootstrap":
        below, above = _bootstrap(part, confidence) or (below, above)
    low, high = value - below * error, value + above * error
    return Estimate(value, low, high, count, count < FEW)


def rare(values: FloatArray, more: FloatArray, confidence: float) -> Estimate:
    """Return the mean of independent estimates of one rare probability; NaN ones are left out.

    Such estimates are products, and skewed: the interval is that of Student's t for the logarithm
    of the mean. Where all are 0 it ends where Poisson's law lets nothing be seen as often as an end
    may err; `more` is what one event more would have added to each.
    """
    plain = mean(values, confidence)
    if plain.count < 2:
        return plain
    if plain.value > 0.0:
        factor = math.exp(min(plain.half_width / plain.value, _MOST_LOG))
        return replace(plain, low=plain.value / factor, high=min(1.0, plain.value * factor))
    expected = -math.log((1.0 - confidence) / 2.0)
    known = more[~np.isnan(more)]
    return replace(plain, high=min(1.0, expected * float(known.mean()) / len(known)))


def quantile(values: FloatArray, share: float, confidence: float) -> Estimate:
    """Return a quantile over independent units, whose interval lies between two order statistics.

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


def fraction(values: FloatArray, confidence: float) -> Estimate:
    """Return the mean of independent values between 0 and 1; NaN ones are left out.

    The interval is Wilson's with as many trials as would make a share as uncertain as the mean is
    by Student's t, so it stays between 0 and 1; where all values are alike each is one trial.
    """
    plain = mean(values, confidence)
    if plain.count < 2:
        return plain
    error = normal_error(plain, confidence)
    spread = plain.value * (1.0 - plain.value)
    trials = spread / error**2 if spread > 0.0 and error > 1e-9 else float(plain.count)
    low, high = wilson(plain.value * trials, trials, confidence)
    return Estimate(plain.value, low, high, plain.count, plain.few)


def symmetric(value: float, error: float, count: int, few: bool, confidence: float) -> Estimate:
    """Return an estimate whose interval is that of the normal distribution."""
    half = _z(confidence) * error
    return Estimate(value, value - half, value + half, count, few)


def normal_error(estimate: Estimate, confidence: float) -> float:
    """Return the standard error whose normal interval is as wide as an estimate's."""
    return estimate.half_width / _z(confidence)


def standard_error(values: FloatArray) -> float:
    """Return the standard error of a mean."""
    count = len(values)
    part, exponent = scaled(values)
    middle = math.fsum(part) / count
    error = math.sqrt(math.fsum((part - middle) ** 2) / (count - 1) / count)
    return math.ldexp(error, exponent)


def scaled(values: FloatArray) -> tuple[FloatArray, int]:
    """Return values divided by a power of two, the largest then below 1, and its exponent.

    The division is exact, so what is computed of them has the same digits; but sums and squares of
    values near the largest number there is are numbers then.
    """
    largest = float(np.abs(values).max(initial=0.0))
    exponent = math.frexp(largest)[1] if math.isfinite(largest) else 0
    return np.ldexp(values, -exponent), exponent


def t_quantile(degrees: float, confidence: float) -> float:
    """Return the two-sided quantile of Student's t."""
    from scipy.special import stdtrit

    return float(stdtrit(degrees, 0.5 + confidence / 2.0))


def _bootstrap(values: FloatArray, confidence: float) -> tuple[float, float] | None:
    """Return how many standard errors an interval reaches below and above the mean.

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


@dataclass(frozen=True)
class EstimatedDifference:
    """How two conditions differ on the same units."""

    #: Mean of the differences, unit by unit.
    paired: Estimate
    #: The same mean with the interval it would have on independent units (Welch).
    unpaired: Estimate
    #: Units that have a value in one condition only; they are in neither estimate.
    only_first: int
    only_second: int

    @property
    def narrower(self) -> float:
        """How many times narrower the paired interval is; infinite where nothing differs."""
        if self.paired.half_width == 0.0:
            return math.inf if self.unpaired.half_width > 0.0 else math.nan
        return self.unpaired.half_width / self.paired.half_width


def difference(
    first: FloatArray,
    second: FloatArray,
    confidence: float,
    method: str = "t",
    *,
    kind: str = "number",
) -> EstimatedDifference:
    """Return second minus first on common units.

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
    changes = changes_of(first[both], second[both])
    whole = kind == "share" and bool(np.isin(changes, (-1.0, 0.0, 1.0)).all())
    counted = len(changes) > 1 and (kind == "event" or whole)
    paired = _counted(changes, confidence) if counted else mean(changes, confidence, method)
    apart = counted and bool(np.isin((first[both], second[both]), (0.0, 1.0)).all())
    if apart:
        unpaired = _counted_apart(first[both], second[both], confidence)
    else:
        unpaired = _welch(first[both], changes, confidence)
    if kind != "number":
        paired, unpaired = _of_shares(paired), _of_shares(unpaired)
    return EstimatedDifference(
        paired,
        unpaired,
        int((here & ~there).sum()),
        int((there & ~here).sum()),
    )


def quantile_difference(
    first: FloatArray, second: FloatArray, share: float, confidence: float
) -> EstimatedDifference:
    """Return how a quantile over the same units differs between two conditions.

    The interval is the normal distribution's with the spread of 1000 resamples of the units, always
    the same ones, each with its values under both conditions (Efron and Tibshirani, chapter 8.6).
    NaN is a unit without a value. Where a quantile has no interval of its own, this has none.
    """
    here, there = ~np.isnan(first), ~np.isnan(second)
    one, two = first[here & there], second[here & there]
    alone = int((here & ~there).sum()), int((there & ~here).sum())
    ends = [quantile(values, share, confidence) for values in (one, two)]
    value = ends[1].value - ends[0].value
    if any(end.few for end in ends):
        none = Estimate(value, math.nan, math.nan, len(one), True)
        return EstimatedDifference(none, none, *alone)
    index = max(0, math.ceil(share * len(one) - 1e-9) - 1)
    generator = np.random.Generator(np.random.Philox(len(one)))
    drawn = np.empty(_RESAMPLES // 2)
    for k in range(len(drawn)):
        units = generator.integers(0, len(one), len(one))
        low, high = (np.partition(values[units], index)[index] for values in (one, two))
        drawn[k] = high - low
    apart = math.hypot(*(normal_error(end, confidence) for end in ends))
    return EstimatedDifference(
        symmetric(value, float(drawn.std(ddof=1)), len(one), False, confidence),
        symmetric(value, apart, len(one), False, confidence),
        *alone,
    )


def _of_shares(result: Estimate) -> Estimate:
    """Return a difference of shares whose interval holds nothing that none can be."""
    return within(result, -1.0, 1.0)


def _counted(changes: FloatArray, confidence: float) -> Estimate:
    """Return the mean of changes of events, as if one unit more had gained and one more had lost.

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
    half = t_quantile(count - 1, confidence) * error
    return Estimate(value, middle - half, middle + half, count, count < FEW)


def _counted_apart(first: FloatArray, second: FloatArray, confidence: float) -> Estimate:
    """Return the difference of two shares, each as if of one unit more of either kind."""
    count = len(first)
    one, other = ((result.sum() + 1.0) / (count + 2.0) for result in (first, second))
    error = math.sqrt((one * (1.0 - one) + other * (1.0 - other)) / (count + 2.0))
    half = _z(confidence) * error
    value, middle = float(second.mean() - first.mean()), float(other - one)
    return Estimate(value, middle - half, middle + half, count, count < FEW)


def _welch(first: FloatArray, changes: FloatArray, confidence: float) -> Estimate:
    count = len(first)
    if count < 2:
        return Estimate(math.nan, math.nan, math.nan, count, True)
    value = mean(changes, confidence).value
    errors, exponent = scaled(np.array([standard_error(first), standard_error(first + changes)]))
    one, other = (errors**2).tolist()
    if one + other == 0.0:
        return Estimate(value, value, value, count, count < FEW)
    degrees = (one + other) ** 2 * (count - 1) / (one**2 + other**2)
    half = t_quantile(degrees, confidence) * math.ldexp(math.sqrt(one + other), exponent)
    return Estimate(value, value - half, value + half, count, count < FEW)


def chi_square_bounds(freedom: float, share: float = 0.95) -> tuple[float, float]:
    """Return the interval that holds a chi-square variable with a probability, tails alike."""
    from scipy.special import gammaincinv

    tail = 0.5 * (1.0 - share)
    low, high = (2.0 * float(gammaincinv(0.5 * freedom, p)) for p in (tail, 1.0 - tail))
    return low, high
