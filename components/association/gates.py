"""Gates: how far from a track a detection of it may lie, for a stated probability."""

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
        The quantile of the chi-square distribution with `size` degrees of freedom.
    """
    from scipy.special import gammaincinv

    return float(2.0 * gammaincinv(0.5 * size, probability))
