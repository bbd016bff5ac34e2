"""The wind triangle: where the nose points of who keeps a track over the ground in wind."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from components.geometry.angles import FloatArray, wrap_heading_rad
from components.traffic.attitude_from_path import SLOWEST_TRACK_MPS


@dataclass(frozen=True)
class Wind:
    """A wind that is the same everywhere and always.

    Parameters
    ----------
    east_mps, north_mps : float
        Where the air goes.
    """

    east_mps: float
    north_mps: float

    @classmethod
    def from_direction(cls, speed_mps: float, from_deg: float) -> Wind:
        """Return the wind of a speed that blows *from* a direction, as meteorologists say it."""
        turn = math.radians(from_deg)
        return cls(-speed_mps * math.sin(turn), -speed_mps * math.cos(turn))

    @property
    def speed_mps(self) -> float:
        """How fast the air goes."""
        return math.hypot(self.east_mps, self.north_mps)


def scene_wind(weather: Any) -> Wind | None:
    """Return the wind of ``[weather]``, or None where there is none."""
    if weather is None or weather.wind_mps == 0.0:
        return None
    return Wind.from_direction(weather.wind_mps, weather.wind_from_deg)


def heading_and_airspeed(
    track_rad: FloatArray, ground_speed_mps: FloatArray, wind: Wind
) -> tuple[FloatArray, FloatArray]:
    """Return heading and level airspeed of who flies along a track over the ground.

    The velocity through the air is that over the ground less the wind.

    Parameters
    ----------
    track_rad, ground_speed_mps : arrays of one shape
    wind : Wind

    Returns
    -------
    heading_rad : array
        In [0, 2 pi); the track itself where there is next to no velocity through the air
        (below 0.5 m/s), which points nowhere, or over the ground.
    airspeed_mps : array
    """
    east = ground_speed_mps * np.sin(track_rad) - wind.east_mps
    north = ground_speed_mps * np.cos(track_rad) - wind.north_mps
    airspeed = np.hypot(east, north)
    flown = (airspeed >= SLOWEST_TRACK_MPS) & (ground_speed_mps >= SLOWEST_TRACK_MPS)
    return np.where(flown, wrap_heading_rad(np.arctan2(east, north)), track_rad), airspeed


def ground_speed_mps(track_rad: float, airspeed_mps: float, wind: Wind) -> float:
    """Return the ground speed along a track at an airspeed: the other side of the triangle.

    tail + sqrt(airspeed² - cross²), with the wind's parts along and across the track.

    Parameters
    ----------
    track_rad, airspeed_mps : float
    wind : Wind

    Raises
    ------
    ValueError
        If the wind is too strong to keep the track, or to get along it at all.
    """
    tail = wind.east_mps * math.sin(track_rad) + wind.north_mps * math.cos(track_rad)
    cross = wind.east_mps * math.cos(track_rad) - wind.north_mps * math.sin(track_rad)
    if abs(cross) > airspeed_mps:
        raise ValueError(
            f"airspeed_mps is {airspeed_mps:g}: it must be at least the wind across the track, "
            f"{abs(cross):.4g} m/s, or no heading keeps it"
        )
    speed = tail + math.sqrt((airspeed_mps - cross) * (airspeed_mps + cross))
    if speed <= 0.0:
        raise ValueError(
            f"airspeed_mps is {airspeed_mps:g}: it must be more than that, for the wind of "
            f"{wind.speed_mps:.4g} m/s against the track stops it ({speed:.4g} m/s over the ground)"
        )
    return speed


def attitude_in_wind(
    track_rad: FloatArray,
    pitch_rad: FloatArray,
    roll_rad: FloatArray,
    ground_speed: FloatArray,
    wind: Wind,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Turn an attitude that follows from the path over the ground into that in wind.

    Parameters
    ----------
    track_rad, pitch_rad, roll_rad : arrays of one shape
        Track, flight-path angle over the ground, and bank of a coordinated turn.
    ground_speed : array of that shape, m/s
        NaN where the attitude is to stay as it is.
    wind : Wind

    Returns
    -------
    yaw_rad, pitch_rad, roll_rad : arrays
        Heading; climb over the airspeed; and the bank for the part of the turn's acceleration
        that is across the nose.
    """
    known = np.isfinite(ground_speed)
    speed = np.where(known, ground_speed, 0.0)
    heading, airspeed = heading_and_airspeed(track_rad, speed, wind)
    flown = known & (speed >= SLOWEST_TRACK_MPS) & (airspeed >= SLOWEST_TRACK_MPS)
    climb = np.tan(pitch_rad) * speed
    pitch = np.where(flown, np.arctan2(climb, airspeed), pitch_rad)
    across = np.cos(heading - track_rad)
    roll = np.where(flown, np.arctan(np.tan(roll_rad) * across), roll_rad)
    return np.where(flown, heading, track_rad), pitch, roll
