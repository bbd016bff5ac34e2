"""Age and intervals of a periodic sensor whose scans come through with a fixed probability.

Scans come through independently, so the number of periods between two that do is geometric:
E[N] = 1/q, E[N²] = (2 - q)/q².
"""

import math


def mean_interval_s(period_s: float, through: float) -> float:
    """Return the mean time between scans that come through, s."""
    return period_s / through


def mean_age_s(period_s: float, through: float, jitter_s: float = 0.0) -> float:
    """Return the mean over time of the time since the last scan that came through, s.

    It is E[g²] / (2 E[g]) of the gaps g between them (the renewal-reward theorem). Jitter of
    standard deviation s about the grid adds 2s² to E[g²].

    Parameters
    ----------
    period_s : float
    through : float
        Probability that a scan comes through, in (0, 1].
    jitter_s : float
    """
    square = period_s**2 * (2.0 - through) / through**2 + 2.0 * jitter_s**2
    return square * through / (2.0 * period_s)


def age_quantile_s(period_s: float, through: float, share: float) -> float:
    """Return the age that is not exceeded for `share` of the time, without jitter, s.

    The age lies beyond n periods for the share (1 - through)^n of the time, and is uniform
    between two multiples of the period.
    """
    left, lost = 1.0 - share, 1.0 - through
    whole = 0 if lost == 0.0 else math.floor(math.log(left) / math.log(lost))
    beyond = lost**whole
    return period_s * (whole + (beyond - left) / (beyond * through))
