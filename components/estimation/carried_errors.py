"""Errors that a filter carries as states of their own: what lasts of what aircraft say.

An error that is forgotten in a time constant (Gauss-Markov) is a state like any other: its variance
is 1 throughout, a measurement says by how much to multiply it, so that a track needs to know no
deviation before it is told one. They follow position and velocity in a track's state, and what a
motion model has besides comes after them.

Source: Schmidt, *Application of state-space methods to navigation problems* (1966), where such
states are only considered; here they are estimated as well, which is the Kalman filter of the whole
(Bar-Shalom, Li, Kirubarajan (2001), §8.2).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from components.estimation.batched import product
from components.estimation.frame import SensorPose
from components.estimation.measurement import Kind, expected, linearised
from components.estimation.motion import Motion
from dsa_des.arrays.types import BoolArray, FloatArray, IntArray

#: Which way an error goes: of a place along north or east, and of a velocity; of its height and of
#: its vertical rate; of the bearing and of the range at which it is seen.
NORTH, EAST, HEIGHT, SPEED_NORTH, SPEED_EAST, CLIMB, BEARING, RANGE = range(8)
# Position and velocity.
_MOVING = 6
# Steeper than this (as a share of the range) a bearing is none.
_LEVEL = 1e-3


@dataclass(frozen=True)
class MotionWithErrors:
    """A motion model beside errors that are forgotten."""

    model: Motion
    lasts_s: tuple[float, ...]

    @property
    def size(self) -> int:
        """Components of the state."""
        return self.model.size + len(self.lasts_s)

    def move(self, state: FloatArray, dt_s: FloatArray) -> FloatArray:
        """Return states (d, n) after the time (n,)."""
        errors, end = self._kept(dt_s), _MOVING + len(self.lasts_s)
        moved = self.model.move(np.concatenate([state[:_MOVING], state[end:]]), dt_s)
        return np.concatenate([moved[:_MOVING], errors * state[_MOVING:end], moved[_MOVING:]])

    def jacobian(self, state: FloatArray, dt_s: FloatArray) -> FloatArray:
        """Return the derivative of `move` by the state, (d, d, n)."""
        end = _MOVING + len(self.lasts_s)
        own = np.concatenate([state[:_MOVING], state[end:]])
        step = self._spread_out(self.model.jacobian(own, dt_s))
        for i, kept in enumerate(self._kept(dt_s)):
            step[_MOVING + i, _MOVING + i] = kept
        return step

    def noise(self, dt_s: FloatArray) -> FloatArray:
        """Return the covariance of what white noise adds, (d, d, n)."""
        added = self._spread_out(self.model.noise(dt_s))
        for i, kept in enumerate(self._kept(dt_s)):
            added[_MOVING + i, _MOVING + i] = 1.0 - kept * kept
        return added

    def _kept(self, dt_s: FloatArray) -> FloatArray:
        """Return how much of each error is left after a time, the same back as forth."""
        apart = np.abs(dt_s)
        at_once = np.where(apart > 0.0, np.inf, 0.0)
        return np.exp(-np.stack([apart / t if t > 0.0 else at_once for t in self.lasts_s]))

    def _spread_out(self, own: FloatArray) -> FloatArray:
        """Return a model's matrix with room for the errors."""
        end = _MOVING + len(self.lasts_s)
        whole = np.zeros((self.size, self.size, own.shape[2]))
        whole[:_MOVING, :_MOVING] = own[:_MOVING, :_MOVING]
        whole[:_MOVING, end:] = own[:_MOVING, _MOVING:]
        whole[end:, :_MOVING] = own[_MOVING:, :_MOVING]
        whole[end:, end:] = own[_MOVING:, _MOVING:]
        return whole


@dataclass(frozen=True, eq=False)
class ToldErrors:
    """The errors of measurements that aircraft report, or of pairs of them with tracks."""

    ways: Sequence[int]  # Which way each error goes (`NORTH` to `RANGE`)
    deviation: FloatArray  # (errors, n), standard deviation: m, m/s, rad; 0 where there is none
    age_s: FloatArray  # (n,), for how long positions were carried on by the reported velocity
    # (n,), whether a height leaves the range as it is: measured ranges with a reported height
    at_range: BoolArray

    def take(self, which: IntArray) -> "ToldErrors":
        """Return those of some of them."""
        return ToldErrors(
            self.ways, self.deviation[:, which], self.age_s[which], self.at_range[which]
        )

    def repeated(self, times: int) -> "ToldErrors":
        """Return them so many times, one after the other."""
        return ToldErrors(
            self.ways, np.tile(self.deviation, times), np.tile(self.age_s, times),
            np.tile(self.at_range, times),
        )  # fmt: skip

    def expected(self, kind: Kind, state: FloatArray, pose: SensorPose) -> FloatArray:
        """Return what would be measured of states with these errors, (m, n)."""
        return expected(kind, self._displaced(state, pose)[0], pose)

    def linearised(
        self, kind: Kind, state: FloatArray, pose: SensorPose
    ) -> tuple[FloatArray, FloatArray]:
        """Return the same, and its derivative by position, velocity and errors."""
        told, by_place, cylinder = self._displaced(state, pose)
        seen, slope = linearised(kind, told, pose)
        whole = np.zeros((len(seen), _MOVING + len(self.ways), seen.shape[1]))
        whole[:, :3] = product(slope[:, :3], by_place)
        if slope.shape[1] > 3:
            whole[:, 3:6] = slope[:, 3:6]
        effect = self._effects(cylinder)
        whole[:, _MOVING:] = product(slope, effect[: slope.shape[1]])
        return seen, whole

    def effects(self, position_m: FloatArray, pose: SensorPose) -> FloatArray:
        """Return how errors move what is told of places and velocities, (6, errors, n)."""
        still = np.zeros((_MOVING + len(self.ways), position_m.shape[1]))
        still[:3] = position_m
        return self._effects(self._displaced(still, pose)[2])

    def _sum(self, state: FloatArray, way: int) -> FloatArray:
        total = np.zeros(state.shape[1])
        for i, one in enumerate(self.ways):
            if one == way:
                total = total + self.deviation[i] * state[_MOVING + i]
        return total

    def _displaced(
        self, state: FloatArray, pose: SensorPose
    ) -> tuple[FloatArray, FloatArray, tuple[FloatArray, ...]]:
        """Return states as they are told, the derivative of places, and cosines of directions."""
        told = state[:_MOVING].copy()
        told[3] += self._sum(state, SPEED_NORTH)
        told[4] += self._sum(state, SPEED_EAST)
        told[5] -= self._sum(state, CLIMB)
        height = self._sum(state, HEIGHT)
        told[0] += self._sum(state, NORTH) + self.age_s * (told[3] - state[3])
        told[1] += self._sum(state, EAST) + self.age_s * (told[4] - state[4])
        told[2] += self.age_s * (told[5] - state[5]) - np.where(self.at_range, 0.0, height)
        by_place = np.zeros((3, 3, state.shape[1]))
        for i in range(3):
            by_place[i, i] = 1.0
        x, y, z = away = told[:3] - pose.position_m
        ground = np.hypot(x, y)
        far = np.maximum(np.sqrt(ground**2 + z**2), 1.0)
        if not self.at_range.any():
            safe = np.maximum(ground, _LEVEL * far)
            return told, by_place, (x / safe, y / safe, safe, -z, far)
        # In a cylinder about the vertical: a bearing turns, a height leaves the range as it is.
        up = -z + np.where(self.at_range, height, 0.0)
        distance = np.maximum(far + self._sum(state, RANGE), 1.0)
        level = np.sqrt(np.maximum(distance**2 - up**2, (_LEVEL * distance) ** 2))
        bearing = np.arctan2(y, x) + self._sum(state, BEARING)
        cos, sin = np.cos(bearing), np.sin(bearing)
        turned = np.stack([level * cos, level * sin, -up]) + pose.position_m
        safe = np.maximum(ground, _LEVEL * far)
        by_level = (distance / far * away) / level
        by_level[2] += up / level
        by_bearing = np.stack([-y, x, np.zeros_like(x)]) / safe**2
        moved = np.zeros_like(by_place)
        for j in range(3):
            moved[0, j] = cos * by_level[j] - level * sin * by_bearing[j]
            moved[1, j] = sin * by_level[j] + level * cos * by_bearing[j]
        moved[2, 2] = 1.0
        at = self.at_range
        told[:3] = np.where(at, turned, told[:3])
        return told, np.where(at, moved, by_place), (
            np.where(at, cos, x / safe), np.where(at, sin, y / safe), np.where(at, level, safe),
            np.where(at, up, -z), np.where(at, distance, far),
        )  # fmt: skip

    def _effects(self, cylinder: tuple[FloatArray, ...]) -> FloatArray:
        cos, sin, level, up, distance = cylinder
        found = np.zeros((_MOVING, len(self.ways), len(cos)))
        for i, (way, deviation) in enumerate(zip(self.ways, self.deviation, strict=True)):
            if way in (NORTH, EAST):
                found[way - NORTH, i] = deviation
            elif way in (SPEED_NORTH, SPEED_EAST):
                found[3 + way - SPEED_NORTH, i] = deviation
                found[way - SPEED_NORTH, i] = deviation * self.age_s
            elif way == CLIMB:
                found[5, i], found[2, i] = -deviation, -deviation * self.age_s
            elif way == HEIGHT:
                outward = np.where(self.at_range, -up / level, 0.0)
                found[0, i], found[1, i] = deviation * outward * cos, deviation * outward * sin
                found[2, i] = -deviation
            elif way == BEARING:
                found[0, i], found[1, i] = -deviation * level * sin, deviation * level * cos
            else:
                outward = deviation * distance / level
                found[0, i], found[1, i] = outward * cos, outward * sin
        return found
