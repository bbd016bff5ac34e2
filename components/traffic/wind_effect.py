"""Wind as an effect of traffic: noses that do not point along the track."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from components.flights.attitude import Wind, attitude_in_wind, scene_wind
from components.flights.fleet import Fleet
from components.flights.scripted_flights import ScriptedFleet, ScriptedTrajectory
from components.flights.steered_flight import SteeredFlight
from components.geometry import TrajectoryState
from dsa_des.arrays.types import FloatArray, IntArray
from dsa_des.block.effect import Effect, Hook, Verdict


class Crabbing:
    """Turns attitudes that follow from paths over the ground into those in wind."""

    def __init__(self, wind: Wind, targets: Fleet) -> None:
        self._wind, self._targets = wind, targets

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
        fleet, shape = self._targets, time_s.shape
        if not isinstance(fleet, ScriptedFleet):
            return states
        each = np.broadcast_to(columns, shape).reshape(-1)
        speed = fleet.ground_speeds_mps(each, time_s.reshape(-1)).reshape(shape)
        fixed = ~np.isnan(fleet.fixed_rad[:, np.newaxis, columns])
        return self._crabbed(states, speed, np.broadcast_to(fixed, (3, *shape)))

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
    one: IntArray = np.zeros(times.size, dtype=np.int64)
    return flight.as_fleet.ground_speeds_mps(one, times.reshape(-1)).reshape(times.shape)
