"""Manoeuvres in equal steps of direction or speed, to either side, with the flight after each.

A manoeuvre ends in straight flight; that flight is run back to time 0, so that closed forms for
straight flights apply to it from the manoeuvre's end on.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from components.guidance.situation import State
from dsa_des.arrays.types import FloatArray, IntArray


class Steps(NamedTuple):
    """Manoeuvres from the leftmost or lowest to the rightmost or highest.

    Parameters
    ----------
    number : (n,) of int
        Signed number of steps from the own value, ascending; 0 is no manoeuvre.
    time_s : (n,)
        When each manoeuvre ends.
    step_time_s : float
        Of one step; 0 for those that take no time.
    flight : State of (n,)
        The flight after it, run back to time 0.
    """

    number: IntArray
    time_s: FloatArray
    step_time_s: float
    flight: State


def direction_steps(own: State, values: Any) -> Steps:
    """Return turns by multiples of a step to the left and right.

    Parameters
    ----------
    own : State
    values : mapping
        Values of a configuration, by key.
    """
    step = values["step_hdir"]
    # A flight slower than a step is turned as if it flew that fast.
    speed = max(math.hypot(own.east_mps, own.north_mps), values["step_hs"], values["min_airspeed"])
    rate = values["turn_rate"]
    if rate == 0.0 and values["bank_angle"] > 0.0:
        rate = 9.80665 * math.tan(values["bank_angle"]) / speed
    left, right = (_turns(values[key], step) for key in ("left_hdir", "right_hdir"))
    number = np.arange(-left, right + 1)
    track = math.atan2(own.east_mps, own.north_mps)
    turned = track + number * step
    v_east, v_north = speed * np.sin(turned), speed * np.cos(turned)
    # The flight that makes no turn is that which is flown.
    if rate == 0.0:
        time_s = np.zeros(len(number))
        east, north = own.east_m + 0.0 * v_east, own.north_m + 0.0 * v_north
        step_time_s = 0.0
    else:
        step_time_s = step / rate
        time_s = np.abs(number) * step_time_s
        radius = np.where(number < 0, -speed / rate, speed / rate)
        east = own.east_m + radius * (math.cos(track) - np.cos(turned)) - v_east * time_s
        north = own.north_m + radius * (np.sin(turned) - math.sin(track)) - v_north * time_s
    level = np.zeros(len(number))
    flight = State(east, north, own.up_m + level, v_east, v_north, own.climb_mps + level)
    return Steps(number, time_s, step_time_s, flight)


def speed_steps(own: State, values: Any) -> Steps:
    """Return changes of ground speed along the track; it may pass through zero."""
    speed = math.hypot(own.east_mps, own.north_mps)
    track = math.atan2(own.east_mps, own.north_mps)
    changed = _changes(
        speed, values["min_hs"], values["max_hs"], values["step_hs"], values["horizontal_accel"]
    )
    number, time_s, step_time_s, rate, back = changed
    level = np.zeros(len(number))
    flight = State(
        own.east_m + back * math.sin(track),
        own.north_m + back * math.cos(track),
        own.up_m + level,
        rate * math.sin(track),
        rate * math.cos(track),
        own.climb_mps + level,
    )
    return Steps(number, time_s, step_time_s, flight)


def climb_steps(own: State, values: Any) -> Steps:
    """Return changes of vertical speed."""
    changed = _changes(
        own.climb_mps, values["min_vs"], values["max_vs"], values["step_vs"],
        values["vertical_accel"],
    )  # fmt: skip
    number, time_s, step_time_s, rate, back = changed
    level = np.zeros(len(number))
    flight = State(
        own.east_m + level,
        own.north_m + level,
        own.up_m + back,
        own.east_mps + level,
        own.north_mps + level,
        rate,
    )
    return Steps(number, time_s, step_time_s, flight)


def _turns(most_rad: float, step: float) -> int:
    count = math.ceil(most_rad / step)
    return count - 1 if count * step > math.pi else count


def _changes(
    own: Any, least: float, most: float, step: float, acceleration: float
) -> tuple[IntArray, FloatArray, float, FloatArray, FloatArray]:
    """Return numbers, times, time of a step, rates, and the places of the flights at time 0."""
    down = max(math.ceil((own - least) / step), 0)
    up = max(math.ceil((most - own) / step), 0)
    number = np.arange(-down, up + 1)
    rate = own + number * step
    if acceleration == 0.0:
        nothing = np.zeros(len(number))
        return number, nothing, 0.0, rate, nothing
    step_time_s = step / acceleration
    time_s = np.abs(number) * step_time_s
    reached = own * time_s + 0.5 * np.sign(number) * acceleration * time_s**2
    return number, time_s, step_time_s, rate, reached - rate * time_s
