"""Wind as an effect of traffic: noses that do not point along the track."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from components.flights.attitude import Wind, attitude_in_wind, scene_wind
from components.flights.scripted_flights import ScriptedTrajectory, StraightFlights
from components.flights.steered_flight import SteeredFlight
from components.geometry.angles import FloatArray
from components.geometry.state import TrajectoryState
from dsa_des.arrays.types import IntArray
from dsa_des.block.effect import Effect, Hook, Verdict


class Crabbing:
    """Turns attitudes that follow from paths over the ground into those in wind."""

    def __init__(self, wind: Wind, targets: Sequence[Any]) -> None:
        self._wind, self._targets = wind, targets
        self._fixed = _fixed_angles(targets)
        self._only_speed = _only_speeds(targets)

    def of_own(self, flight: Any, state: TrajectoryState, time_s: FloatArray) -> TrajectoryState:
        """Return the ownship's state (any shape) in wind."""
        speed = ground_speeds(flight, time_s)
        base = flight.flight if isinstance(flight, SteeredFlight) else flight
        fixed = getattr(base, "fixed_attitude_rad", (None, None, None))
        if isinstance(flight, SteeredFlight) and flight.parts:
            # A fixed attitude is that of the flight as written; manoeuvres fly by their own.
            before = np.asarray(time_s) < flight.parts[0][0]
        else:
            before = np.ones(np.shape(time_s), dtype=bool)
        keep = np.stack([before & (angle is not None) for angle in fixed])
        return self._crabbed(state, speed, keep)

    def of_targets(
        self, columns: IntArray, states: TrajectoryState, time_s: FloatArray
    ) -> TrajectoryState:
        """Return the states (rows, columns) of some targets in wind, at times (rows, columns)."""
        speed = np.array(np.broadcast_to(self._only_speed[columns], time_s.shape))
        for place in np.flatnonzero(np.isnan(self._only_speed[columns])).tolist():
            flight = self._targets[int(columns[place])]
            speed[:, place] = ground_speeds(flight, time_s[:, place])
        keep = np.broadcast_to(self._fixed[:, np.newaxis, columns], (3, *time_s.shape))
        return self._crabbed(states, speed, keep)

    def _crabbed(self, state: TrajectoryState, speed: FloatArray, keep: Any) -> TrajectoryState:
        # Where the yaw is fixed, the track is not known from it, and nothing can be derived.
        speed = np.where(keep[0], np.nan, speed)
        yaw, pitch, roll = attitude_in_wind(
            state.yaw_rad, state.pitch_rad, state.roll_rad, speed, self._wind
        )
        return replace(
            state,
            yaw_rad=np.where(keep[0], state.yaw_rad, yaw),
            pitch_rad=np.where(keep[1], state.pitch_rad, pitch),
            roll_rad=np.where(keep[2], state.roll_rad, roll),
        )


ATTITUDE = Hook("attitude", Crabbing, "turns the attitudes that follow from paths")


class CrabAngles(Effect[Crabbing]):
    """Aircraft keep their tracks over the ground, and their noses turn into the wind.

    What the scene or a file fixes of an attitude stays. Of flights from files the attitude is
    derived with the wind when they are read.
    """

    name = "wind"
    acts_on = ATTITUDE
    outside_the_proof = "angles are formed anew, and their last bits differ"
    lockstep = True

    def verdict(self, block: Any) -> Verdict:
        """Ask ``[weather] wind_mps``."""
        weather = block.context.sections.get("weather")
        wind_mps = 0.0 if weather is None else weather.wind_mps
        return Verdict(wind_mps > 0.0, f"[weather] wind_mps is {wind_mps:g}")

    def build(self, block: Any) -> Crabbing:
        """Return what turns the noses."""
        wind = scene_wind(block.context.sections["weather"])
        assert wind is not None
        return Crabbing(wind, block.targets)


def ground_speeds(flight: Any, time_s: FloatArray) -> FloatArray:
    """Return a flight's ground speed at some times (any shape), m/s; NaN where it is no script."""
    times = np.asarray(time_s, dtype=np.float64)
    if isinstance(flight, SteeredFlight):
        speed = ground_speeds(flight.flight, times)
        for start_s, part in flight.parts:
            speed = np.where(times >= start_s, ground_speeds(part, times), speed)
        return speed
    if not isinstance(flight, ScriptedTrajectory):
        return np.full(times.shape, np.nan)
    each = np.array(
        [0.0 if s.kind == "hold" else s.speed_mps * np.cos(s.pitch_rad) for s in flight.segments]
    )
    starts = np.array([segment.start_s for segment in flight.segments])
    inside = np.clip(times, flight.start_time_s, flight.evaluated_until_s) - flight.start_time_s
    return each[np.searchsorted(starts, inside, side="right") - 1]


def _only_speeds(targets: Sequence[Any]) -> FloatArray:
    """Return the ground speed of flights that have only one; NaN of the others."""
    if isinstance(targets, StraightFlights):
        return targets.max_speeds_mps * np.cos(targets.pitch_rad)
    return np.array(
        [
            float(ground_speeds(flight, np.array(flight.start_time_s)))
            if isinstance(flight, ScriptedTrajectory) and len(flight.segments) == 1
            else np.nan
            for flight in targets
        ],
        dtype=np.float64,
    )


def _fixed_angles(targets: Sequence[Any]) -> Any:
    """Return which of yaw, pitch and roll are fixed, (3, targets) of bool."""
    if isinstance(targets, StraightFlights):
        return ~np.isnan(targets.fixed_rad)
    fixed = [getattr(flight, "fixed_attitude_rad", (None, None, None)) for flight in targets]
    return np.array([[angle is not None for angle in one] for one in fixed]).reshape(-1, 3).T
