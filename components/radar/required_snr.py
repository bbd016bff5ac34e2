"""The SNR that a radar needs for a wanted probability of detection."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from components.arguments.checks import checked_model, checked_probability, checked_pulses
from components.radar.detection_exact import exact_probability

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
        As for `components.radar.detection.detection_probability`, scalars.

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
    wanted = float(checked_probability("pd", pd))
    pfa = float(checked_probability("false_alarm_probability", false_alarm_probability))
    n = int(checked_pulses(pulses))
    name = checked_model(model)
    if wanted <= pfa:
        raise ValueError(
            f"pd is {wanted:g}: it must be above the false-alarm probability {pfa:g}, which noise "
            "alone reaches"
        )
    return _solved(wanted, pfa, n, name)


@lru_cache(maxsize=1024)
def _solved(wanted: float, pfa: float, n: int, name: str) -> float:
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
