"""Where the targets of a scene truly are, in the frame of a tracker."""

from fractions import Fraction
from typing import Any

import numpy as np

from components.geometry.ellipsoid import north_east_up
from components.metrics.separation import traffic_block
from dsa_des.arrays.types import BoolArray, FloatArray
from dsa_des.block.component import Context
from dsa_des.scene.scene import Scene
from dsa_des.time.randomness import Streams

# Velocities are differences of positions so long apart, s.
_STEP_S = 0.02


class RecordedTruth:
    """The targets of one scene, asked at any time.

    Parameters
    ----------
    scene : Scene
    """

    def __init__(self, scene: Scene) -> None:
        block = traffic_block(scene)
        context = Context(Streams(scene.seed), scene.ticks_per_s, sections=scene.sections)
        source: Any = block.cls(block.name, block.parameters, context)
        self._source = source
        duration = scene.duration_s or source.natural_duration_s() or Fraction(0)
        context.duration_s = duration
        self.names = [target.name for target in source.targets]

    def at(self, time_s: FloatArray, origin: FloatArray) -> tuple[FloatArray, BoolArray]:
        """Return states and presence of every target.

        Parameters
        ----------
        time_s : (n,)
        origin : (3, n)
            Latitude, longitude (deg) and height (m) of each frame.

        Returns
        -------
        state : (targets, 6, n)
            Position and velocity: north, east, down, m and m/s.
        present : (targets, n) of bool
        """
        state = np.empty((len(self.names), 6, len(time_s)))
        present = np.empty((len(self.names), len(time_s)), dtype=bool)
        for number, target in enumerate(self._source.targets):
            state[number, :3], present[number] = _position(target, time_s, origin)
            before = np.maximum(time_s - _STEP_S, 0.0)
            after = before + 2.0 * _STEP_S
            first, _ = _position(target, before, origin)
            last, _ = _position(target, after, origin)
            state[number, 3:] = (last - first) / (after - before)
        return state, present


def _position(target: Any, time_s: FloatArray, origin: FloatArray) -> tuple[FloatArray, BoolArray]:
    there = target.at(time_s)
    place = [np.ascontiguousarray(v, dtype=float) for v in (there.lat_deg, there.lon_deg,
                                                            there.alt_m)]  # fmt: skip
    north, east, up = north_east_up(*origin, *place)
    return np.stack([north, east, -up]), np.broadcast_to(there.present, time_s.shape)
