"""The ratio of two weighted counts of events over the same units, with what is uncertain about it.

It is the risk ratio of encounters that are run without a remedy (*nominal*) and with it
(*mitigated*) on the same random numbers. Nominal flags n, mitigated flags m and weights w give

    R = Σ w m / Σ w n,   unresolved Σ w min(m, n) / Σ w n,   induced Σ w max(m - n, 0) / Σ w n,

and R is the sum of the two. The same encounters stand above and below the line, so the error of R
is that of a ratio of dependent sums (W. G. Cochran, "Sampling techniques", 3rd edition, 1977,
chapter 6): with residuals w (m - R n) its variance is Σ w² (m - R n)² / (Σ w n)². Taking the
denominator as known, as the usual tools do, is another number: `PairedRatio.unpaired_error`.

The interval is made for few events of uneven weights (`gamma`:
`statistics.gamma_interval_of_ratio`).

Runs that hang together (several of one encounter, or copies of it) are one *cluster*: their terms
are added up first, and clusters are what is independent.

Where all encounters are known without a remedy and only a sample of them is flown with it, each
drawn with a probability π of its own, a flown one *stands for* 1/π encounters and one that is not
for none (D. G. Horvitz & D. J. Thompson, "A generalization of sampling without replacement from a
finite universe", Journal of the American Statistical Association 47, 1952). Then y = w m / π above
the line and x = w n below it. Whether an encounter is drawn is as independent as all else of it, so
the terms y - R x of single encounters have the whole error in them, that of the sample included.

What was *predicted* of an encounter, p, may count beside: y = w (p + (m - p)/π) is as true whatever
p is, if it was found without this encounter's flight, and the surer the better it is (the
difference estimator: C.-E. Särndal, B. Swensson & J. Wretman, "Model assisted survey sampling",
1992, chapter 6).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from dsa_des.arrays.types import AnyArray, BoolArray, FloatArray
from dsa_des.errors import shortened_repr
from dsa_des.results.statistics import (
    gamma_interval_of_ratio,
    resampled_ratios,
    scale_by_power_of_two,
    unseen_event_mean_and_square,
)

#: Intervals: by gamma distributions, of the logarithm of the ratio by its standard error, or of
#: drawn sets of encounters.
METHODS = ("gamma", "delta", "bootstrap")
_FEW = 20.0
#: What it costs to know an encounter's flights without a remedy, by what it costs to fly it with
#: one (`radar_and_camera_risk`: 0.38 of 5 ms, most of it to make the encounter). A fixed number, so
#: that bytes do not depend on the machine.
FORESEEN_COST = 0.075


@dataclass(frozen=True)
class PairedRatio:
    """Mitigated to nominal events over the same encounters: ratio, error, interval and counts."""

    #: NaN where `reason` says why there is none.
    ratio: float
    induced: float
    unresolved: float
    #: Of the ratio: paired delta method; with ``"bootstrap"`` the spread of its ratios.
    standard_error: float
    #: At the confidence that was asked for.
    interval: tuple[float, float]
    #: The standard error that takes the nominal probability as known.
    unpaired_error: float
    #: Kish's (Σ w)² / Σ w²: so many encounters of equal weight would tell as much of a mean.
    effective_sample_size: float
    #: Counts, without weights.
    encounters: int
    nominal_events: int
    mitigated_events: int
    induced_events: int
    #: Per encounter of the airspace, Σ w n / Σ w.
    nominal_probability: float
    mitigated_probability: float
    method: str = "gamma"
    #: Why there is no ratio; empty where there is one.
    reason: str = ""
    #: Whether the interval holds the truth less often than it says: that of the delta method or the
    #: bootstrap where one event more would add more than a twentieth to the variance of those that
    #: stay (with equal weights: fewer than 20). Never of the gamma method.
    few: bool = False
    #: Independent ones: clusters, or encounters where none hang together.
    clusters: int = 0
    #: Those that were flown, of which the others know only what is nominal.
    flown: int = 0
    #: Cost of an interval as wide with every encounter flown, by the cost of this one: variances
    #: times encounters flown, and `FORESEEN_COST` for each that is known. 1 where all are flown.
    gain: float = 1.0


def paired_ratio(
    nominal: npt.ArrayLike,
    mitigated: npt.ArrayLike,
    weight: npt.ArrayLike | None = None,
    *,
    cluster: npt.ArrayLike | None = None,
    stands_for: npt.ArrayLike | None = None,
    predicted: npt.ArrayLike | None = None,
    confidence: float = 0.95,
    method: str = "gamma",
    resamples: int = 4000,
    seed: int = 0,
) -> PairedRatio:
    """Return the weighted ratio of mitigated to nominal events over the same encounters, with
    standard error, interval and counts.

    Parameters
    ----------
    nominal, mitigated : (encounters,)
        Whether the event (NMAC, loss of well clear) happened: 0 or 1, or the share of an
        encounter's replicas in which it did.
    weight : (encounters,), optional
        How often each happens in the airspace; not negative. Left out, all weigh the same.
    cluster : (encounters,), optional
        Which of them hang together: rows of the same cluster. Left out, none do.
    stands_for : (encounters,), optional
        For how many encounters each flown one stands, 1 by its probability to be flown; 0 for one
        that was not flown, whose mitigated flag does not count. Left out, all are flown.
    predicted : (encounters,), optional
        With `stands_for`: which share of a mitigated event each was taken for before it was flown.
        Left out, none.
    confidence : float
        Of the interval.
    method : {"gamma", "delta", "bootstrap"}
        ``"gamma"``: either end errs at most half as often as the interval may, with few events of
        uneven weights too. ``"delta"``: R exp(± z s / R), s the paired standard error.
        ``"bootstrap"``: the percentiles of ratios of encounters drawn with their weight and both
        flags.
    resamples, seed : int
        Of the bootstrap.

    Returns
    -------
    PairedRatio
        Without a ratio, and with the reason, where no encounter of any weight has a nominal event.
        Where no encounter differs from R times its nominal flag (nothing is left of the risk, or
        all of it), ``"delta"`` and ``"bootstrap"`` cannot tell how wrong R is: the interval then
        reaches to what as many nominal events, of which none went otherwise, leave possible.

    Raises
    ------
    ValueError
        Naming the first encounter (counted from 0) whose value cannot be used.
    """
    n = _checked_flags("nominal", nominal)
    s = None if stands_for is None else _checked_expansions(stands_for, len(n))
    m = _checked_mitigated_flags(mitigated, s)
    w, _ = scale_by_power_of_two(
        _checked_weights(weight, len(n))
    )  # all that follows is of weights relative to each other
    if len(m) != len(n):
        raise ValueError(f"nominal has {len(n)} encounters and mitigated {len(m)}")
    if method not in METHODS:
        raise ValueError(f"method = {method!r}: must be one of {', '.join(METHODS)}")
    if not 0.0 < confidence < 1.0:
        raise ValueError(f"confidence = {confidence}: must lie between 0 and 1")
    if resamples < 2:
        raise ValueError(f"resamples = {resamples}: must be 2 or more")
    d = None if s is None or predicted is None else _checked_flags("predicted", predicted)
    y = w * _unweighted_numerator_terms(m, s, d)
    terms = _sum_ratio_terms_by_cluster(w, w * n, y, cluster)
    total, below = math.fsum(w), math.fsum(w * n)
    squares = math.fsum(terms[0] ** 2)
    counts = len(n), *_count_nominal_mitigated_induced(n, m, s)
    sizes = total * total / squares if squares > 0.0 else 0.0
    if below == 0.0:
        nan = math.nan
        why = _explain_no_ratio(n, total)
        share = (0.0, math.fsum(y) / total) if total > 0.0 else (nan, nan)
        return PairedRatio(
            nan, nan, nan, nan, (nan, nan), nan, sizes, *counts, *share, method, why,
            clusters=len(terms[0]),
            flown=_count_flown(n, s),
        )  # fmt: skip
    above = math.fsum(y)
    induced = _unweighted_numerator_terms(
        np.maximum(m - n, 0.0), s, None if d is None else d * (n == 0.0)
    )
    added = max(0.0, math.fsum(w * induced))
    left, ratio = above - added, above / below
    each, x, y = terms
    residual = y - ratio * x
    squared = math.fsum(residual * residual)
    error = math.sqrt(squared) / below
    spread = y - above / total * each
    unpaired = math.sqrt(math.fsum(spread * spread)) / below
    tail = (1.0 - confidence) / 2.0
    # Rounding alone leaves residuals where m is R n throughout.
    certain = error <= 1e-12 * max(ratio, 1.0)
    if method == "gamma":
        interval = gamma_interval_of_ratio(x, y, ratio, tail)
    elif certain:
        # The same number of events, of which none went otherwise, has this upper limit.
        possible = -math.log(tail) * math.fsum(x**2) / below**2
        interval = max(0.0, ratio - possible), ratio + possible
    elif method == "bootstrap":
        ratios = resampled_ratios(x, y, resamples, seed)
        error = float(np.std(ratios, ddof=1)) if len(ratios) > 1 else math.nan
        low, high = np.quantile(ratios, [tail, 1.0 - tail]) if len(ratios) else (math.nan,) * 2
        interval = float(low), float(high)
    else:
        from scipy.special import ndtri

        reach = math.exp(float(ndtri(1.0 - tail)) * error / ratio)
        interval = ratio / reach, ratio * reach
    few = (
        method != "gamma"
        and math.fsum(y**2) < _FEW * unseen_event_mean_and_square(np.maximum(x, y))[1]
    )
    return PairedRatio(
        ratio, added / below, left / below, error, interval, unpaired, sizes, *counts,
        below / total, above / total, method, "", few, len(each),
        *_count_flown_and_gain(n, m, w, s, d, ratio, squared),
    )  # fmt: skip


def _count_flown_and_gain(
    nominal: FloatArray, mitigated: FloatArray, weight: FloatArray, stands_for: FloatArray | None,
    predicted: FloatArray | None, ratio: float, sampled: float,
) -> tuple[int, float]:  # fmt: skip
    """Return (encounters flown, how many times as much an interval as wide costs with all flown).

    `sampled` is the sum of the squared residuals of clusters. Encounters are drawn independently,
    so what those of a cluster have in common is as much with all of them flown.
    """
    flown = _count_flown(nominal, stands_for)
    if stands_for is None:
        return flown, 1.0
    each = (
        weight * (_unweighted_numerator_terms(mitigated, stands_for, predicted) - ratio * nominal)
    ) ** 2
    plain = math.fsum(stands_for * (weight * (mitigated - ratio * nominal)) ** 2)
    plain += sampled - math.fsum(each)
    cost = flown / len(nominal) + FORESEEN_COST
    return flown, plain / (sampled * cost) if sampled > 0.0 else math.nan


def _count_flown(nominal: FloatArray, stands_for: FloatArray | None) -> int:
    return len(nominal) if stands_for is None else int(np.count_nonzero(stands_for))


def share_from_flown_sample(
    whole: FloatArray,
    part: FloatArray,
    weight: FloatArray,
    stands_for: FloatArray,
    *,
    predicted: FloatArray | None,
    **options: Any,
) -> PairedRatio:
    """Return which share of `whole` is `part` by the surer of two estimators, interval cut at 1.

    The part by all events, as `paired_ratio` has it; or by those that the flown ones stand for (J.
    Hájek's ratio), which is surer where the share is large, and never above 1: the surer of both.
    """
    one = paired_ratio(
        whole, part, weight, stands_for=stands_for, predicted=predicted, **options
    )  # fmt: skip
    flown = np.flatnonzero(stands_for)
    cluster = options.pop("cluster", None)
    other = paired_ratio(
        whole[flown], part[flown], (weight * stands_for)[flown],
        cluster=None if cluster is None else cluster[flown], **options,
    )  # fmt: skip
    if not other.reason and (other.standard_error < one.standard_error or one.ratio > 1.0):
        sure = other.standard_error > 0.0
        gain = (one.standard_error / other.standard_error) ** 2 if sure else math.nan
        names = "ratio", "induced", "unresolved", "standard_error", "interval", "few"
        new = {name: getattr(other, name) for name in names}
        one = replace(one, **new, gain=one.gain * gain)
    low, high = one.interval
    return replace(one, interval=(low, min(high, 1.0)))


def error_share_of_encounters(
    nominal: npt.ArrayLike,
    mitigated: npt.ArrayLike,
    weight: npt.ArrayLike | None,
    ratio: float,
    stands_for: npt.ArrayLike | None = None,
    predicted: npt.ArrayLike | None = None,
) -> FloatArray:
    """Return each encounter's share of a ratio's error; their squares sum to its variance.

    Values are those of `paired_ratio`.
    """
    n = _checked_flags("nominal", nominal)
    s = None if stands_for is None else _checked_expansions(stands_for, len(n))
    m, (w, _) = (
        _checked_mitigated_flags(mitigated, s),
        scale_by_power_of_two(_checked_weights(weight, len(n))),
    )
    d = None if s is None or predicted is None else _checked_flags("predicted", predicted)
    result: FloatArray = w * (_unweighted_numerator_terms(m, s, d) - ratio * n) / math.fsum(w * n)
    return result


def _unweighted_numerator_terms(
    flags: FloatArray, stands_for: FloatArray | None, predicted: FloatArray | None
) -> FloatArray:
    """Return each encounter's term in the ratio's numerator before weighting: the flag, in a sample
    scaled up and corrected by its prediction.
    """
    if stands_for is None:
        return flags
    result = stands_for * flags
    return result if predicted is None else result + (1.0 - stands_for) * predicted


def redistribute_lost_runs(
    stands_for: FloatArray, lost: Sequence[float], of: BoolArray
) -> FloatArray:
    """Return `stands_for` with lost runs' weight shared among the cell's flown runs (mask `of`).

    These leave out themselves, as in any study; the others for which they were to stand are shared
    by those flown `of` the same cell. `lost` says for how many each stood, NaN of one of which that
    is not known: as many as the others on average.
    """
    mine = of & (stands_for > 0.0)
    others = np.where(mine, stands_for - 1.0, 0.0)
    if not (total := math.fsum(others)) > 0.0:
        return stands_for
    missing = np.nan_to_num(np.array(lost), nan=1.0 + total / mine.sum())
    more = math.fsum(np.maximum(missing - 1.0, 0.0)) / total
    return stands_for + others * more


def _sum_ratio_terms_by_cluster(
    weight: FloatArray, below: FloatArray, above: FloatArray, cluster: npt.ArrayLike | None
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return (weight, denominator term, numerator term) summed by cluster, if there are any."""
    each = weight, below, above
    if cluster is None:
        return each
    names = np.asarray(cluster)
    if names.shape != weight.shape:
        raise ValueError(f"cluster has the shape {names.shape}: {len(weight)} encounters have one")
    _, index = np.unique(names, return_inverse=True)
    one, two, three = (np.bincount(index, weights=values).astype(float) for values in each)
    return one, two, three


def _checked_flags(what: str, values: npt.ArrayLike) -> FloatArray:
    flags = np.asarray(values, dtype=np.float64)
    if flags.ndim != 1:
        raise ValueError(f"{what} has the shape {flags.shape}: one value per encounter is needed")
    _refuse_values(
        what, flags, ~((flags >= 0.0) & (flags <= 1.0)), "must be 0 or 1, or a share between"
    )
    return flags


def _checked_weights(weight: npt.ArrayLike | None, count: int) -> FloatArray:
    if weight is None:
        return np.ones(count)
    weights = np.asarray(weight, dtype=np.float64)
    if weights.shape != (count,):
        raise ValueError(f"weight has the shape {weights.shape}: {count} encounters have one each")
    _refuse_values(
        "weight", weights, ~(np.isfinite(weights) & (weights >= 0.0)), "must be 0 or more"
    )
    return weights


def _checked_expansions(stands_for: npt.ArrayLike, count: int) -> FloatArray:
    result = np.asarray(stands_for, dtype=np.float64)
    if result.shape != (count,):
        raise ValueError(f"stands_for has the shape {result.shape}: {count} encounters have one")
    bad = ~(np.isfinite(result) & ((result == 0.0) | (result >= 1.0)))
    _refuse_values("stands_for", result, bad, "must be 0, or 1 or more")
    return result


def _checked_mitigated_flags(mitigated: npt.ArrayLike, stands_for: FloatArray | None) -> FloatArray:
    """Return the mitigated flags, checked, with 0 for encounters that were not flown."""
    if stands_for is None:
        return _checked_flags("mitigated", mitigated)
    return _checked_flags("mitigated", np.where(stands_for > 0.0, mitigated, 0.0))


def _count_nominal_mitigated_induced(
    nominal: FloatArray, mitigated: FloatArray, stands_for: FloatArray | None
) -> tuple[int, int, int]:
    """Return counts of encounters: nominal event, mitigated event, more mitigated than nominal."""
    induced = mitigated > nominal
    if stands_for is not None:
        induced &= stands_for > 0.0
    return (
        int(np.count_nonzero(nominal)),
        int(np.count_nonzero(mitigated)),
        int(np.count_nonzero(induced)),
    )


def _refuse_values(what: str, values: FloatArray, bad: AnyArray, allowed: str) -> None:
    if bad.any():
        index = int(np.argmax(bad))
        value = float(values[index])
        shown = "missing" if math.isnan(value) else shortened_repr(value)
        raise ValueError(f"{what} of encounter {index} is {shown}: {allowed}")


def _explain_no_ratio(nominal: FloatArray, total: float) -> str:
    if total == 0.0:
        return "there is no encounter" if len(nominal) == 0 else "all weights are 0"
    if nominal.any():
        return "the encounters with a nominal event weigh nothing"
    return "no encounter has a nominal event"
