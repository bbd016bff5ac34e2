"""Wind as an effect of traffic: noses that do not point along the track."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from components.flights.attitude import Wind, attitude_in_wind, scene_wind
from components.geometry import TrajectoryState
from dsa_des.arrays.types import FloatArray
from dsa_des.block.effect import Effect, Hook, Verdict


class Crabbing:
    """Turns attitudes derived from ground paths into those that aircraft have in wind."""

    def __init__(self, wind: Wind) -> None:
        self._wind = wind

    def __call__(
        self, state: TrajectoryState, speed_mps: FloatArray, fixed_rad: FloatArray
    ) -> TrajectoryState:
        """Return states (n,) in wind, by speeds over ground (n,), NaN where they are not known.

        Fixed angles (3, n) stay; NaN where the motion gives them.
        """
        if not np.isfinite(speed_mps).any():
            return state
        keep = ~np.isnan(fixed_rad)
        # Where the yaw is fixed, the track is not known from it, and nothing can be derived.
        speed_mps = np.where(keep[0], np.nan, speed_mps)
        yaw, pitch, roll = attitude_in_wind(
            state.yaw_rad, state.pitch_rad, state.roll_rad, speed_mps, self._wind
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

    def verdict(self, block: Any) -> Verdict:
        """Return whether wind acts on attitudes, and why: ``[weather] wind_mps`` above 0."""
        weather = block.context.sections.get("weather")
        wind_mps = 0.0 if weather is None else weather.wind_mps
        return Verdict(wind_mps > 0.0, f"[weather] wind_mps is {wind_mps:g}")

    def build(self, block: Any) -> Crabbing:
        """Return a function turning headings into the wind so that ground tracks stay the same."""
        wind = scene_wind(block.context.sections["weather"])
        assert wind is not None
        return Crabbing(wind)
