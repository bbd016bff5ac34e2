"""The probability that a target is declared by a given look, from the Pd of each look."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from components.arguments.checks import FloatArray, as_numbers, refuse

#: Looks of the rule; the looks before are a state of their own each.
MOST_LOOKS = 12


def first_declared(pd: ArrayLike, m: int = 1, n: int = 1) -> FloatArray:
    """Return the probability that m detections within n looks are first there at each look.

    Looks are independent, as those of scan-to-scan fluctuation are. Before the first look there
    are misses.

    Parameters
    ----------
    pd : (..., looks) array_like
        Probability of detection of each look in order of time, [0, 1].
    m, n : int
        1 <= m <= n <= 12; with m = n = 1 the first detection.

    Returns
    -------
    array of the shape of `pd`
        Adds up along the last axis to the cumulative probability of declaration.

    Raises
    ------
    ValueError
        If the rule or a probability is out of range.

    Notes
    -----
    A Markov chain over the last n - 1 looks, exact. With m = n = 1 its sum is the cumulative
    probability of detection 1 - Π(1 - Pd): J. D. Mallett and L. E. Brennan, "Cumulative
    probability of detection for targets approaching a uniformly scanning search radar", Proc. IEEE
    51(4), 1963.
    """
    if not (1 <= m <= n <= MOST_LOOKS):
        raise ValueError(f"m is {m} and n is {n}: they must be 1 <= m <= n <= {MOST_LOOKS}")
    chance = as_numbers("pd", pd)
    refuse("pd", chance, ~((chance >= 0.0) & (chance <= 1.0)), "lie in [0, 1]")
    states = 2 ** (n - 1)
    seen = np.array([state.bit_count() for state in range(states)])
    after_miss = (np.arange(states) << 1) & (states - 1)
    after_hit = after_miss | (1 if n > 1 else 0)
    declares = seen + 1 >= m
    weight = np.zeros((*chance.shape[:-1], states))
    weight[..., 0] = 1.0
    found = np.empty_like(chance)
    for look in range(chance.shape[-1]):
        hit = weight * chance[..., look, np.newaxis]
        found[..., look] = hit[..., declares].sum(axis=-1)
        moved = np.zeros_like(weight)
        for state in range(states):
            moved[..., after_miss[state]] += weight[..., state] - hit[..., state]
            if not declares[state]:
                moved[..., after_hit[state]] += hit[..., state]
        weight = moved
    return found
