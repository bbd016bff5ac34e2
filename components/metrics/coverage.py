"""When targets enter the coverage of a scene's sensors: field of view and range."""

import math
from fractions import Fraction
from typing import Any

import numpy as np

from components.geometry.attitude import body_angles_unchecked, ned_to_body_unchecked
from components.geometry.ellipsoid import line_of_sight_ned
from components.messages.detections import SensorOffer
from components.messages.reach import EVALUATE, Reach
from components.metrics.separation import traffic_block
from dsa_des.arrays.types import BoolArray, FloatArray
from dsa_des.block.component import Context
from dsa_des.scene.scene import Scene
from dsa_des.time.randomness import Streams

# An entry is known so well, s.
_WELL_S = 1e-3


def reaches_of(scene: Scene) -> list[Reach]:
    """Return where the sensors of a scene look, in the ownship's body axes."""
    found = []
    for block in scene.blocks.values():
        if "detections" not in block.cls.outputs:
            continue
        context = Context(Streams(scene.seed), scene.ticks_per_s, sections=scene.sections)
        offer = block.cls(block.name, block.parameters, context).offer("detections")
        if isinstance(offer, SensorOffer) and offer.reach is not None:
            found.append(offer.reach)
    return found


class Coverage:
    """Whether targets lie in the field of view and within the range of any sensor.

    Hills and the horizon are not asked, nor are manoeuvres of the ownship: it flies on.

    Parameters
    ----------
    scene : Scene
    """

    def __init__(self, scene: Scene) -> None:
        block = traffic_block(scene)
        context = Context(Streams(scene.seed), scene.ticks_per_s, sections=scene.sections)
        self._source: Any = block.cls(block.name, block.parameters, context)
        duration = scene.duration_s or self._source.natural_duration_s() or Fraction(0)
        context.duration_s = duration
        self.duration_s = float(duration)
        self._reaches = reaches_of(scene)

    def holds(self, target: Any, time_s: FloatArray) -> BoolArray:
        """Return whether a target is covered at times (n,)."""
        own, other = self._source.own.at(time_s), target.at(time_s)
        places = [
            np.ascontiguousarray(np.broadcast_to(value, time_s.shape), dtype=float)
            for state in (own, other)
            for value in (state.lat_deg, state.lon_deg, state.alt_m)
        ]
        north, east, down = line_of_sight_ned(*places)
        attitude = [np.broadcast_to(v, time_s.shape) for v in (own.yaw_rad, own.pitch_rad,
                                                               own.roll_rad)]  # fmt: skip
        body = ned_to_body_unchecked(north, east, down, *attitude)
        angles = body_angles_unchecked(*(np.ascontiguousarray(axis) for axis in body))
        distance = np.sqrt(north**2 + east**2 + down**2)
        there = np.broadcast_to(own.present & other.present, time_s.shape)
        found = np.zeros(time_s.shape, dtype=bool)
        for reach in self._reaches:
            found |= reach.decide(*angles, distance, there) == EVALUATE
        return found

    def entered_s(self, step_s: float, until_s: float = math.inf) -> dict[str, float]:
        """Return when each target that ever is covered is so for the first time.

        Parameters
        ----------
        step_s : float
            A stay that is shorter may be missed; entries are found to a millisecond.
        until_s : float
            When the run ended, where that was before its time.
        """
        end_s = min(self.duration_s, until_s)
        grid = np.append(np.arange(0.0, end_s, step_s), end_s)
        found = {}
        for target in self._source.targets:
            inside = self.holds(target, grid)
            if not inside.any():
                continue
            first = int(np.argmax(inside))
            found[target.name] = float(grid[first])
            if first:
                found[target.name] = self._entry(target, grid[first - 1], grid[first])
        return found

    def _entry(self, target: Any, out_s: float, in_s: float) -> float:
        """Return when a target enters that is outside at one time and inside at the other."""
        for _ in range(math.ceil(math.log2(max((in_s - out_s) / _WELL_S, 1.0)))):
            middle = 0.5 * (out_s + in_s)
            if self.holds(target, np.array([middle]))[0]:
                in_s = middle
            else:
                out_s = middle
        return float(in_s)
