"""Gates: how far from a track a detection of it may lie, for a stated probability."""

import math
from functools import lru_cache


@lru_cache(maxsize=64)
def gate_threshold(probability: float, size: int) -> float:
    """Return the squared Mahalanobis distance that holds detections with a probability.

    Parameters
    ----------
    probability : float
        That a detection of the target lies in its gate; in (0, 1).
    size : int
        How many quantities are measured.

    Returns
    -------
    float
        The quantile of the chi-square distribution with `size` degrees of freedom, by bisection
        of its distribution in closed form.
    """
    low, high = 0.0, 1.0
    while 1.0 - probability < _beyond(high, size):
        high *= 2.0
    while True:
        middle = 0.5 * (low + high)
        if middle in (low, high):
            return high
        if 1.0 - probability < _beyond(middle, size):
            low = middle
        else:
            high = middle


def _beyond(distance: float, size: int) -> float:
    """Return the probability of a larger squared distance (Abramowitz, Stegun, 26.4.4 and 5)."""
    half = 0.5 * distance
    total = 0.0 if size % 2 == 0 else math.erfc(math.sqrt(half))
    term = math.exp(-half) * (1.0 if size % 2 == 0 else math.sqrt(half) / math.gamma(1.5))
    power = 1.0 if size % 2 == 0 else 1.5
    for _ in range(size // 2):
        total += term
        term *= half / power
        power += 1.0
    return total
