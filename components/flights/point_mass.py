"""Flying a sampled track: from speed, climb and turn per second to positions.

Heading is 0 at time 0. Two ways, both vectorised over tracks: Euler steps of 1 s, as track files
hold them, and a point mass with limits on its bank, its turn and its pitch rate at 0.1 s. And how
that point mass turns to a heading at which a pilot aims.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from components.arguments.units import FOOT_M
from components.messages.steering import SLOWEST_TURN_DEG_S
from dsa_des.arrays.types import FloatArray

FT_S_PER_KT = 6076.115485564304 / 3600.0
"""Feet per second in a knot (1852 m in feet of 0.3048 m)."""
G_FT_S2 = 32.2
STEP_S = 0.1
_STEPS_PER_SECOND = 10

_MOST_PITCH_RATE = np.radians(3.0)
_MOST_ROLL_RATE = 0.524
_MOST_BANK = np.radians(75.0)
_ROLL_GAIN = 20.0
_SLOWEST, _FASTEST = 1.7, 1116.0

_G_M_S2 = G_FT_S2 * FOOT_M
_STEPS_PER_COMMAND = 10
#: Less than this is left to chance by no rounding, and is turned at once: 0.2 arc seconds.
_ALMOST_RAD = 1e-6
#: Of more tracks instants are summed row by row: sums along the first axis jump in the memory.
_FEW_TRACKS = 32
_LONGEST_S = 600.0
_SHORTEST_S = 1e-8
#: An easing turn settles if the angle within which it eases is at least this long at full rate.
LEAST_EASING_S = 2.0

#: How long, s, at which rate, deg/s.
Rates = list[tuple[float, float]]


@dataclass(frozen=True)
class FlownTracks:
    """Tracks side by side, (instants, tracks) ``step_s`` apart from 0 s; north, east from starts.

    Up is the altitude, speed the true airspeed; headings are clockwise from north.
    """

    step_s: float
    north_ft: FloatArray
    east_ft: FloatArray
    up_ft: FloatArray
    speed_ft_s: FloatArray
    heading_rad: FloatArray
    climb_ft_s: FloatArray
    pitch_rad: FloatArray
    bank_rad: FloatArray


def fly_euler(
    altitude_ft: FloatArray,
    speed_ft_s: FloatArray,
    acceleration_ft_s2: FloatArray,
    climb_ft_s: FloatArray,
    turn_rad_s: FloatArray,
    start_heading_rad: FloatArray | float = 0.0,
) -> FlownTracks:
    """Fly tracks by Euler steps of 1 s, each with the values at its beginning, and return them.

    h += ḣ; N, E += v (cos ψ, sin ψ); v += a; ψ += ψ̇. The path over the ground is that of the
    airspeed, as in the published tracks.
    """
    speed = cumulative_sums(speed_ft_s, acceleration_ft_s2)
    heading = cumulative_sums(np.zeros_like(speed_ft_s) + start_heading_rad, turn_rad_s)
    zero = np.zeros_like(speed_ft_s)
    with np.errstate(divide="ignore", invalid="ignore"):
        pitch = np.arcsin(np.clip(np.nan_to_num(climb_ft_s / speed), -1.0, 1.0))
    return FlownTracks(
        1.0,
        cumulative_sums(zero, speed * np.cos(heading)),
        cumulative_sums(zero, speed * np.sin(heading)),
        cumulative_sums(altitude_ft, climb_ft_s),
        speed,
        heading,
        climb_ft_s,
        pitch,
        np.arctan(speed * turn_rad_s / G_FT_S2),
    )


def cumulative_sums(start: FloatArray, rates: FloatArray) -> FloatArray:
    """Return start, start + rates[0], start + rates[0] + rates[1], ... along the first axis."""
    total = np.empty_like(rates)
    total[0] = start
    if len(start) < _FEW_TRACKS or len(rates) < 3:
        np.cumsum(rates[:-1], axis=0, out=total[1:])
    else:  # the same sums, row by row
        total[1] = rates[0]
        for row in range(2, len(rates)):
            np.add(total[row - 1], rates[row - 1], out=total[row])
    total[1:] += start
    return total


def fly_point_mass(
    altitude_ft: FloatArray,
    speed_ft_s: FloatArray,
    acceleration_ft_s2: FloatArray,
    climb_ft_s: FloatArray,
    turn_rad_s: FloatArray,
    start_heading_rad: FloatArray | float = 0.0,
) -> FlownTracks:
    """Fly a point mass by Euler steps of 0.1 s, from commands that are held for a second.

    The equations of the programs of the published encounter models (em-core): rates of turn about
    body axes q and r follow from the commanded climb and the bank, roll rate p from what is missing
    of the commanded turn; |q| ≤ 3°/s, |p| ≤ 0.524 rad/s, |bank| ≤ 75°, speed 1.7 to 1116 ft/s.
    """
    seconds = len(climb_ft_s) - 1
    instants = seconds * _STEPS_PER_SECOND + 1
    shape = instants, len(altitude_ft)
    north, east, up, speed, heading, climb, pitch, bank = (np.empty(shape) for _ in range(8))
    v, h = speed_ft_s.astype(float), altitude_ft.astype(float)
    n, e = np.zeros_like(v), np.zeros_like(v)
    psi = np.zeros_like(v) + start_heading_rad
    theta = np.arcsin(np.clip(climb_ft_s[0] / v, -0.999, 0.999))
    phi = np.clip(np.arctan(v * turn_rad_s[0] / G_FT_S2), -_MOST_BANK, _MOST_BANK)
    for k in range(instants):
        sin_theta, cos_theta = np.sin(theta), np.cos(theta)
        rate_up = v * sin_theta
        for kept, now in zip(
            (north, east, up, speed, heading, climb, pitch, bank),
            (n, e, h, v, psi, rate_up, theta, phi), strict=True,
        ):  # fmt: skip
            kept[k] = now
        if k == instants - 1:
            break
        second = k // _STEPS_PER_SECOND
        a, wanted_up, wanted_turn = (
            acceleration_ft_s2[second], climb_ft_s[second], turn_rad_s[second],
        )  # fmt: skip
        sin_phi, cos_phi, tan_theta = np.sin(phi), np.cos(phi), sin_theta / cos_theta
        lift = (np.clip(wanted_up, -v, v) - rate_up) / STEP_S
        q = lift / cos_theta + G_FT_S2 * cos_theta * sin_phi**2 - a * tan_theta
        q = np.clip(q / (v * cos_phi), -_MOST_PITCH_RATE, _MOST_PITCH_RATE)
        r = G_FT_S2 * sin_phi * cos_theta / v
        turn = (q * sin_phi + r * cos_phi) / cos_theta
        p = np.clip(_ROLL_GAIN * (wanted_turn - turn), -_MOST_ROLL_RATE, _MOST_ROLL_RATE)
        n = n + STEP_S * v * cos_theta * np.cos(psi)
        e = e + STEP_S * v * cos_theta * np.sin(psi)
        h = h + STEP_S * rate_up
        phi = phi + STEP_S * (p + (q * sin_phi + r * cos_phi) * tan_theta)
        phi = np.clip(phi, -_MOST_BANK, _MOST_BANK)
        theta = theta + STEP_S * (q * cos_phi - r * sin_phi)
        psi = psi + STEP_S * turn
        v = np.clip(v + STEP_S * a, _SLOWEST, _FASTEST)
    return FlownTracks(STEP_S, north, east, up, speed, heading, climb, pitch, bank)


#: The two ways, by their names in scenes and on the command line.
DYNAMICS = {"euler": fly_euler, "point_mass": fly_point_mass}


def eased_turn_durations_and_rates(
    left_rad: float,
    left_before_rad: float,
    rate_rad_s: float,
    speed_mps: float,
    most_rad_s: float,
    eases_rad: float,
) -> Rates:
    """Return an eased turn to a heading as (duration in s, rate in deg/s) of each step.

    Once a second the pilot commands a rate in proportion to what was left to turn a second ago
    (`left_before_rad`, positive to the right as `left_rad` is), up to the largest; within
    `eases_rad` of the heading it falls, at least `LEAST_EASING_S` at the largest rate, or the turn
    would not settle. The bank follows as that of `fly_point_mass` (em-core), in level flight at a
    ground speed above 0; the command is that of em-core's pilot model (release 6), recorded once a
    second. A step of Euler moves along the heading at its beginning: so the rates begin half a step
    later, and path and heading agree to second order.
    """
    left_rad -= 0.5 * STEP_S * rate_rad_s
    rates = [(0.5 * STEP_S, math.degrees(rate_rad_s))]
    bank = math.atan(speed_mps * rate_rad_s / _G_M_S2)
    gain_per_s = most_rad_s / eases_rad
    for _ in range(math.ceil(_LONGEST_S)):
        command = max(-most_rad_s, min(most_rad_s, gain_per_s * left_before_rad))
        left_before_rad = left_rad
        for _ in range(_STEPS_PER_COMMAND):
            roll = _ROLL_GAIN * (command - rate_rad_s)
            bank += STEP_S * max(-_MOST_ROLL_RATE, min(_MOST_ROLL_RATE, roll))
            bank = max(-float(_MOST_BANK), min(float(_MOST_BANK), bank))
            rate_rad_s = _G_M_S2 * math.tan(bank) / speed_mps
            rates.append((STEP_S, math.degrees(rate_rad_s)))
            left_rad -= STEP_S * rate_rad_s
        if max(abs(left_rad), abs(left_before_rad), abs(rate_rad_s)) < _ALMOST_RAD:
            break
    return _without_slow_turns([*rates, (STEP_S, math.degrees(left_rad) / STEP_S)])


def _without_slow_turns(rates: Iterable[tuple[float, float]]) -> Rates:
    """Return turn rates with too slow turns replaced by slowest turns and straight flight.

    What is turned more slowly is turned at that rate in a part of the time, up to a second of it
    together, and the rest is flown straight.
    """
    flown: Rates = []
    slow_s = slow_deg = 0.0
    for lasts_s, rate_deg_s in [*rates, (0.0, math.inf)]:
        is_slow = abs(rate_deg_s) < SLOWEST_TURN_DEG_S
        if slow_s and (not is_slow or slow_s + lasts_s > 1.0):
            turns_s = abs(slow_deg) / SLOWEST_TURN_DEG_S
            if turns_s > _SHORTEST_S:
                flown.append((turns_s, math.copysign(SLOWEST_TURN_DEG_S, slow_deg)))
            flown.append((slow_s - turns_s, 0.0))
            slow_s = slow_deg = 0.0
        if is_slow:
            slow_s, slow_deg = slow_s + lasts_s, slow_deg + lasts_s * rate_deg_s
        elif lasts_s:
            flown.append((lasts_s, rate_deg_s))
    return flown
