"""The strength that a detection comes out with: the detector's output beyond its threshold.

The sum of n pulses is Gamma(n, 1) for noise alone. An echo adds to it by its own fluctuation: a
steady one makes it noncentral, one that fluctuates from pulse to pulse (II and IV) spreads every
pulse, one that fluctuates from scan to scan (I and III) all of them at once.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from components.arguments.checks import (
    FloatArray,
    as_numbers,
    broadcast_flat,
    checked_model,
    checked_pulses,
    refuse,
    unflatten,
)

# From this noncentrality on the amplitude is normal, to 1 in its square root.
_STRONG = 1e5
# An echo that weak, in all pulses together, has no shape of its own.
_TRACE = 1e-6
_STEPS = 90
# Powers beyond this range leave no digits.
_LOG_MOST = 600.0


def measured_snr(
    tail: ArrayLike,
    snr: ArrayLike,
    *,
    threshold: ArrayLike,
    pulses: int = 1,
    model: str = "swerling2",
) -> Any:
    """Return the SNR that a detection seems to have, given that it crosses the threshold.

    Parameters
    ----------
    tail : array_like
        In [0, 1], one per detection: the share of detections of such echoes that come out
        stronger. Uniform numbers give the distribution.
    snr : array_like
        The echo's mean SNR (linear, per pulse), 0 or more; 0 is noise alone.
    threshold : array_like
        That the sum of pulses crosses, 0 or more, in units of a pulse's mean noise.
    pulses : int
        Summed non-coherently.
    model : str
        ``swerling0`` (or ``swerling5``) … ``swerling4``.

    Returns
    -------
    array of the broadcast shape, linear power ratio per pulse
        Detector output over its mean for noise, minus 1; never below 0.

    Raises
    ------
    ValueError
        If an argument is out of range or the model unknown.

    Notes
    -----
    The inverse of each model's own survival function: of the noncentral chi-square distribution
    (J. I. Marcum, RAND RM-754, 1947), and of those of P. Swerling, "Probability of detection for
    fluctuating targets", IRE Trans. IT-6(2), 1960. A noncentral one of more than 50 dB has a normal
    amplitude.
    """
    count, name = int(checked_pulses(pulses)), checked_model(model)
    shape, (share, mean, level) = broadcast_flat(
        tail=as_numbers("tail", tail),
        snr=as_numbers("snr", snr),
        threshold=as_numbers("threshold", threshold),
    )
    refuse("tail", share, ~((share >= 0.0) & (share <= 1.0)), "lie in [0, 1]")
    refuse("snr", mean, ~((mean >= 0.0) & np.isfinite(mean)), "be 0 or more")
    refuse("threshold", level, ~((level >= 0.0) & np.isfinite(level)), "be 0 or more")
    # A share of 0 is that of a draw below the last digit of a uniform number.
    share = np.maximum(share, 2.0**-54)
    with np.errstate(under="ignore"):  # far tails are 0
        output = _beyond(share, mean, level, count, name)
    return unflatten(np.maximum(np.maximum(output, level) / count - 1.0, 0.0), shape)


def _beyond(
    share: FloatArray, snr: FloatArray, threshold: FloatArray, pulses: int, model: str
) -> FloatArray:
    if pulses == 1 and model in ("swerling1", "swerling2"):
        return threshold - (1.0 + snr) * np.log(share)
    output = np.empty_like(snr)
    # Without a trace of an echo all models are noise.
    gamma = (pulses * snr < _TRACE) | (model == "swerling2")
    scale = 1.0 + snr[gamma]
    output[gamma] = scale * _gamma_beyond(share[gamma], threshold[gamma] / scale, pulses)
    rest = ~gamma
    solve = _steady_beyond if model == "swerling0" else _solved_beyond
    output[rest] = solve(share[rest], snr[rest], threshold[rest], pulses, model)
    return output


def _gamma_beyond(share: FloatArray, threshold: FloatArray, pulses: int) -> FloatArray:
    from scipy.special import gammaincc, gammainccinv

    beyond = gammaincc(float(pulses), threshold)
    found: FloatArray = gammainccinv(float(pulses), beyond * share)
    # A tail that is 0 to a double is that of an exponential beyond its end.
    return np.where(np.isfinite(found), found, threshold - np.log(share))


def _steady_beyond(
    share: FloatArray, snr: FloatArray, threshold: FloatArray, pulses: int, model: str
) -> FloatArray:
    from scipy.special import chndtr, chndtrix, ndtr, ndtri

    output, freedom = np.empty_like(snr), 2.0 * pulses
    strong = freedom * snr > _STRONG
    middle = np.sqrt(freedom * snr[strong] + freedom - 1.0)
    beyond = ndtr(middle - np.sqrt(2.0 * threshold[strong]))
    above = np.clip(share[strong] * beyond, 1e-300, 1.0 - 2.0**-53)
    output[strong] = 0.5 * (middle - ndtri(above)) ** 2
    weak, power = ~strong, freedom * snr[~strong]
    below = chndtr(2.0 * threshold[weak], freedom, power)
    found = 0.5 * chndtrix(1.0 - share[weak] * (1.0 - below), freedom, power)
    # Where hardly any such echo crosses, what does is a trace beyond the threshold.
    output[weak] = np.where(np.isfinite(found), found, threshold[weak] - np.log(share[weak]))
    return output


def _solved_beyond(
    share: FloatArray, snr: FloatArray, threshold: FloatArray, pulses: int, model: str
) -> FloatArray:
    """Halve the interval in which the survival function is so much of that at the threshold."""

    def survival(output: FloatArray) -> FloatArray:
        return survival_of_sum(output, snr, pulses, model)

    wanted = share * survival(threshold)
    low = threshold.copy()
    high = threshold + (1.0 + pulses * snr) * (pulses + 40.0 - 2.0 * np.log(share))
    for _ in range(_STEPS):
        middle = 0.5 * (low + high)
        above = survival(middle) > wanted
        low, high = np.where(above, middle, low), np.where(above, high, middle)
    return 0.5 * (low + high)


def survival_of_sum(output: FloatArray, snr: FloatArray, pulses: int, model: str) -> FloatArray:
    """Return the probability that the sum of pulses of a fluctuating echo exceeds a value.

    Parameters
    ----------
    output, snr : (n,) arrays
        The value, 0 or more; the mean SNR of a pulse, above 0.
    pulses : int
    model : {"swerling1", "swerling3", "swerling4"}

    Returns
    -------
    (n,) array
    """
    from scipy.special import gammainc, gammaincc

    if model == "swerling4":
        # Each pulse is Gamma(2) of scale M but for a share 1/M of one of its two parts.
        scale = 1.0 + 0.5 * snr
        return _binomial_mixture(output / scale, 1.0 - 1.0 / scale, pulses)
    shape = 1 if model == "swerling1" else 2
    scale = 1.0 + pulses * snr / shape
    if pulses == shape:
        return gammaincc(float(shape), output / scale)
    if pulses < shape:
        return _binomial_mixture(output / scale, 1.0 - 1.0 / scale, 1)
    # Gamma(pulses - shape, 1) of noise and Gamma(shape, scale) of noise and echo.
    left, share = float(pulses - shape), 1.0 - 1.0 / scale
    alone = gammaincc(left, output)
    log = -output / scale - left * np.log(share)
    many = log > _LOG_MOST
    log = np.where(many, -np.inf, log)
    first = np.exp(log) * gammainc(left, share * output)
    if shape == 1:
        total = alone + first
    else:
        second = np.exp(log) / share * gammainc(left + 1.0, share * output)
        total = alone + (1.0 + output / scale) * first - left / scale * second
    # So weak an echo in so many pulses has no shape of its own.
    spread = gammaincc(float(pulses), output / (1.0 + snr))
    return np.where(many, spread, np.clip(total, 0.0, 1.0))


def _binomial_mixture(output: FloatArray, share: FloatArray, pulses: int) -> FloatArray:
    """Return the survival of Gamma(pulses + k), k being Binomial(pulses, share)."""
    from scipy.special import gammaincc, gammaln, xlog1py, xlogy

    total = np.zeros_like(output)
    for k in range(pulses + 1):
        ways = gammaln(pulses + 1.0) - gammaln(k + 1.0) - gammaln(pulses - k + 1.0)
        weight = np.exp(ways + xlogy(k, share) + xlog1py(pulses - k, -share))
        total += weight * gammaincc(float(pulses + k), output)
    return total
