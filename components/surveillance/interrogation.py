"""Interrogations of transponders: how often they answer, how far, and how coarse bearings are.

Numbers of RTCA DO-365, appendix Q: active surveillance of Mode S and Mode C.
"""

from __future__ import annotations

import numpy as np

from components.arguments.units import FOOT_M, NAUTICAL_MILE_M
from dsa_des.arrays.types import BoolArray, FloatArray

#: Farthest answers: Mode S all round, Mode C ahead (within 45°), at the side (135°) and behind.
MODE_S_REACH_M = 15.6 * NAUTICAL_MILE_M
MODE_C_REACH_M = (20.6 * NAUTICAL_MILE_M, 14.3 * NAUTICAL_MILE_M, 8.0 * NAUTICAL_MILE_M)
AHEAD_RAD, SIDE_RAD = np.radians(45.0), np.radians(135.0)
#: Rounds of interrogations are 0.1 s apart; an answer counts if any of the last ten came.
ROUND_S, ROUNDS = 0.1, 10
#: Probability of an answer in 1 s, to Mode S and to Mode C.
IN_1_S = (0.95, 0.90)
#: Standard deviation of bearings within 10° of the antenna's plane and beyond; cut at three.
BEARING_RAD = np.radians(np.array([9.0, 15.0]))
LEVEL_RAD, CUT = np.radians(10.0), 3.0
#: From fixed distances of transponders' delays: to Mode S and to Mode C.
RANGE_BIAS_M = (125.0 * FOOT_M, 250.0 * FOOT_M)
RANGE_ERROR_M, RANGE_CORRELATION_S = 50.0 * FOOT_M, 1.0


def transponder_reach_m(bearing_rad: FloatArray, mode_s: BoolArray) -> FloatArray:
    """Return a Mode S or C transponder's reach (m) at bearings from the nose, in [-pi, pi]."""
    off = np.abs(bearing_rad)
    ahead, side, behind = MODE_C_REACH_M
    mode_c = np.where(off <= AHEAD_RAD, ahead, np.where(off <= SIDE_RAD, side, behind))
    return np.where(mode_s, MODE_S_REACH_M, mode_c)


def answer_probability_per_round(in_1_s: FloatArray) -> FloatArray:
    """Return the probability of an answer in a round, from that of any in a second's ten."""
    return np.asarray(1.0 - (1.0 - in_1_s) ** (1.0 / ROUNDS))


def bearing_deviation_rad(elevation_rad: FloatArray) -> FloatArray:
    """Return the bearing's standard deviation, rad, larger at steep elevations up or down."""
    return np.where(np.abs(elevation_rad) <= LEVEL_RAD, *BEARING_RAD)


def is_met_within(range_m: FloatArray, range_rate_m_s: FloatArray, within_s: float) -> BoolArray:
    """Return which aircraft approach with range / closing speed at most `within_s` (mask)."""
    return np.asarray((range_rate_m_s < 0.0) & (range_m <= -range_rate_m_s * within_s))


def sine_of_elevation(above_m: FloatArray, range_m: FloatArray) -> FloatArray:
    """Return the sine of elevation to `above_m` higher at `range_m` (slant), on a curved Earth."""
    share = np.clip(above_m / range_m, -1.0, 1.0)
    sagging = range_m / (2.0 * 6_371_000.0) * (1.0 - share**2)
    return np.asarray(np.clip(share - sagging, -1.0, 1.0))
