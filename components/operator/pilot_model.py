"""How a published model of a pilot draws delays, pauses, and the sides and sizes of manoeuvres.

Numbers are those of release 6 of MIT Lincoln Laboratory's pilot model of its encounter simulation
(DEGAS), of which R. Guendel, M. Kuffner and D. Maki, "A model of unmanned aircraft pilot detect and
avoid maneuver decisions", MIT Lincoln Laboratory, ATC-434, 2017, tells how they were measured.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

from components.arguments.units import FOOT_M

#: Shape of the time that coordination with air traffic control takes, a gamma distribution.
COORDINATION_SHAPE = 5.5
#: With two ways out that differ by more, rad, the smaller change is always taken.
CLEARLY_SMALLER_RAD = math.radians(40.0)
#: Otherwise it is taken with this probability, and where not: left, and down, with these.
FOLLOWS_SMALLER, LEFT, DESCENDS = 0.8, 0.6, 0.5
_DEGREE = math.pi / 180.0


class Excess(NamedTuple):
    """How far beyond the smallest sufficient change a pilot steers: a shifted gamma law."""

    shape: float
    scale: float  # What is drawn is multiplied by the one, and lessened by the other
    less: float
    fixed: float  # Of the deterministic pilot


TURN = Excess(6.21, 9.67 * _DEGREE, 30.0 * _DEGREE, 30.0 * _DEGREE)
TURN_OTHER_SIDE = Excess(5.47, 8.25 * _DEGREE, 30.0 * _DEGREE, 15.0 * _DEGREE)
CLIMB = Excess(9.73, 207.98 * FOOT_M, 1500.0 * FOOT_M, 500.0 * FOOT_M)

# Least time to the next decision and the mean of what comes on top, s: without an alert, then by
# level 1 (preventive), 2 (corrective), 3 (warning).
_PAUSES = ((12.0, 12.0), (9.0, 6.0), (6.0, 3.0), (6.0, 3.0))


def exponential_quantile(uniform: float, mean: float) -> float:
    """Return the value of an exponential distribution for a uniform number in [0, 1)."""
    return -mean * math.log1p(-uniform)


def gamma_quantile(uniform: float, shape: float, scale: float) -> float:
    """Return the value of a gamma distribution for a uniform number in [0, 1)."""
    from scipy.special import gammaincinv  # only who draws pays for its import

    return float(scale * gammaincinv(shape, uniform))


def decision_pause_s(level: int, uniform: float) -> float:
    """Return a pilot's pause (s) before the next decision, for a uniform number in [0, 1)."""
    least, mean = _PAUSES[min(max(level, 0), len(_PAUSES) - 1)]
    return least + exponential_quantile(uniform, mean)


def mean_decision_pause_s(level: int) -> float:
    """Return the mean pause of a pilot before the next decision at an alert level, s."""
    least, mean = _PAUSES[min(max(level, 0), len(_PAUSES) - 1)]
    return least + mean


class Draws(NamedTuple):
    """Uniform numbers in [0, 1) for one steering decision."""

    follows: float
    side: float
    size: float


def commanded_change_out_of_band(
    changes: tuple[float, float], turns: bool, draws: Draws | None, goes_beyond: bool = True
) -> float:
    """Return the track (rad, positive right) or altitude (m, up) change to leave (low, high)."""
    low, high = changes
    if math.isinf(low) and math.isinf(high):
        return 0.0
    smaller_is_high = high <= -low
    to_high = smaller_is_high
    if draws is not None and math.isfinite(low) and math.isfinite(high):
        clear = turns and abs(high + low) > CLEARLY_SMALLER_RAD
        if not clear and draws.follows >= FOLLOWS_SMALLER:
            to_high = draws.side >= (LEFT if turns else DESCENDS)
    excess = CLIMB
    if turns:
        excess = TURN if to_high == smaller_is_high else TURN_OTHER_SIDE
    beyond = excess.fixed if goes_beyond else 0.0
    if draws is not None and goes_beyond:
        beyond = gamma_quantile(draws.size, excess.shape, excess.scale) - excess.less
    size = max((high if to_high else -low) + beyond, 0.0)
    if turns:
        size = min(size, math.pi)
    return size if to_high else -size


def reaction_and_execution_delays_s(
    uniforms: Sequence[float] | None, initial_s: float, coordination_s: float, execution_s: float
) -> tuple[float, float]:
    """Return the delay of reaction and coordination, and the delay of execution after it, s."""
    if uniforms is None:
        return initial_s + coordination_s, execution_s
    first, second, third = uniforms
    waits_s = exponential_quantile(first, initial_s)
    if coordination_s > 0.0:
        waits_s += gamma_quantile(second, COORDINATION_SHAPE, coordination_s / COORDINATION_SHAPE)
    return waits_s, exponential_quantile(third, execution_s)
