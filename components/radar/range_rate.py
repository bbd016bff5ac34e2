"""The true rate of the slant range as an effect: what a radar's Doppler shift comes from."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from components.geometry.ellipsoid import north_east_up
from components.sensor.look import Cells
from dsa_des.arrays.types import FloatArray, IntArray
from dsa_des.block.effect import Effect, Verdict

# Ranges this far apart in time: at a passage of 150 m/s at 500 m the rule below errs by 1e-7 m/s,
# as much as the rounding of positions does.
STEP_S = 0.02
#: How far a look reaches beyond its instant.
LASTS_S = 4.0 * STEP_S
#: Points in steps and their weights, of rules of the fourth order: about the instant, and from it
#: on or up to it where a flight begins or ends there.
_CENTRAL = (-2.0, -1.0, 1.0, 2.0), (1.0 / 12.0, -8.0 / 12.0, 8.0 / 12.0, -1.0 / 12.0)
_AHEAD = (0.0, 1.0, 2.0, 3.0, 4.0), (-25.0 / 12.0, 4.0, -3.0, 4.0 / 3.0, -1.0 / 4.0)
_BEHIND = tuple(-point for point in _AHEAD[0]), tuple(-weight for weight in _AHEAD[1])


class RangeRate(Effect):
    """Rate of the slant range between the two aircraft, as they fly."""

    lockstep = True
    name = "range rate"
    acts_on = "range rate"
    neutral = False
    outside_the_proof = "it fills columns that are null without it"

    def verdict(self, block: Any) -> Verdict:
        """Ask for ``measures_range_rate``."""
        return Verdict.of_flag(block.p, "measures_range_rate")

    def build(self, block: Any) -> Any:
        """Return what gives the rates of some cells."""
        return range_rates


def range_rates(cells: Cells, found: IntArray) -> FloatArray:
    """Return the rate of the slant range of some cells, positive when it opens.

    Parameters
    ----------
    cells : Cells
    found : (n,) of int

    Returns
    -------
    (n,) array, m/s

    Raises
    ------
    ValueError
        If the targets are not known at other instants than those of the rows.

    Notes
    -----
    Differences of the range itself over a few hundredths of a second, by the scene's own model of
    the Earth, whatever the two fly. Where one of them changes its velocity at once within that
    time, the rate is between the one before and the one after.
    """
    (rate,) = _rates_of(cells, found, lambda seen, times: (seen["range_m"],))
    return rate


def motion_of_cells(cells: Cells) -> tuple[FloatArray, tuple[FloatArray, FloatArray, FloatArray]]:
    """Return the rate of each cell's slant range, and how the ownship moves then.

    Parameters
    ----------
    cells : Cells

    Returns
    -------
    range_rate_m_s : (cells,)
        Positive when it opens.
    velocity_m_s : (north, east, down), each (cells,)
        Of the ownship over ground, in its own north-east-down frame.

    Raises
    ------
    ValueError
        As for `range_rates`.
    """

    def quantities(seen: Mapping[str, Any], times: int) -> tuple[FloatArray, ...]:
        there = [seen[f"own_{name}"] for name in ("lat_deg", "lon_deg", "alt_m")]
        # From where it is at the first of the times: so near that the frame is the same.
        first = [np.tile(values[: len(values) // times], times) for values in there]
        return (seen["range_m"], *north_east_up(*first, *there))

    rate, north, east, up = _rates_of(cells, np.arange(len(cells)), quantities)
    return rate, (north, east, -up)


def _rates_of(
    cells: Cells,
    found: IntArray,
    quantities: Callable[[Mapping[str, Any], int], tuple[FloatArray, ...]],
) -> list[FloatArray]:
    """Return the rates of quantities of some cells, from differences over a few steps."""
    rates: list[FloatArray] = []
    missing = np.arange(len(found))
    for points, weights in (_CENTRAL, _AHEAD, _BEHIND):
        if len(missing) == 0 and rates:
            break
        each, times = found[missing], len(points)
        ahead_s = np.repeat(np.array(points) * STEP_S, len(each))
        seen = cells.seen_at(np.tile(each, times), ahead_s)
        for number, values in enumerate(quantities(seen, times)):
            if number == len(rates):
                rates.append(np.full(len(found), np.nan))
            total = np.zeros(len(each))
            for weight, value in zip(weights, values.reshape(times, -1), strict=True):
                total += weight * value
            rates[number][missing] = total / STEP_S
        missing = missing[~seen["present"].reshape(times, -1).all(axis=0)]
    return rates
