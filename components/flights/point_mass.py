"""Flying a sampled track: from speed, climb and turn per second to positions.

Heading is 0 at time 0. Two ways, both vectorised over tracks: Euler steps of 1 s, as track files
hold them, and a point mass with limits on its bank, its turn and its pitch rate at 0.1 s.
"""

from dataclasses import dataclass

import numpy as np

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


@dataclass(frozen=True)
class FlownTracks:
    """Flights of many tracks; arrays (instants, tracks).

    Parameters
    ----------
    step_s : float
        Between two instants; the first is 0.
    north_ft, east_ft, up_ft : array
        From where the track begins; up is the altitude.
    speed_ft_s, heading_rad, climb_ft_s : array
        True airspeed, and heading clockwise from north.
    pitch_rad, bank_rad : array
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
    """Fly by steps of 1 s that take the values of the second before on their right.

    h += ḣ; N, E += v (cos ψ, sin ψ); v += a; ψ += ψ̇. The path over the ground is that of the
    airspeed, as in the published tracks.
    """
    speed = summed(speed_ft_s, acceleration_ft_s2)
    heading = summed(np.zeros_like(speed_ft_s) + start_heading_rad, turn_rad_s)
    zero = np.zeros_like(speed_ft_s)
    with np.errstate(divide="ignore", invalid="ignore"):
        pitch = np.arcsin(np.clip(np.nan_to_num(climb_ft_s / speed), -1.0, 1.0))
    return FlownTracks(
        1.0,
        summed(zero, speed * np.cos(heading)),
        summed(zero, speed * np.sin(heading)),
        summed(altitude_ft, climb_ft_s),
        speed,
        heading,
        climb_ft_s,
        pitch,
        np.arctan(speed * turn_rad_s / G_FT_S2),
    )


def summed(start: FloatArray, rates: FloatArray) -> FloatArray:
    """Return start, start + rates[0], start + rates[0] + rates[1], ... along the first axis."""
    found = np.empty_like(rates)
    found[0] = start
    np.cumsum(rates[:-1], axis=0, out=found[1:])
    found[1:] += start
    return found


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
