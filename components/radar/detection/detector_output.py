"""The detector's output beyond its threshold: of echoes, and of noise alone (false alarms).

The sum of n pulses is Gamma(n, 1) for noise alone. An echo adds to it by its own fluctuation: a
steady one makes it noncentral, one that fluctuates from pulse to pulse (II and IV) spreads every
pulse, one that fluctuates from scan to scan (I and III) all of them at once.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from components.arguments.checks import (
    FloatArray,
    broadcast_flat,
    check_numbers,
    check_probability,
    check_pulses,
    check_swerling_model,
    refuse,
    unflatten,
)
from components.radar.detection.threshold import detection_threshold

# From this noncentrality on the amplitude is normal, to 1 in its square root.
_STRONG = 1e5
# An echo that weak, in all pulses together, has no shape of its own.
_TRACE = 1e-6
_STEPS = 90
# Powers beyond this range leave no digits.
_LOG_MOST = 600.0


def measured_snr_given_detection(
    tail: ArrayLike,
    snr: ArrayLike,
    *,
    threshold: ArrayLike,
    pulses: int = 1,
    model: str = "swerling2",
) -> Any:
    """Return detections' measured SNR, which a share `tail` of such detections exceeds.

    Detector output over its mean for noise, minus 1, linear, per pulse, from -1 on. `tail` in
    [0, 1] is the share of detections of such echoes that come out stronger, so that uniform numbers
    give the distribution; `snr` the echo's mean SNR per pulse, 0 for noise alone; `threshold` that
    of the sum of pulses, in units of a pulse's mean noise.

    The inverse of each model's own survival function: of the noncentral chi-square distribution (J.
    I. Marcum, RAND RM-754, 1947), and of those of P. Swerling, "Probability of detection for
    fluctuating targets", IRE Trans. IT-6(2), 1960. A noncentral one of more than 50 dB has a normal
    amplitude.
    """
    count, name = int(check_pulses(pulses)), check_swerling_model(model)
    shape, (share, mean, level) = broadcast_flat(
        tail=check_numbers("tail", tail),
        snr=check_numbers("snr", snr),
        threshold=check_numbers("threshold", threshold),
    )
    refuse("tail", share, ~((share >= 0.0) & (share <= 1.0)), "lie in [0, 1]")
    refuse("snr", mean, ~((mean >= 0.0) & np.isfinite(mean)), "be 0 or more")
    refuse("threshold", level, ~((level >= 0.0) & np.isfinite(level)), "be 0 or more")
    # A share of 0 is that of a draw below the last digit of a uniform number.
    share = np.maximum(share, 2.0**-54)
    with np.errstate(under="ignore"):  # far tails are 0
        output = _output_at_survival_share(share, mean, level, count, name)
    return unflatten(np.maximum(output, level) / count - 1.0, shape)


def _output_at_survival_share(
    share: FloatArray, snr: FloatArray, threshold: FloatArray, pulses: int, model: str
) -> FloatArray:
    if pulses == 1 and model in ("swerling1", "swerling2"):
        return threshold - (1.0 + snr) * np.log(share)
    output = np.empty_like(snr)
    # Without a trace of an echo all models are noise.
    gamma = (pulses * snr < _TRACE) | (model == "swerling2")
    scale = 1.0 + snr[gamma]
    output[gamma] = scale * _gamma_survival_quantile(share[gamma], threshold[gamma] / scale, pulses)
    rest = ~gamma
    solve = _steady_survival_quantile if model == "swerling0" else _bisect_output_at_share
    output[rest] = solve(share[rest], snr[rest], threshold[rest], pulses, model)
    return output


def _gamma_survival_quantile(share: FloatArray, threshold: FloatArray, pulses: int) -> FloatArray:
    from scipy.special import gammaincc, gammainccinv

    beyond = gammaincc(float(pulses), threshold)
    output: FloatArray = gammainccinv(float(pulses), beyond * share)
    # A tail that is 0 to a double is that of an exponential beyond its end.
    return np.where(np.isfinite(output), output, threshold - np.log(share))


def _steady_survival_quantile(
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
    beyond_it = 0.5 * chndtrix(1.0 - share[weak] * (1.0 - below), freedom, power)
    # Where hardly any such echo crosses, what does is a trace beyond the threshold.
    output[weak] = np.where(
        np.isfinite(beyond_it), beyond_it, threshold[weak] - np.log(share[weak])
    )
    return output


def _bisect_output_at_share(
    share: FloatArray, snr: FloatArray, threshold: FloatArray, pulses: int, model: str
) -> FloatArray:
    """Return, by bisection, the output with `share` times the threshold's survival chance."""

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
    """Return the chance that a Swerling I, III or IV echo's pulse sum exceeds an output."""
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


#: Resolution cells of a scan, and false alarms expected in one.
MOST_CELLS, MOST_FALSE_ALARMS = 10**15, 1e7


def false_alarm_count(uniform: ArrayLike, *, cells: int, false_alarm_probability: float) -> Any:
    """Return the number of false alarms of each scan: Binomial(cells, Pfa) from one uniform each.

    The smallest count whose cumulative probability exceeds the uniform number; over 1e7 expected
    ones are refused. The probabilities come from the most likely count outwards by exact ratios and
    are normalised by their own sum, so that no factorial of a large number is needed; counts with a
    probability below 1e-20 of the largest are left out. One table per (cells, Pfa), remembered.
    """
    number = _check_cells(cells)
    pfa = check_numbers("false_alarm_probability", false_alarm_probability)
    refuse(
        "false_alarm_probability",
        pfa,
        np.atleast_1d(~((pfa >= 0.0) & (pfa <= 1.0)) | (pfa.ndim > 0)),
        "be one number in [0, 1]",
    )
    draws = _check_uniform("uniform", uniform)
    if number * float(pfa) > MOST_FALSE_ALARMS:
        raise ValueError(
            f"false_alarm_probability is {float(pfa):g}: with {number:g} cells it must be at most "
            f"{MOST_FALSE_ALARMS / number:g}, for 1e7 false alarms in a scan"
        )
    first, cumulative = _binomial_start_and_cdf(number, float(pfa))
    index = np.searchsorted(cumulative, draws.reshape(-1), side="right")
    count = first + np.minimum(index, len(cumulative) - 1)
    return unflatten(count.astype(np.int64), draws.shape)


def false_alarm_snr(
    uniform: ArrayLike,
    *,
    false_alarm_probability: float,
    pulses: int = 1,
    threshold: float | None = None,
) -> Any:
    """Return false alarms' measured SNR: noise given that it crosses the threshold.

    One uniform number in [0, 1) each; the threshold follows from the probability where it is not
    given. Detector output over its mean, minus 1; linear, per pulse, never below 0.
    """
    draws = _check_uniform("uniform", uniform)
    if threshold is None:
        pfa = float(check_probability("false_alarm_probability", false_alarm_probability))
        threshold = float(detection_threshold(check_pulses(pulses), pfa))
    return np.maximum(
        measured_snr_given_detection(1.0 - draws, 0.0, threshold=threshold, pulses=pulses), 0.0
    )


def _check_uniform(name: str, value: ArrayLike) -> FloatArray:
    array = check_numbers(name, value)
    refuse(name, array, ~((array >= 0.0) & (array < 1.0)), "lie in [0, 1)")
    return array


def _check_cells(cells: int) -> int:
    if isinstance(cells, bool) or int(cells) != cells or not 0 <= cells <= MOST_CELLS:
        raise ValueError(f"cells is {cells!r}: it must be a whole number from 0 to 1e15")
    return int(cells)


@lru_cache(maxsize=256)
def _binomial_start_and_cdf(cells: int, probability: float) -> tuple[int, NDArray[np.float64]]:
    """Return the least count of relevant chance and the cumulative probabilities from it on."""
    if cells == 0 or probability == 0.0:
        return 0, np.array([1.0])
    if probability == 1.0:
        return cells, np.array([1.0])
    mode = min(cells, int((cells + 1) * probability))
    spread = math.sqrt(max(cells * probability * (1.0 - probability), 1.0))
    reach = int(10.0 * spread) + 60
    first, last = max(0, mode - reach), min(cells, mode + reach)
    odds = probability / (1.0 - probability)
    up = np.arange(mode, last, dtype=np.float64)
    down = np.arange(mode, first, -1, dtype=np.float64)
    with np.errstate(under="ignore"):  # the tails fade to 0
        above = np.cumprod((cells - up) / (up + 1.0) * odds)
        below = np.cumprod(down / ((cells - down + 1.0) * odds))
        weight = np.concatenate((below[::-1], [1.0], above))
        cumulative = np.cumsum(weight)
    cumulative /= cumulative[-1]
    cumulative.flags.writeable = False
    return first, cumulative
