"""The smallest changes of a guidance value that lead out of its red band."""

import math
from typing import NamedTuple

from components.alert_configuration.configuration import REGIONS
from components.guidance.intervals import FULL_TURN, Band, same_place


class Resolution(NamedTuple):
    """Where the red band around the own value ends.

    Parameters
    ----------
    low, high : float
        The nearest values that are not red to either side: left and right, or down and up;
        infinite where there is none.
    prefers_high : bool
        Whether the right or upper one is nearer, or no farther.
    """

    low: float
    high: float
    prefers_high: bool


def resolution(
    bands: list[Band], own_value: float, corrective_region: str, cyclic: bool
) -> Resolution | None:
    """Return the way out of the red band that holds the own value, or None if it is in none.

    Parameters
    ----------
    bands : list of Band
        From the lowest to the highest value.
    own_value : float
    corrective_region : str
        Bands of at least this region are red, but those of recovery.
    cyclic : bool
        Whether the values are directions, from 0 to 2 pi.
    """
    least = REGIONS.index(corrective_region)
    red = [is_red(one, least) for one in bands]
    turns = (-FULL_TURN, 0.0, FULL_TURN) if cyclic else (0.0,)
    stretches: list[list[float]] = []
    for turn in turns:
        for band, counts in zip(bands, red, strict=True):
            if not counts:
                continue
            low, high = band.low + turn, band.high + turn
            if stretches and same_place(stretches[-1][1], low):
                stretches[-1][1] = high
            else:
                stretches.append([low, high])
    for low, high in stretches:
        on_edge = same_place(low, own_value) or same_place(high, own_value)
        if low < own_value < high and not on_edge:
            break
    else:
        return None
    first, last = bands[0].low + turns[0], bands[-1].high + turns[-1]
    low_end = -math.inf if same_place(low, first) else low
    high_end = math.inf if same_place(high, last) else high
    if cyclic:
        low_end = _direction(own_value, low_end, -math.inf)
        high_end = _direction(own_value, high_end, math.inf)
    down, up = away(own_value, low_end, cyclic), away(own_value, high_end, cyclic)
    nearer = up <= down or same_place(up, down)
    return Resolution(low_end, high_end, bool(math.isfinite(high_end) and nearer))


def is_red(band: Band, least: int) -> bool:
    """Tell whether a band is as bad as region number `least`; one of recovery never is."""
    return band.region != "RECOVERY" and REGIONS.index(band.region) >= least


def _direction(own_value: float, edge: float, none: float) -> float:
    """Return an edge within [0, 2 pi), or `none` if it is half a turn away or more."""
    way = abs(edge - own_value)
    if not math.isfinite(edge) or way >= math.pi or same_place(way, math.pi):
        return none
    wrapped = edge % FULL_TURN
    return 0.0 if same_place(wrapped, FULL_TURN) else wrapped


def away(own_value: float, edge: float, cyclic: bool) -> float:
    """Return how far an edge is from the own value, the shorter way round a circle."""
    way = abs(edge - own_value)
    return min(way, FULL_TURN - way) if cyclic and math.isfinite(way) else way
