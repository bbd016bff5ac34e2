"""The interval of a ratio of two weighted counts, made for few events of uneven weights.

That R is below some R0 means that
the terms y - R0 x, which are positive for a risk that stays and negative for one that went, sum to
less than nothing. Either sum is one of independent weighted Poisson counts, whose interval is a
gamma distribution's with the sum's mean and variance, and on the side that must be certain those of
one event more (M. P. Fay and E. J. Feuer, "Confidence intervals for directly standardized rates",
Statistics in Medicine 16, 1997; for a ratio of two, M. P. Fay, Communications in Statistics 28,
1999). That event is one that nobody has seen. Above the line it weighs what those seen do, drawn in
proportion to their weights, for that is how one enters the sum; on the other side as much as the
heaviest nominal one. With equal weights and nothing induced the lower end is Clopper and Pearson's;
the upper lies a little above theirs, because the event more may be an induced one.
"""

import math
from collections.abc import Callable

import numpy as np

from dsa_des.arrays.types import FloatArray


def unseen_event(terms: FloatArray) -> tuple[float, float]:
    """Return what one event more adds to a weighted sum, on average, and to its variance."""
    once = math.fsum(terms)
    return math.fsum(terms**2) / once, math.fsum(terms**3) / once


def gamma_interval(
    below: FloatArray, above: FloatArray, ratio: float, tail: float
) -> tuple[float, float]:
    """Return the ends of an interval of which either errs with a probability of at most `tail`.

    `below` and `above` are the clusters' terms below and above the line.
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

    def sums(limit: float) -> tuple[tuple[float, float], tuple[float, float]]:
        """Return the terms that went and those that stay: their sums and their squares'."""
        index = int(np.searchsorted(each, limit))
        went, stay = (part[:, index].tolist() for part in (first, last))
        return (
            (limit * went[0] - went[1], limit**2 * went[2] - 2.0 * limit * went[3] + went[4]),
            (stay[1] - limit * stay[0], limit**2 * stay[2] - 2.0 * limit * stay[3] + stay[4]),
        )

    more, heaviest = unseen_event(np.maximum(x, y)), float(x.max())

    def below_it(limit: float) -> float:
        """Return how sure it is that the ratio is below a limit."""
        went, stay = sums(limit)
        return _surely_more(went, (stay[0] + more[0], stay[1] + more[1]))

    def above_it(limit: float) -> float:
        went, stay = sums(limit)
        had = limit * heaviest
        return _surely_more(stay, (went[0] + had, went[1] + had * had))

    sure = 1.0 - tail
    low = 0.0 if ratio == 0.0 else _where(above_it, sure, ratio, 0.5)
    return low, _where(below_it, sure, ratio or 1.0 / len(x), 2.0)


def _surely_more(one: tuple[float, float], other: tuple[float, float]) -> float:
    """Return the probability that a gamma variable is larger than another: means and variances."""
    from scipy.special import betainc

    if not (one[0] > 0.0 and one[1] > 0.0):
        return 0.0
    scales = one[1] / one[0], other[1] / other[0]
    shapes = one[0] / scales[0], other[0] / scales[1]
    return float(betainc(shapes[1], shapes[0], scales[0] / (scales[0] + scales[1])))


def _where(certainty: Callable[[float], float], sure: float, start: float, factor: float) -> float:
    """Return the ratio from which on a limit further out is sure, by halving its logarithm."""
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
