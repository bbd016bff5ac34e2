"""Visual acquisition: Andrews's rate, its integral, and a search that comes round.

The rate at which somebody who looks out first sees an aircraft goes with the solid angle that it
subtends, β A / r², less what the air takes of its contrast: J. W. Andrews, Modeling of air-to-air
visual acquisition, The Lincoln Laboratory Journal 2, 1989, and Air-to-air visual acquisition
handbook, MIT Lincoln Laboratory ATC-151, 1991. Acquisitions are a Poisson process of that rate.
Pure functions; the block draws with its own keys.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from components.arguments.checks import (
    broadcast_flat,
    check_not_negative,
    check_positive,
    unflatten,
)
from dsa_des.arrays.types import BoolArray, FloatArray, IntArray

#: Per steradian and second, of pilots whom nothing has told where to look (ATC-152, 1991).
UNALERTED_PER_SR_S = 17_000.0
#: Optical depth of a path as long as the visual range of the handbook: 5 % of contrast are left.
VISUAL_RANGE_DEPTH = 2.996

# Parts of an interval at whose ends it is asked whether something shows.
_SUBINTERVALS = 4
# An end of what shows is found to 2^-30 of a part.
_HALVINGS = 30
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(8)

#: Of some cells at some seconds later each: what is wanted.
AtInstants = Callable[[IntArray, FloatArray], Any]


def acquisition_rate_per_s(
    area_m2: ArrayLike,
    range_m: ArrayLike,
    *,
    beta_per_sr_s: ArrayLike = UNALERTED_PER_SR_S,
    extinction_per_m: ArrayLike = 0.0,
) -> Any:
    """Return Andrews's rate of acquisition, β A / r² · exp(-extinction · r), 1/s.

    The extinction of the air is 2.996 over the visual range (5 % of contrast), or 3.912 over the
    visibility (2 %). ValueError where an argument is out of range or not finite.
    """
    shape, (area, distance, beta, extinction) = broadcast_flat(
        area_m2=check_not_negative("area_m2", area_m2),
        range_m=check_positive("range_m", range_m),
        beta_per_sr_s=check_not_negative("beta_per_sr_s", beta_per_sr_s),
        extinction_per_m=check_not_negative("extinction_per_m", extinction_per_m),
    )
    with np.errstate(under="ignore"):
        return unflatten(beta * area / distance**2 * np.exp(-extinction * distance), shape)


def integrated_acquisition_rate(
    area_m2: float,
    closing_mps: float,
    *,
    from_m: float,
    to_m: float,
    beta_per_sr_s: float = UNALERTED_PER_SR_S,
    extinction_per_m: float = 0.0,
) -> float:
    """Return the acquisition rate integrated over time while an aircraft closes from `from_m` to
    `to_m` at constant speed (dimensionless).

    β A / V · (E2(k r)/r at `to_m` less that at `from_m`) with the extinction k and E2 the
    exponential integral; `from_m` may be infinite. The probability of acquisition is
    1 - exp(-integral).

    Raises
    ------
    ValueError
        If an argument is out of range, or `from_m` is nearer than `to_m`.
    """
    from scipy.special import expn

    nearest = float(check_positive("to_m", to_m))
    if not from_m >= nearest:
        raise ValueError(f"from_m is {from_m:g}: it must be at least to_m, {nearest:g}")
    extinction = float(check_not_negative("extinction_per_m", extinction_per_m))

    def illuminance_beyond(range_m: float) -> float:
        return float(expn(2, extinction * range_m)) / range_m if range_m < np.inf else 0.0

    scale = float(check_not_negative("beta_per_sr_s", beta_per_sr_s))
    scale *= float(check_not_negative("area_m2", area_m2)) / float(
        check_positive("closing_mps", closing_mps)
    )
    return scale * (illuminance_beyond(nearest) - illuminance_beyond(from_m))


def search_round_look_probability(
    closing_mps: float, *, from_m: float, to_m: float, round_s: float, looking: float = 1.0
) -> float:
    """Return the chance that a search per `round_s` looks at an aircraft from `from_m` to `to_m`.

    The place of the aircraft is looked at once in `round_s`, at a phase that is as likely as any
    other; it shows from `from_m` on and must be seen by `to_m`. `looking` is the probability that
    somebody looks out at all.
    """
    shows_s = max(from_m - to_m, 0.0) / float(check_positive("closing_mps", closing_mps))
    return looking * min(shows_s / float(check_positive("round_s", round_s)), 1.0)


def angular_size_rad(area_m2: FloatArray, range_m: FloatArray) -> FloatArray:
    """Return the angular diameter, rad, of a disc of this area at this range."""
    size: FloatArray = np.sqrt(area_m2 * (4.0 / np.pi)) / range_m
    return size


def max_visible_range_m(area_m2: float, smallest_rad: float) -> float:
    """Return the range (m) where a disc has the smallest visible angle; infinite if that is 0."""
    return float(np.sqrt(area_m2 * (4.0 / np.pi)) / smallest_rad) if smallest_rad else np.inf


def integrate_rate_while_shown(
    before_s: FloatArray, shown: AtInstants, rate: AtInstants
) -> FloatArray:
    """Return each cell's integral of a rate over the last `before_s` s, while the target shows.

    Whether something shows is asked at the ends of four parts of each interval; where it begins or
    ends to show within one, that instant is found by halving. Over each stretch the rate is
    integrated by Gauss and Legendre's rule of eight nodes. `shown` and `rate` (1/s) are given cells
    and seconds after them, 0 or less.
    """
    cell, begin, end = _shown_intervals(before_s, shown)
    integral = np.zeros(len(before_s))
    if not len(cell):
        return integral
    half = 0.5 * (end - begin)
    nodes = (0.5 * (begin + end))[:, np.newaxis] + half[:, np.newaxis] * _NODES
    values = rate(np.repeat(cell, len(_NODES)), nodes.reshape(-1)).reshape(nodes.shape)
    # Node by node, so that no sum depends on how many cells there are.
    total = np.zeros(len(cell))
    for column, weight in zip(values.T, _WEIGHTS, strict=True):
        total += weight * column
    np.add.at(integral, cell, half * total)
    return integral


def _shown_intervals(
    before_s: FloatArray, shown: AtInstants
) -> tuple[IntArray, FloatArray, FloatArray]:
    """Return shown intervals: index of the cell, begin, end (s; 0 is now, earlier negative)."""
    count = len(before_s)
    part = before_s / _SUBINTERVALS
    ends = [-before_s + k * part for k in range(_SUBINTERVALS)] + [np.zeros(count)]
    everyone = np.arange(count)
    shows = [np.asarray(shown(everyone, at), dtype=bool) for at in ends]
    always = np.logical_and.reduce(shows) & (before_s > 0.0)
    cells, begins, stops = [np.flatnonzero(always)], [-before_s[always]], [np.zeros(always.sum())]
    for k in range(_SUBINTERVALS):
        some = np.flatnonzero((shows[k] | shows[k + 1]) & ~always & (before_s > 0.0))
        if not len(some):
            continue
        left, right = ends[k][some], ends[k + 1][some]
        first, last = shows[k][some], shows[k + 1][some]
        edge = _visibility_change_s(some, left, right, first, last, shown)
        cells.append(some)
        begins.append(np.where(first, left, edge))
        stops.append(np.where(last, right, edge))
    return np.concatenate(cells), np.concatenate(begins), np.concatenate(stops)


def _visibility_change_s(
    cell: IntArray,
    left: FloatArray,
    right: FloatArray,
    first: BoolArray,
    last: BoolArray,
    shown: AtInstants,
) -> FloatArray:
    """Return when (s), from `left` to `right`, visibility changes, by halving; else `right`."""
    edge = right.copy()
    which = np.flatnonzero(first != last)
    low, high = left[which], right[which]
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        as_first = np.asarray(shown(cell[which], middle), dtype=bool) == first[which]
        low, high = np.where(as_first, middle, low), np.where(as_first, high, middle)
    edge[which] = high
    return edge
