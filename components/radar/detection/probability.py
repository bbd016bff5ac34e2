"""The probability that a radar detects or misses an echo, and the SNR that it needs."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache, partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from components.arguments.checks import (
    FloatArray,
    broadcast_flat,
    check_numbers,
    check_one_of,
    check_probability,
    check_pulses,
    check_snr,
    check_swerling_model,
    refuse,
    unflatten,
)
from components.radar.detection.approximations import (
    albersheim_probability,
    gram_charlier_probability,
    shnidman_probability,
    table_probability,
)
from components.radar.detection.exact import exact_probability

# A rung computes Pd for flat SNR and one (pulses, false_alarm_probability, model).
Rung = Callable[[FloatArray, int, float, str], FloatArray]

_RUNGS: dict[str, Rung] = {
    "exact": partial(exact_probability, miss=False),
    "table": table_probability,
    "gram_charlier": gram_charlier_probability,
    "shnidman": shnidman_probability,
    "albersheim": albersheim_probability,
}

METHODS = tuple(_RUNGS)


def detection_probability(
    snr: ArrayLike,
    *,
    pulses: ArrayLike = 1,
    false_alarm_probability: ArrayLike,
    model: str = "swerling1",
    method: str = "exact",
) -> Any:
    """Return the probability of detection Pd of a square-law detector that sums pulses.

    Parameters
    ----------
    snr : array_like
        Mean signal-to-noise power ratio per pulse, linear, 0 to infinity. 0 gives exactly
        `false_alarm_probability`, infinity gives 1.
    pulses : array_like
        Number of pulses summed non-coherently, whole, 1 to 100,000 (checked up to 1000).
        Coherent gain belongs into the SNR, not here.
    false_alarm_probability : array_like
        Per look, strictly between 0 and 1 (accuracy checked from 1e-12 to 1e-1). The three
        arrays broadcast; each distinct pair of pulses and false-alarm probability is one pass.
    model : str
        ``swerling0`` (steady; also ``swerling5``), ``swerling1`` and ``swerling2`` (exponential,
        from scan to scan and from pulse to pulse), ``swerling3`` and ``swerling4`` (chi-square of
        4 degrees of freedom, likewise).
    method : str
        ``exact``: relative error below 1e-12 of Pd and of 1 - Pd above 1e-250.
        ``table``: absolute error below 1e-6 (measured 3e-8), for large arrays of one radar.
        ``gram_charlier``, ``shnidman``, ``albersheim``: published approximations;
        `components.radar.detection.approximations` says what they cover and how far they are off.

    Returns
    -------
    array of the broadcast shape
        Pd in [0, 1], never below the false-alarm probability (exact and table), rising with SNR.

    Raises
    ------
    ValueError
        If an argument is out of range or a name unknown, or if an approximation is asked for
        something outside its stated validity.

    Notes
    -----
    Noise alone is Gamma(pulses, 1) distributed; for the threshold see `detection_threshold`.
    Thesis eq. 25-32 for Swerling I and V, with the one-pulse case Pd = Pfa^(1/(1+SNR)); the sums
    are in `components.radar.detection.exact`.
    """
    return _probability(snr, pulses, false_alarm_probability, model, method, miss=False)


def miss_probability(
    snr: ArrayLike,
    *,
    pulses: ArrayLike = 1,
    false_alarm_probability: ArrayLike,
    model: str = "swerling1",
    method: str = "exact",
) -> Any:
    """Return the probability of a miss, 1 - Pd, to full relative accuracy however small it is.

    Parameters
    ----------
    snr, pulses, false_alarm_probability, model, method
        As for `detection_probability`. Only ``exact`` computes the miss by itself; the other
        methods return 1 minus their Pd, with their absolute error.

    Returns
    -------
    array of the broadcast shape
        1 - Pd in [0, 1]; fades to 0 below 1e-300.

    Raises
    ------
    ValueError
        As for `detection_probability`.
    """
    return _probability(snr, pulses, false_alarm_probability, model, method, miss=True)


def probability_of_cells(
    snr: FloatArray, pulses: int, false_alarm_probability: float, model: str, method: str
) -> FloatArray:
    """Return Pd by the named method for a flat contiguous array of valid SNR and one radar."""
    with np.errstate(under="ignore"):
        return _RUNGS[method](snr, pulses, false_alarm_probability, model)


def _probability(
    snr: ArrayLike,
    pulses: ArrayLike,
    false_alarm_probability: ArrayLike,
    model: str,
    method: str,
    *,
    miss: bool,
) -> Any:
    name = check_swerling_model(model)
    check_one_of("method", method, METHODS)
    shape, ratio, groups = _group_by_pulses_and_pfa(check_snr(snr), pulses, false_alarm_probability)
    result = np.empty_like(ratio)
    # Tiny SNR and probabilities fade to 0; that is their value, not an error.
    with np.errstate(under="ignore"):
        for chosen, count, alarm in groups:
            part, radar = ratio[chosen], (int(count), float(alarm), name)
            if miss and method == "exact":
                result[chosen] = exact_probability(part, *radar, miss=True)
            else:
                pd = _RUNGS[method](part, *radar)
                result[chosen] = 1.0 - pd if miss else pd
    return unflatten(result, shape)


def _group_by_pulses_and_pfa(
    snr: FloatArray, pulses: ArrayLike, false_alarm_probability: ArrayLike
) -> tuple[tuple[int, ...], FloatArray, list[tuple[Any, float, float]]]:
    """Return the broadcast shape, flat SNR, and (elements, pulses, Pfa) for each distinct pair."""
    n = check_pulses(pulses)
    pfa = check_probability("false_alarm_probability", false_alarm_probability)
    if n.ndim == 0 and pfa.ndim == 0:
        flat = np.ascontiguousarray(snr).reshape(-1)
        return snr.shape, flat, [(slice(None), float(n), float(pfa))]
    shape, (flat, n, pfa) = broadcast_flat(snr=snr, pulses=n, false_alarm_probability=pfa)
    pairs, member = np.unique(np.stack([n, pfa]), axis=1, return_inverse=True)
    member = member.reshape(-1)
    groups = [(member == i, pairs[0, i], pairs[1, i]) for i in range(pairs.shape[1])]
    return shape, flat, groups


# Every round evaluates this many points at once and keeps the interval between two of them.
_POINTS = 33


def required_snr(
    pd: float, *, pulses: int = 1, false_alarm_probability: float, model: str = "swerling1"
) -> float:
    """Return the mean SNR per pulse at which the exact Pd is `pd`.

    Parameters
    ----------
    pd : float
        Wanted probability of detection, above the false-alarm probability and below 1.
    pulses, false_alarm_probability, model
        As for `detection_probability`, scalars.

    Returns
    -------
    float
        Linear power ratio, to about 1e-15 relative.

    Raises
    ------
    ValueError
        If an argument is out of range or no SNR up to 1e30 gives `pd`.

    Notes
    -----
    Swerling I (and II) with one pulse in closed form, from Pd = Pfa^(1/(1+SNR)); the others by
    repeated subdivision of ln SNR.
    """
    wanted = float(check_probability("pd", pd))
    pfa = float(check_probability("false_alarm_probability", false_alarm_probability))
    n = int(check_pulses(pulses))
    name = check_swerling_model(model)
    if wanted <= pfa:
        raise ValueError(
            f"pd is {wanted:g}: it must be above the false-alarm probability {pfa:g}, which noise "
            "alone reaches"
        )
    return _solve_snr(wanted, pfa, n, name)


@lru_cache(maxsize=1024)
def _solve_snr(wanted: float, pfa: float, n: int, name: str) -> float:
    if n == 1 and name in ("swerling1", "swerling2"):
        return math.log(pfa / wanted) / math.log(wanted)
    low, high = math.log(1e-30), math.log(1e30)
    for _ in range(40):
        grid = np.linspace(low, high, _POINTS)
        # Near 1 the miss tells neighbouring SNR apart, Pd does not.
        if wanted < 0.5:
            reached = exact_probability(np.exp(grid), n, pfa, name, miss=False) >= wanted
        else:
            reached = exact_probability(np.exp(grid), n, pfa, name, miss=True) <= 1.0 - wanted
        if not reached[-1]:
            raise ValueError(f"pd is {wanted!r}: it must be reachable with an SNR of at most 1e30")
        first = int(np.argmax(reached))
        if first == 0:
            # Only in the first round: `wanted` is the false-alarm probability to the last digits.
            high = low
            break
        low, high = float(grid[first - 1]), float(grid[first])
        if high - low <= 4e-16 * max(1.0, abs(high)):
            break
    return math.exp(0.5 * (low + high))


#: Looks of the rule; the looks before are a state of their own each.
MOST_LOOKS = 12


def first_declaration_probability(pd: ArrayLike, m: int = 1, n: int = 1) -> FloatArray:
    """Return each look's chance of being the first with m detections within n looks.

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
    chance = check_numbers("pd", pd)
    refuse("pd", chance, ~((chance >= 0.0) & (chance <= 1.0)), "lie in [0, 1]")
    states = 2 ** (n - 1)
    seen = np.array([state.bit_count() for state in range(states)])
    after_miss = (np.arange(states) << 1) & (states - 1)
    after_hit = after_miss | (1 if n > 1 else 0)
    declares = seen + 1 >= m
    weight = np.zeros((*chance.shape[:-1], states))
    weight[..., 0] = 1.0
    first = np.empty_like(chance)
    for look in range(chance.shape[-1]):
        hit = weight * chance[..., look, np.newaxis]
        first[..., look] = hit[..., declares].sum(axis=-1)
        moved = np.zeros_like(weight)
        for state in range(states):
            moved[..., after_miss[state]] += weight[..., state] - hit[..., state]
            if not declares[state]:
                moved[..., after_hit[state]] += hit[..., state]
        weight = moved
    return first
