"""The probability that the radar detects, or misses, an echo of a given SNR."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from components.arguments.checks import (
    FloatArray,
    broadcast_flat,
    checked_model,
    checked_probability,
    checked_pulses,
    checked_snr,
    one_of,
    unflatten,
)
from components.radar.detection_albersheim import albersheim_probability
from components.radar.detection_exact import exact_probability
from components.radar.detection_gram_charlier import gram_charlier_probability
from components.radar.detection_shnidman import shnidman_probability
from components.radar.detection_table import table_probability
from components.radar.threshold import detection_threshold

__all__ = ["METHODS", "detection_probability", "detection_threshold", "miss_probability"]

# A rung computes Pd for flat SNR and one (pulses, false_alarm_probability, model).
Rung = Callable[[FloatArray, int, float, str], FloatArray]

_RUNGS: dict[str, Rung] = {
    "table": table_probability,
    "gram_charlier": gram_charlier_probability,
    "shnidman": shnidman_probability,
    "albersheim": albersheim_probability,
}

METHODS = ("exact", *_RUNGS)


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
        ``gram_charlier``, ``shnidman``, ``albersheim``: published approximations, see their
        modules `components.radar.detection_<method>` for what they cover and how far they are off.

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
    are in `detection_series`.
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
    """`detection_probability` for a flat contiguous SNR and one radar, all of it checked."""
    if method == "exact":
        return exact_probability(snr, pulses, false_alarm_probability, model, miss=False)
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
    name = checked_model(model)
    one_of("method", method, METHODS)
    shape, ratio, groups = _group(checked_snr(snr), pulses, false_alarm_probability)
    result = np.empty_like(ratio)
    # Tiny SNR and probabilities fade to 0; that is their value, not an error.
    with np.errstate(under="ignore"):
        for chosen, count, alarm in groups:
            part, radar = ratio[chosen], (int(count), float(alarm), name)
            if method == "exact":
                result[chosen] = exact_probability(part, *radar, miss=miss)
            else:
                found = _RUNGS[method](part, *radar)
                result[chosen] = 1.0 - found if miss else found
    return unflatten(result, shape)


def _group(
    snr: FloatArray, pulses: ArrayLike, false_alarm_probability: ArrayLike
) -> tuple[tuple[int, ...], FloatArray, list[tuple[Any, float, float]]]:
    """Return the shape, flat SNR, and which elements have which pulses and false alarms."""
    n = checked_pulses(pulses)
    pfa = checked_probability("false_alarm_probability", false_alarm_probability)
    if n.ndim == 0 and pfa.ndim == 0:
        flat = np.ascontiguousarray(snr).reshape(-1)
        return snr.shape, flat, [(slice(None), float(n), float(pfa))]
    shape, (flat, n, pfa) = broadcast_flat(snr=snr, pulses=n, false_alarm_probability=pfa)
    pairs, member = np.unique(np.stack([n, pfa]), axis=1, return_inverse=True)
    member = member.reshape(-1)
    groups = [(member == i, pairs[0, i], pairs[1, i]) for i in range(pairs.shape[1])]
    return shape, flat, groups
