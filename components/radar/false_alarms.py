"""The number of false alarms of a radar scan, and their places.

Pure functions of uniform numbers in [0, 1), which the block draws with its own keys.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from components.arguments.checks import (
    FloatArray,
    as_numbers,
    checked_probability,
    checked_pulses,
    refuse,
    unflatten,
)
from components.radar.measured_snr import measured_snr
from components.radar.resolution_cells import MOST_CELLS
from components.radar.threshold import detection_threshold

MOST_FALSE_ALARMS = 1e7


def false_alarm_count(uniform: ArrayLike, *, cells: int, false_alarm_probability: float) -> Any:
    """Return the number of false alarms of each scan: Binomial(cells, Pfa) from one uniform each.

    Parameters
    ----------
    uniform : array_like
        In [0, 1), one per scan.
    cells : int
        Resolution cells looked at in a scan, 0 or more.
    false_alarm_probability : float
        Per cell and look, in [0, 1].

    Returns
    -------
    array of int64, the shape of `uniform`

    Raises
    ------
    ValueError
        If an argument is out of range, or more than 1e7 false alarms are expected in a scan.

    Notes
    -----
    The smallest count whose cumulative probability exceeds the uniform number. The probabilities
    come from the most likely count outwards by exact ratios and are normalised by their own sum,
    so that no factorial of a large number is needed; counts with a probability below 1e-20 of the
    largest are left out. One table per (cells, Pfa), remembered.
    """
    number = _checked_cells(cells)
    pfa = as_numbers("false_alarm_probability", false_alarm_probability)
    refuse(
        "false_alarm_probability",
        pfa,
        np.atleast_1d(~((pfa >= 0.0) & (pfa <= 1.0)) | (pfa.ndim > 0)),
        "be one number in [0, 1]",
    )
    draws = _checked_uniform("uniform", uniform)
    if number * float(pfa) > MOST_FALSE_ALARMS:
        raise ValueError(
            f"false_alarm_probability is {float(pfa):g}: with {number:g} cells it must be at most "
            f"{MOST_FALSE_ALARMS / number:g}, for 1e7 false alarms in a scan"
        )
    first, cumulative = _binomial(number, float(pfa))
    place = np.searchsorted(cumulative, draws.reshape(-1), side="right")
    found = first + np.minimum(place, len(cumulative) - 1)
    return unflatten(found.astype(np.int64), draws.shape)


def false_alarm_snr(
    uniform: ArrayLike,
    *,
    false_alarm_probability: float,
    pulses: int = 1,
    threshold: float | None = None,
) -> Any:
    """Return the SNR that a false alarm seems to have: noise, given that it crosses the threshold.

    Parameters
    ----------
    uniform : array_like
        In [0, 1), one per false alarm.
    false_alarm_probability : float
        Strictly between 0 and 1; it sets the threshold.
    pulses : int
        Pulses summed non-coherently.
    threshold : float, optional
        The threshold itself, where it is known.

    Returns
    -------
    array, linear power ratio per pulse
        Detector output over its mean, minus 1; never below 0.

    Raises
    ------
    ValueError
        If an argument is out of range.
    """
    draws = _checked_uniform("uniform", uniform)
    if threshold is None:
        pfa = float(checked_probability("false_alarm_probability", false_alarm_probability))
        threshold = float(detection_threshold(checked_pulses(pulses), pfa))
    return measured_snr(1.0 - draws, 0.0, threshold=threshold, pulses=pulses)


def _checked_uniform(name: str, value: ArrayLike) -> FloatArray:
    array = as_numbers(name, value)
    refuse(name, array, ~((array >= 0.0) & (array < 1.0)), "lie in [0, 1)")
    return array


def _checked_cells(cells: int) -> int:
    if isinstance(cells, bool) or int(cells) != cells or not 0 <= cells <= MOST_CELLS:
        raise ValueError(f"cells is {cells!r}: it must be a whole number from 0 to 1e15")
    return int(cells)


@lru_cache(maxsize=256)
def _binomial(cells: int, probability: float) -> tuple[int, NDArray[np.float64]]:
    """Return the first count that matters and the cumulative probabilities from it on."""
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
