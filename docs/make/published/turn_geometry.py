"""The latest turn that clears a disc, from geometry alone, and how NRC's search would count it.

Flat, and in closed form but for one integral: with roll rate p the bank is p t until it is φ, so
the heading has turned by -g / (v p) · ln cos(p t) until then and by g tan φ / v a second after it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from functools import cache

import numpy as np
from numpy.typing import NDArray

from components.arguments.units import FOOT_M, NAUTICAL_MILE_M, STANDARD_GRAVITY_M_S2
from dsa_des.arrays.types import FloatArray

OWN_MPS = 60.0 * NAUTICAL_MILE_M / 3600.0
DISC_M = 500.0 * FOOT_M
BANK_RAD, ROLL_RATE_RAD_S = math.radians(45.0), math.radians(10.0)
#: Their simulations begin so long before the collision, go by such a step, and count a turn two
#: steps later than the state that it begins from; they halve the time so many times.
BEFORE_S, TIME_STEP_S, STEPS_LATE, HALVINGS = 190.0, 0.1, 2, 10

_FINE_S, _UNTIL_S = 0.002, 40.0


def turned_rad(time_s: FloatArray) -> FloatArray:
    """Return by how much the heading has turned so long after the turn began, if it never ends."""
    full_s = BANK_RAD / ROLL_RATE_RAD_S
    scale = STANDARD_GRAVITY_M_S2 / OWN_MPS
    rolling = (
        -scale / ROLL_RATE_RAD_S * np.log(np.cos(ROLL_RATE_RAD_S * np.minimum(time_s, full_s)))
    )
    turned: FloatArray = rolling + scale * math.tan(BANK_RAD) * np.maximum(time_s - full_s, 0.0)
    return turned


@cache
def _own_way(turn_deg: float, side: float) -> FloatArray:
    """Return how far east and north the ownship is by when it turns, at fine steps."""
    turned = np.minimum(turned_rad(np.arange(0.0, _UNTIL_S, _FINE_S)), math.radians(turn_deg))
    velocity = OWN_MPS * np.stack([np.sin(side * turned), np.cos(turned)])
    middle = 0.5 * (velocity[:, 1:] + velocity[:, :-1]) * _FINE_S
    return np.concatenate([np.zeros((2, 1)), np.cumsum(middle, axis=1)], axis=1)


def least_range_m(
    azimuth_deg: float,
    closing_mps: float,
    turns_deg: Iterable[float],
    sides: Sequence[float] = (-1.0, 1.0),
) -> float:
    """Return the range at which the latest of some turns clears the disc, to the better side.

    Sides are -1 (to the left) and 1. The intruder closes in from an azimuth on a collision course.
    What it has to be clear of is |R line + off(t)| = D with off the way of the intruder less the
    own one since the turn began, so R is the largest root of all times.
    """
    time_s = np.arange(0.0, _UNTIL_S, _FINE_S)
    azimuth = math.radians(azimuth_deg)
    line = np.array([math.sin(azimuth), math.cos(azimuth)])
    intruder = np.array([0.0, OWN_MPS]) - closing_mps * line
    least = math.inf
    for turn_deg in turns_deg:
        for side in sides:
            off = intruder[:, np.newaxis] * time_s - _own_way(turn_deg, side)
            along = line @ off
            root = along**2 - (off**2).sum(axis=0) + DISC_M**2
            met = root >= 0.0
            least = min(least, float((np.sqrt(root[met]) - along[met]).max()))
    return least


def stepped_least_range_m(
    azimuth_deg: float,
    closing_mps: float,
    turns_deg: Iterable[float],
    sides: Sequence[float] = (-1.0, 1.0),
) -> float:
    """Return the same range of turns that go by steps, as NRC's do.

    The bank of a step is that of its end. A turn ends before the step that would go beyond it; from
    there both fly straight, the ownship exactly along what it turned to, and the intruder a step
    ahead. Of the turn the ends of steps have to be clear of the disc, of the straight part the
    closest approach, if it is still to come. Numbers are complex: north, and east times i.
    """
    line = complex(math.cos(math.radians(azimuth_deg)), math.sin(math.radians(azimuth_deg)))
    intruder = OWN_MPS - closing_mps * line
    least = math.inf
    for turn_deg in turns_deg:
        for side in sides:
            own = _stepped_way(turn_deg, side)
            off = intruder * TIME_STEP_S * np.arange(len(own)) - own
            along = (off * line.conjugate()).real
            root = along**2 - np.abs(off) ** 2 + DISC_M**2
            met = root >= 0.0
            turning_m = float((np.sqrt(root[met]) - along[met]).max())
            heading = side * math.radians(turn_deg)
            away = intruder - OWN_MPS * complex(math.cos(heading), math.sin(heading))
            apart = complex(off[-1]) + intruder * TIME_STEP_S
            least = min(least, max(turning_m, _straight_m(line, apart, away)))
    return least


@cache
def _stepped_way(turn_deg: float, side: float) -> NDArray[np.complex128]:
    """Return where the ownship is at the ends of the steps of a turn, by their equations."""
    bank = ROLL_RATE_RAD_S * TIME_STEP_S * np.arange(1, round(_UNTIL_S / TIME_STEP_S))
    angle = STANDARD_GRAVITY_M_S2 / OWN_MPS * np.tan(np.minimum(bank, BANK_RAD)) * TIME_STEP_S
    turns = 1.0 - 0.5 * angle**2 + 1j * side * angle
    taken = int((np.cumsum(np.abs(np.angle(turns))) <= math.radians(turn_deg)).sum())
    velocity = OWN_MPS * np.concatenate([[1.0], np.cumprod(turns[: taken - 1])])
    moved = TIME_STEP_S * velocity * (1.0 + 0.5j * side * angle[:taken])
    return np.concatenate([[0.0], np.cumsum(moved)])


def _straight_m(line: complex, apart: complex, away: complex) -> float:
    """Return up to which range r a point at r·line + apart, moving so, still meets the disc."""
    course = away / abs(away)
    side, aside = (line.conjugate() * course).imag, (apart.conjugate() * course).imag
    ahead, past = (line.conjugate() * course).real, (apart.conjugate() * course).real
    # It is met at |r side + aside| < D, and only if that lies ahead: r ahead + past < 0.
    low, high = sorted((one - aside) / (side or 1e-12) for one in (-DISC_M, DISC_M))
    if ahead < 0.0:
        low = max(low, -past / ahead)
    else:
        high = min(high, -past / (ahead or 1e-12))
    return high if high > low else -math.inf


def as_searched_m(range_m: float, closing_mps: float) -> float:
    """Return what NRC's search makes of the least range of its turns.

    It halves the time from the start to where the disc's modified tau ends ten times, takes the
    last of these instants, to the next tenth of a second, at which a turn still clears the disc,
    and counts the range from modified tau: D² / (190 s v) less than what is left to the collision.
    """
    short_s = DISC_M**2 / (BEFORE_S * closing_mps**2)
    end_s = _to_next_step(np.array([BEFORE_S - short_s]))[0]
    instants_s = _to_next_step(end_s * np.arange(2**HALVINGS + 1) / 2**HALVINGS)
    latest_s = BEFORE_S - range_m / closing_mps + STEPS_LATE * TIME_STEP_S
    in_time_s = instants_s[instants_s <= latest_s + 1e-9]
    if not len(in_time_s):  # slower than by its disc in so long: no turn of theirs is early enough
        return math.inf
    return float((BEFORE_S - short_s - float(in_time_s.max())) * closing_mps)


def _to_next_step(time_s: FloatArray) -> FloatArray:
    steps: FloatArray = np.ceil(np.round(time_s / TIME_STEP_S, 6)) * TIME_STEP_S
    return steps
