"""Where the aircraft of a run truly are: in the frame of a tracker, and in sensors' coverage."""

import math
from collections.abc import Collection, Sequence
from typing import Any

import numpy as np

from components.geometry import (
    body_angles_unchecked,
    line_of_sight_ned,
    ned_to_body_unchecked,
    north_east_up_offsets_m,
)
from components.messages.detections import SensorOffer
from components.messages.reach import EVALUATE, Reach
from components.metrics.separation import lat_lon_alt_of, traffic_and_duration
from dsa_des.arrays.types import BoolArray, FloatArray
from dsa_des.block.component import Context
from dsa_des.scene.scene import Scene
from dsa_des.time.randomness import Streams

# Velocities are differences of positions so long apart, s.
_STEP_S = 0.02
# An entry into coverage is known so well, s.
_WELL_S = 1e-3


def position_and_presence_in_frame(
    flight: Any, time_s: FloatArray, origin: FloatArray
) -> tuple[FloatArray, BoolArray]:
    """Return an aircraft's north, east, down (3, n), m, and a mask (n,): True if present.

    The origin (3, n) is latitude, longitude (deg) and height (m) of the frame at each time.
    """
    state = flight.at(time_s)
    north, east, up = north_east_up_offsets_m(*origin, *lat_lon_alt_of(state))
    return np.stack([north, east, -up]), np.broadcast_to(state.present, time_s.shape)


def states_and_presence_in_frame(
    flights: Sequence[Any], time_s: FloatArray, origin: FloatArray
) -> tuple[FloatArray, BoolArray]:
    """Return positions and velocities (flights, 6, n), m and m/s, and presence (flights, n)."""
    state = np.empty((len(flights), 6, len(time_s)))
    present = np.empty((len(flights), len(time_s)), dtype=bool)
    for number, flight in enumerate(flights):
        state[number, :3], present[number] = position_and_presence_in_frame(flight, time_s, origin)
        before = np.maximum(time_s - _STEP_S, 0.0)
        after = before + 2.0 * _STEP_S
        first, _ = position_and_presence_in_frame(flight, before, origin)
        last, _ = position_and_presence_in_frame(flight, after, origin)
        state[number, 3:] = (last - first) / (after - before)
    return state, present


class TargetsInFrame:
    """Targets in one north-east-down frame about a fixed origin (deg, m); NaN where absent."""

    def __init__(self, flights: Sequence[Any], origin: Sequence[float]) -> None:
        self._flights, self._origin = flights, np.array(origin)
        self.names = [flight.name for flight in flights]

    def position(self, flight: Any, time_s: FloatArray) -> FloatArray:
        """Return an aircraft's position (north, east, down), (3, n), m; NaN where absent."""
        origin = np.repeat(self._origin[:, np.newaxis], len(time_s), axis=1)
        position, there = position_and_presence_in_frame(flight, time_s, origin)
        return np.where(there, position, np.nan)

    def positions_at(self, time_s: FloatArray) -> FloatArray:
        """Return all targets' positions in the frame, (targets, 3, n), m; NaN where absent."""
        result = [self.position(flight, time_s) for flight in self._flights]
        return np.array(result).reshape(len(result), 3, len(time_s))

    def states(self, time_s: FloatArray) -> FloatArray:
        """Return all targets' positions (m), velocities (m/s) in the frame, (targets, 6, n)."""
        before = np.maximum(time_s - _STEP_S, 0.0)
        after = before + 2.0 * _STEP_S
        velocity = (self.positions_at(after) - self.positions_at(before)) / (2.0 * _STEP_S)
        return np.concatenate([self.positions_at(time_s), velocity], axis=1)


def sensor_reaches(scene: Scene, on: Collection[str] | None = None) -> list[Reach]:
    """Return the body-axis reaches of a scene's sensors, or with `on` of the blocks so named."""
    result = []
    for name, block in scene.blocks.items():
        if "detections" not in block.cls.outputs or (on is not None and name not in on):
            continue
        context = Context(Streams(scene.seed), scene.ticks_per_s, sections=scene.sections)
        offer = block.cls(block.name, block.parameters, context).offer("detections")
        if isinstance(offer, SensorOffer) and offer.reach is not None:
            result.append(offer.reach)
    return result


class Coverage:
    """The region where some sensor sees targets: in its field of view and within range.

    Hills and the horizon are not asked, nor are manoeuvres of the ownship: it flies on. Of a
    platform `flights` are its own and those of all that it may see, and sensors those `on` it.
    """

    def __init__(
        self,
        scene: Scene,
        flights: Sequence[Any] | None = None,
        on: Collection[str] | None = None,
    ) -> None:
        source, self.duration_s = traffic_and_duration(scene)
        own, *targets = source.seen_from() if flights is None else flights
        #: The flights of who looks and of all targets.
        self.aircraft: tuple[Any, Sequence[Any]] = own, targets
        self._reaches = sensor_reaches(scene, on)

    def is_covered(self, target: Any, time_s: FloatArray) -> BoolArray:
        """Return when a target is present and in a sensor's reach, a mask (n,) of the times."""
        own, other = self.aircraft[0].at(time_s), target.at(time_s)
        ends = [
            np.ascontiguousarray(np.broadcast_to(value, time_s.shape))
            for state in (own, other)
            for value in lat_lon_alt_of(state)
        ]
        north, east, down = line_of_sight_ned(*ends)
        attitude = [np.broadcast_to(v, time_s.shape) for v in (own.yaw_rad, own.pitch_rad,
                                                               own.roll_rad)]  # fmt: skip
        body = ned_to_body_unchecked(north, east, down, *attitude)
        angles = body_angles_unchecked(*(np.ascontiguousarray(axis) for axis in body))
        distance = np.sqrt(north**2 + east**2 + down**2)
        there = np.broadcast_to(own.present & other.present, time_s.shape)
        result = np.zeros(time_s.shape, dtype=bool)
        for reach in self._reaches:
            result |= reach.skip_reasons(*angles, distance, there) == EVALUATE
        return result

    def first_covered_s(self, step_s: float, until_s: float = math.inf) -> dict[str, float]:
        """Return by name when each target is first covered, s, to a millisecond; others omitted.

        A stay shorter than `step_s` may be missed; a run may have ended early, at `until_s`.
        """
        end_s = min(self.duration_s, until_s)
        grid = np.append(np.arange(0.0, end_s, step_s), end_s)
        result = {}
        for target in self.aircraft[1]:
            inside = self.is_covered(target, grid)
            if not inside.any():
                continue
            first = int(np.argmax(inside))
            result[target.name] = float(grid[first])
            if first:
                result[target.name] = self._entry_time_s(target, grid[first - 1], grid[first])
        return result

    def _entry_time_s(self, target: Any, out_s: float, in_s: float) -> float:
        """Return when a target enters the coverage, s, by bisection of times outside and in."""
        for _ in range(math.ceil(math.log2(max((in_s - out_s) / _WELL_S, 1.0)))):
            middle = 0.5 * (out_s + in_s)
            if self.is_covered(target, np.array([middle]))[0]:
                in_s = middle
            else:
                out_s = middle
        return float(in_s)
