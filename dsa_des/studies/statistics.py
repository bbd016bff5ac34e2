"""Confidence intervals: Wilson for shares, t or bootstrap for means, paired for differences."""

import math
from dataclasses import dataclass
from statistics import NormalDist

import numpy as np

from dsa_des.arrays.types import FloatArray

#: Below this many values (effective trials, for a share) an interval says little.
FEW = 10
_RESAMPLES = 2000


@dataclass(frozen=True)
class Estimate:
    """A mean or a share, and its interval.

    Parameters
    ----------
    value, low, high : float
        NaN where there are too few values to say.
    count : int
        Values it rests on.
    few : bool
        Whether those are too few to rely on the interval.
    """

    value: float
    low: float
    high: float
    count: int
    few: bool

    @property
    def half_width(self) -> float:
        """Half of the interval's width."""
        return (self.high - self.low) / 2.0


def wilson(successes: float, trials: float, confidence: float) -> tuple[float, float]:
    """Return Wilson's score interval of a share.

    Parameters
    ----------
    successes, trials : float
        Trials may be an effective number, and need not be whole.
    confidence : float
        For example 0.95.

    Notes
    -----
    Wilson, "Probable inference, the law of succession, and statistical inference", JASA 22 (1927).
    """
    if trials <= 0:
        return math.nan, math.nan
    z = NormalDist().inv_cdf(0.5 + confidence / 2.0)
    share = successes / trials
    middle = (share + z * z / (2.0 * trials)) / (1.0 + z * z / trials)
    spread = share * (1.0 - share) / trials + z * z / (4.0 * trials * trials)
    half = z / (1.0 + z * z / trials) * math.sqrt(max(spread, 0.0))
    low = 0.0 if successes == 0 else max(0.0, middle - half)
    high = 1.0 if successes == trials else min(1.0, middle + half)
    return low, high


def share(successes: FloatArray, trials: FloatArray, confidence: float) -> Estimate:
    """Return a share over independent units, each with trials that may hang together.

    The interval is Wilson's with the effective number of trials: units that differ more from each
    other than chance allows count for less (Rao and Scott, "A simple method for the analysis of
    clustered binary data", Biometrics 48, 1992).

    Parameters
    ----------
    successes, trials : (units,)
    """
    used = trials > 0
    successes, trials = successes[used], trials[used]
    total = math.fsum(trials)
    if total == 0:
        return Estimate(math.nan, math.nan, math.nan, 0, True)
    value = math.fsum(successes) / total
    effective, units = total, len(trials)
    plain = value * (1.0 - value) / total
    if units > 1 and plain > 0.0:
        residuals = successes - value * trials
        spread = units / (units - 1) * math.fsum(residuals**2) / total**2
        effective = total / max(1.0, spread / plain)
    low, high = wilson(value * effective, effective, confidence)
    return Estimate(value, low, high, units, effective < FEW)


def mean(values: FloatArray, confidence: float, method: str = "t") -> Estimate:
    """Return the mean of independent values; NaN ones are left out.

    Parameters
    ----------
    values : (n,)
    confidence : float
    method : {"t", "bootstrap"}
        Student's t, or percentiles of the means of 2000 resamples (always the same ones).
    """
    values = values[~np.isnan(values)]
    count = len(values)
    if count == 0:
        return Estimate(math.nan, math.nan, math.nan, 0, True)
    value = math.fsum(values) / count
    if count == 1:
        return Estimate(value, math.nan, math.nan, 1, True)
    if method == "bootstrap":
        low, high = _bootstrap(values, confidence)
    else:
        half = t_quantile(count - 1, confidence) * standard_error(values)
        low, high = value - half, value + half
    return Estimate(value, low, high, count, count < FEW)


def standard_error(values: FloatArray) -> float:
    """Return the standard error of a mean."""
    count = len(values)
    middle = math.fsum(values) / count
    return math.sqrt(math.fsum((values - middle) ** 2) / (count - 1) / count)


def t_quantile(degrees: float, confidence: float) -> float:
    """Return the two-sided quantile of Student's t."""
    from scipy.special import stdtrit

    return float(stdtrit(degrees, 0.5 + confidence / 2.0))


def _bootstrap(values: FloatArray, confidence: float) -> tuple[float, float]:
    generator = np.random.Generator(np.random.Philox(len(values)))
    means = np.empty(_RESAMPLES)
    step = max(1, 1_000_000 // len(values))  # memory stays flat in the number of values
    for start in range(0, _RESAMPLES, step):
        some = min(step, _RESAMPLES - start)
        chosen = generator.integers(0, len(values), (some, len(values)))
        means[start : start + some] = values[chosen].mean(axis=1)
    tail = (1.0 - confidence) / 2.0
    low, high = np.quantile(means, [tail, 1.0 - tail])
    return float(low), float(high)


@dataclass(frozen=True)
class EstimatedDifference:
    """How two conditions differ on the same units.

    Parameters
    ----------
    paired : Estimate
        Mean of the differences, unit by unit.
    unpaired : Estimate
        The same mean with the interval it would have on independent units (Welch).
    only_first, only_second : int
        Units that have a value in one condition only; they are in neither estimate.
    """

    paired: Estimate
    unpaired: Estimate
    only_first: int
    only_second: int

    @property
    def narrower(self) -> float:
        """How many times narrower the paired interval is; infinite where nothing differs."""
        if self.paired.half_width == 0.0:
            return math.inf if self.unpaired.half_width > 0.0 else math.nan
        return self.unpaired.half_width / self.paired.half_width


def difference(
    first: FloatArray, second: FloatArray, confidence: float, method: str = "t"
) -> EstimatedDifference:
    """Return second minus first on common units.

    Parameters
    ----------
    first, second : (units,)
        NaN where a unit has no value.
    """
    here, there = ~np.isnan(first), ~np.isnan(second)
    both = here & there
    paired = mean(second[both] - first[both], confidence, method)
    return EstimatedDifference(
        paired,
        _welch(first[both], second[both], confidence),
        int((here & ~there).sum()),
        int((there & ~here).sum()),
    )


def _welch(first: FloatArray, second: FloatArray, confidence: float) -> Estimate:
    count = len(first)
    if count < 2:
        return Estimate(math.nan, math.nan, math.nan, count, True)
    value = math.fsum(second) / count - math.fsum(first) / count
    one, other = standard_error(first) ** 2, standard_error(second) ** 2
    if one + other == 0.0:
        return Estimate(value, value, value, count, count < FEW)
    degrees = (one + other) ** 2 * (count - 1) / (one**2 + other**2)
    half = t_quantile(degrees, confidence) * math.sqrt(one + other)
    return Estimate(value, value - half, value + half, count, count < FEW)
