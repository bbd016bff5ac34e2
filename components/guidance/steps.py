"""Manoeuvres in equal steps of direction or speed, to either side, with the flight after each.

A manoeuvre ends in straight flight; that flight is run back to time 0, so that closed forms for
straight flights apply to it from the manoeuvre's end on.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from components.guidance.situation import State
from dsa_des.arrays.types import BoolArray, FloatArray, IntArray


class Steps(NamedTuple):
    """Manoeuvres of n ownships from the leftmost or lowest to the rightmost or highest.

    Parameters
    ----------
    number : (k,) of int
        Signed number of steps from the own value, ascending; 0 is no manoeuvre.
    there : (n, k) of bool
        Whether an ownship has that manoeuvre within its limits.
    time_s : (n, k) or (1, k)
        When each manoeuvre ends.
    step_time_s : (n, 1) or (1, 1)
        Of one step; 0 for those that take no time.
    flight : State of (n, k) or (n, 1)
        The flight after it, run back to time 0.
    """

    number: IntArray
    there: BoolArray
    time_s: FloatArray
    step_time_s: FloatArray
    flight: State


def direction_steps(own: State, values: Any) -> Steps:
    """Return turns by multiples of a step to the left and right.

    Parameters
    ----------
    own : State of (n,)
    values : mapping
        Values of a configuration, by key.
    """
    own = own.columns()
    step = values["step_hdir"]
    # A flight slower than a step is turned as if it flew that fast.
    least = max(values["step_hs"], values["min_airspeed"])
    speed = np.maximum(np.hypot(own.east_mps, own.north_mps), least)
    rate = np.full((1, 1), float(values["turn_rate"]))
    if values["turn_rate"] == 0.0 and values["bank_angle"] > 0.0:
        rate = 9.80665 * math.tan(values["bank_angle"]) / speed
    left, right = (_turns(values[key], step) for key in ("left_hdir", "right_hdir"))
    number = np.arange(-left, right + 1)
    track = np.arctan2(own.east_mps, own.north_mps)
    turned = track + number * step
    v_east, v_north = speed * np.sin(turned), speed * np.cos(turned)
    if not rate.any():
        step_time_s = np.zeros((1, 1))
        time_s = np.zeros((1, len(number)))
        east, north = own.east_m, own.north_m
    else:
        step_time_s = step / rate
        time_s = np.abs(number) * step_time_s
        radius = np.where(number < 0, -speed / rate, speed / rate)
        east = own.east_m + radius * (np.cos(track) - np.cos(turned)) - v_east * time_s
        north = own.north_m + radius * (np.sin(turned) - np.sin(track)) - v_north * time_s
    flight = State(east, north, own.up_m, v_east, v_north, own.climb_mps)
    return Steps(number, np.ones(turned.shape, dtype=bool), time_s, step_time_s, flight)


def speed_steps(own: State, values: Any) -> Steps:
    """Return changes of ground speed along the track; it may pass through zero."""
    speed = np.hypot(own.east_mps, own.north_mps)
    limits = limits_of("hs", speed, values)
    changed = _changes(speed, *limits, values["step_hs"], values["horizontal_accel"])
    own = own.columns()
    track = np.arctan2(own.east_mps, own.north_mps)
    east, north = np.sin(track), np.cos(track)
    flight = State(
        own.east_m + changed.back * east,
        own.north_m + changed.back * north,
        own.up_m,
        changed.rate * east,
        changed.rate * north,
        own.climb_mps,
    )
    return Steps(changed.number, changed.there, changed.time_s, changed.step_time_s, flight)


def climb_steps(own: State, values: Any) -> Steps:
    """Return changes of vertical speed."""
    limits = limits_of("vs", own.climb_mps, values)
    changed = _changes(own.climb_mps, *limits, values["step_vs"], values["vertical_accel"])
    own = own.columns()
    flight = State(
        own.east_m, own.north_m, own.up_m + changed.back, own.east_mps, own.north_mps, changed.rate
    )
    return Steps(changed.number, changed.there, changed.time_s, changed.step_time_s, flight)


def limits_of(name: str, own_value: FloatArray, values: Any) -> tuple[FloatArray, FloatArray]:
    """Return the least and most values of a kind, also relative to the own value where set.

    Parameters
    ----------
    name : {"hs", "vs", "alt"}
    own_value : (n,)
    values : mapping
        Values of a configuration, by key.
    """
    below, above = values[f"below_relative_{name}"], values[f"above_relative_{name}"]
    least = np.full(np.shape(own_value), float(values[f"min_{name}"]))
    most = np.full(np.shape(own_value), float(values[f"max_{name}"]))
    if below > 0.0:
        least = np.maximum(least, own_value - below)
    if above > 0.0:
        most = np.minimum(most, own_value + above)
    return least, most


def _turns(most_rad: float, step: float) -> int:
    count = math.ceil(most_rad / step)
    return count - 1 if count * step > math.pi else count


class _Changes(NamedTuple):
    """As `Steps`, with the rate after each manoeuvre and where its flight was at time 0."""

    number: IntArray
    there: BoolArray
    time_s: FloatArray
    step_time_s: FloatArray
    rate: FloatArray
    back: FloatArray


def _changes(
    own: FloatArray, least: FloatArray, most: FloatArray, step: float, acceleration: float
) -> _Changes:
    down = np.maximum(np.ceil((own - least) / step), 0.0).astype(np.int64)[:, np.newaxis]
    up = np.maximum(np.ceil((most - own) / step), 0.0).astype(np.int64)[:, np.newaxis]
    number = np.arange(-int(down.max(initial=0)), int(up.max(initial=0)) + 1)
    there = (number >= -down) & (number <= up)
    now = own[:, np.newaxis]
    rate = now + number * step
    if acceleration == 0.0:
        nothing = np.zeros((1, len(number)))
        return _Changes(number, there, nothing, np.zeros((1, 1)), rate, np.zeros(rate.shape))
    step_time_s = np.full((1, 1), step / acceleration)
    time_s = np.abs(number) * step_time_s
    reached = now * time_s + 0.5 * np.sign(number) * acceleration * time_s**2
    return _Changes(number, there, time_s, step_time_s, rate, reached - rate * time_s)
