"""A flight that is told to turn, climb or descend, or fly faster or slower, while it is flown."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import Any, Protocol

import numpy as np

from components.geometry.ellipsoid import line_of_sight_ned
from components.geometry.state import TrajectoryState
from components.messages.steering import Manoeuvre
from components.traffic.legs import AnyLeg, Climb, ScriptedTrajectory, Straight, Turn
from dsa_des.arrays.types import FloatArray

# Changes of speed are flown in steps no longer than this, each at its mean speed: with 2 m/s² the
# place is right to 0.0625 m on the way, and exact at the end.
_SPEED_STEP_S = 0.5
# Track and speed are taken over this time around a manoeuvre: right to 1e-4 in a turn of 3 deg/s.
_BASE_S = 0.5
AROUND_S = np.array([-_BASE_S, 0.0, _BASE_S])


class SteerableFlight(Protocol):
    """What can be steered."""

    name: str

    @property
    def max_speed_mps(self) -> float:
        """Largest speed along its path."""

    def at(self, time_s: Any) -> TrajectoryState:
        """Return the state at some times."""


class SteeredFlight:
    """A flight up to its first manoeuvre; each is a turn, climb or descent, and then straight on.

    It never changes: `steered` returns another one, so that a run can go back to the flight it had.

    Parameters
    ----------
    flight : object with `name` and `at(time_s)`
        What is flown until the first manoeuvre.
    parts : tuple of (start in s, ScriptedTrajectory)
        What is flown from then on.
    """

    def __init__(
        self, flight: SteerableFlight, parts: tuple[tuple[float, ScriptedTrajectory], ...] = ()
    ) -> None:
        self.name, self.flight, self.parts = flight.name, flight, parts

    @property
    def max_speed_mps(self) -> float:
        """Largest speed along the path as it is now."""
        return max(flight.max_speed_mps for flight in (self.flight, *(f for _, f in self.parts)))

    def steered(self, time_s: float, told: Manoeuvre) -> SteeredFlight:
        """Return the flight that does as it is told from a time on, levels off and flies on.

        Parameters
        ----------
        time_s : float
            Not before an earlier manoeuvre.
        told : Manoeuvre
            A turn or a change of altitude begins and ends at once: without a change of speed along
            the path's projection, and without acceleration upward. Speeds change steadily, each
            without the other.
        """
        around = self.at(time_s + AROUND_S).reshaped((1, len(AROUND_S)))
        (part,) = flown_from(self.name, around, np.array([time_s]), [told])
        return SteeredFlight(self.flight, (*self.parts, (time_s, part)))

    def at(self, time_s: Any) -> TrajectoryState:
        """Return the state at some times, of any shape."""
        times = np.asarray(time_s, dtype=np.float64)
        if not self.parts:
            return self.flight.at(times)
        flat = times.reshape(-1)
        part = np.searchsorted([start for start, _ in self.parts], flat, side="right")
        flights: list[Any] = [self.flight, *(flight for _, flight in self.parts)]
        flown = np.flatnonzero(np.bincount(part, minlength=1)).tolist()
        if len(flown) == 1:
            state: TrajectoryState = flights[flown[0]].at(times)
            return state
        chosen = [np.flatnonzero(part == number) for number in flown]
        states = [flights[k].at(flat[rows]) for k, rows in zip(flown, chosen, strict=True)]
        # In order of time, rows of one flight follow those of another; others are put in place.
        order = np.argsort(np.concatenate(chosen), kind="stable")
        columns = zip(*(state.arrays() for state in states), strict=True)
        return TrajectoryState(*(np.concatenate(c)[order] for c in columns)).reshaped(times.shape)


def flown_from(
    name: str, around: TrajectoryState, time_s: FloatArray, told: Sequence[Manoeuvre]
) -> list[ScriptedTrajectory]:
    """Return what aircraft fly from a manoeuvre on.

    Parameters
    ----------
    name : str
        Of all of them.
    around : TrajectoryState
        Arrays (n, 3): where each would be without it, `AROUND_S` of its time.
    time_s : (n,)
    told : sequence of n Manoeuvre
    """
    middle = [part[:, 1:2] for part in (around.lat_deg, around.lon_deg, around.alt_m)]
    # Ends of the chord seen from its middle, so that the track is the one there.
    ends = [part[:, [0, 2]] for part in (around.lat_deg, around.lon_deg, around.alt_m)]
    north, east, _ = line_of_sight_ned(*middle, *ends)
    found = []
    for row, (at_s, manoeuvre) in enumerate(zip(time_s.tolist(), told, strict=True)):
        low, here, high = around.alt_m[row].tolist()
        place = float(around.lat_deg[row, 1]), float(around.lon_deg[row, 1]), here
        along = float(north[row, 1] - north[row, 0]), float(east[row, 1] - east[row, 0])
        climb_mps = 0.5 * (high - low) / _BASE_S
        found.append(_flown_from(name, place, along, climb_mps, at_s, manoeuvre))
    return found


# A study's metrics fly again what its runs flew.
@lru_cache(maxsize=4096)
def _flown_from(
    name: str,
    place: tuple[float, float, float],
    along_m: tuple[float, float],
    climb_mps: float,
    time_s: float,
    told: Manoeuvre,
) -> ScriptedTrajectory:
    speed = math.hypot(*along_m) / (2.0 * _BASE_S)
    return ScriptedTrajectory(
        name,
        lat_deg=place[0],
        lon_deg=place[1],
        alt_m=place[2],
        heading_deg=math.degrees(math.atan2(along_m[1], along_m[0])),
        speed_mps=speed,
        legs=_legs(told, place[2], speed, climb_mps),
        start_time_s=time_s,
    )


def _legs(told: Manoeuvre, alt_m: float, speed_mps: float, climb_mps: float) -> list[AnyLeg]:
    """Return the legs of a manoeuvre from an altitude and speeds, the last one for ever."""
    if told.speed_mps != 0.0:
        change = max(told.speed_mps, -speed_mps)
        means, last_s = _ramp(change, told.acceleration_mps2)
        legs: list[AnyLeg] = [
            Straight(duration_s=last_s, speed_mps=speed_mps + v, climb_mps=climb_mps) for v in means
        ]
        return [*legs, Straight(speed_mps=speed_mps + change, climb_mps=climb_mps)]
    if told.vertical_speed_mps != 0.0:
        means, last_s = _ramp(told.vertical_speed_mps, told.vertical_acceleration_mps2)
        legs = [Climb(duration_s=last_s, climb_mps=climb_mps + v) for v in means]
        return [*legs, Climb(climb_mps=climb_mps + told.vertical_speed_mps)]
    if told.climb_m != 0.0:
        rate_mps = math.copysign(told.climb_rate_mps, told.climb_m)
        return [Climb(climb_mps=rate_mps, to_alt_m=alt_m + told.climb_m), Straight()]
    turn = Turn(
        rate_deg_s=math.copysign(math.degrees(told.rate_rad_s), told.turn_rad),
        angle_deg=math.degrees(abs(told.turn_rad)),
    )
    return [turn, Straight()]


def _ramp(change_mps: float, acceleration_mps2: float) -> tuple[list[float], float]:
    """Return the mean changes over the equal steps of a steady change, and how long each is."""
    time_s = abs(change_mps) / acceleration_mps2
    count = max(math.ceil(time_s / _SPEED_STEP_S), 1)
    return [change_mps * (k + 0.5) / count for k in range(count)], max(time_s / count, 1e-9)
