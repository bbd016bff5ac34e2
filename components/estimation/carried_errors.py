"""Errors that a filter carries as states of their own: what lasts of what aircraft say.

An error that is forgotten in a time constant (Gauss-Markov) is a state like any other: its variance
is 1 throughout, a measurement says by how much to multiply it, so that a track needs to know no
deviation before one is reported. They follow position and velocity in a track's state, and what a
motion model has besides comes after them.

Source: Schmidt, *Application of state-space methods to navigation problems* (1966), where such
states are only considered; here they are estimated as well, which is the Kalman filter of the whole
(Bar-Shalom, Li, Kirubarajan (2001), §8.2).

A position is reported of some time ago and carried on by a velocity that is reported of another.
What the target's motion has changed since is an error of both, and the same change is in the error
of the predicted state: a filter that takes the two for independent is too sure of the velocity
(the same, §8.3.1, correlated noises).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from components.estimation.batched import (
    matrix_product,
    matrix_times_vector,
    multiply_by_transpose,
    select_tracks,
    squared_length,
    symmetrised,
)
from components.estimation.frame import SensorPose
from components.estimation.kalman import Moments
from components.estimation.measurement import Kind, expected_measurement, linearise
from components.estimation.motion import ConstantVelocity, Motion
from dsa_des.arrays.types import BoolArray, FloatArray

#: Which way an error goes: of a position along north or east, and of a velocity; of its height and
#: of its vertical rate; of the bearing and of the range at which it is seen; of a position that is
#: late, back along the way of its flight.
NORTH, EAST, HEIGHT, SPEED_NORTH, SPEED_EAST, CLIMB, BEARING, RANGE, LATENCY = range(9)
# Position and velocity.
_MOVING = 6
# Up to this share of it a late position is as late as before.
_SAME_WAY = 0.1
# Less than this of m² or m²/s² is nothing; and what rounding may make of a correlation of 1.
_LEAST_VARIANCE, _ONE = 1e-9, 1.0 + 1e-6
# Steeper than this (as a share of the range) a bearing is none.
_LEVEL = 1e-3


@dataclass(frozen=True)
class MotionWithErrors:
    """A motion model whose state also holds measurement errors that decay exponentially."""

    model: Motion
    lasts_s: tuple[float, ...]

    @property
    def size(self) -> int:
        """Number of components of the state, errors included."""
        return self.model.size + len(self.lasts_s)

    @property
    def error_slice(self) -> slice:
        """Slice of the state's components that are measurement errors."""
        return slice(_MOVING, _MOVING + len(self.lasts_s))

    def move(self, state: FloatArray, dt_s: FloatArray) -> FloatArray:
        """Return states (d, n) after the time (n,)."""
        errors, end = self._remaining_error_shares(dt_s), _MOVING + len(self.lasts_s)
        moved = self.model.move(np.concatenate([state[:_MOVING], state[end:]]), dt_s)
        return np.concatenate([moved[:_MOVING], errors * state[_MOVING:end], moved[_MOVING:]])

    def jacobian(self, state: FloatArray, dt_s: FloatArray) -> FloatArray:
        """Return the derivative of `move` by the state, (d, d, n)."""
        end = _MOVING + len(self.lasts_s)
        own = np.concatenate([state[:_MOVING], state[end:]])
        step = self._pad_with_zeros_for_errors(self.model.jacobian(own, dt_s))
        for i, kept in enumerate(self._remaining_error_shares(dt_s)):
            step[_MOVING + i, _MOVING + i] = kept
        return step

    def noise(self, dt_s: FloatArray) -> FloatArray:
        """Return the covariance that motion and errors gain by noise in a time, (d, d, n)."""
        added = self._pad_with_zeros_for_errors(self.model.noise(dt_s))
        for i, kept in enumerate(self._remaining_error_shares(dt_s)):
            added[_MOVING + i, _MOVING + i] = 1.0 - kept * kept
        return added

    def _remaining_error_shares(self, dt_s: FloatArray) -> FloatArray:
        """Return each error's share left after a time, (errors, n), alike for negative times."""
        apart = np.abs(dt_s)
        at_once = np.where(apart > 0.0, np.inf, 0.0)
        return np.exp(-np.stack([apart / t if t > 0.0 else at_once for t in self.lasts_s]))

    def _pad_with_zeros_for_errors(self, own: FloatArray) -> FloatArray:
        """Return a motion model's matrix (d, d, n) with rows and columns of 0 added for errors."""
        end = _MOVING + len(self.lasts_s)
        whole = np.zeros((self.size, self.size, own.shape[2]))
        whole[:_MOVING, :_MOVING] = own[:_MOVING, :_MOVING]
        whole[:_MOVING, end:] = own[:_MOVING, _MOVING:]
        whole[end:, :_MOVING] = own[_MOVING:, :_MOVING]
        whole[end:, end:] = own[_MOVING:, _MOVING:]
        return whole


@dataclass(frozen=True, eq=False)
class ReportedErrors:
    """Lasting errors of measurements that aircraft report, per measurement or pair with a track."""

    ways: Sequence[int]  # Which way each error goes (`NORTH` to `LATENCY`)
    # (errors, n), standard deviation: m, m/s, rad, s; 0 where there is none
    deviation: FloatArray
    age_s: FloatArray  # (n,), for how long positions were carried on by the reported velocity
    # (n,), whether a height leaves the range as it is: measured ranges with a reported height
    at_range: BoolArray
    # (3, n) or None: How far ahead of a late position a target is, by what its track has of that
    # already, m; NaN where nothing is known but its speed
    ahead_m: FloatArray | None = None

    def repeat(self, times: int) -> "ReportedErrors":
        """Return the errors tiled `times` times along the axis of measurements."""
        return ReportedErrors(
            self.ways, np.tile(self.deviation, times), np.tile(self.age_s, times),
            np.tile(self.at_range, times),
            None if self.ahead_m is None else np.tile(self.ahead_m, times),
        )  # fmt: skip

    def with_track_covariances(
        self, covariance: FloatArray, velocity: FloatArray
    ) -> "ReportedErrors":
        """Return these errors with how far targets are ahead of late reports by the track
        covariances; NaN where their velocity says otherwise.

        Later reports are late by the same: they tell nothing of it. The speed is known ever better
        and the way by which they are late with it, which would seem to tell; so they are as late
        as the track says, unless it has turned since, or others saw it.
        """
        if LATENCY not in self.ways:
            return self
        i = self.ways.index(LATENCY)
        ahead, way = covariance[:3, _MOVING + i], self.deviation[i] * velocity
        off = np.sqrt(squared_length(ahead - way)) > _SAME_WAY * np.sqrt(squared_length(way))
        return replace(self, ahead_m=np.where(off, np.nan, ahead))

    def _lead_over_late_position_m(self, state: FloatArray, deviation: FloatArray) -> FloatArray:
        """Return how far ahead of a report one deviation late the target is, (3, n), m."""
        way = deviation * state[3:_MOVING]
        return way if self.ahead_m is None else np.where(np.isnan(self.ahead_m), way, self.ahead_m)

    @property
    def uncorrected_components(self) -> BoolArray | None:
        """Return a mask (k, n) of components that late reports must not correct; None without any.

        All that an aircraft reports is late alike, so its reports do not tell by how much: only
        the errors of linearising would seem to.
        """
        if LATENCY not in self.ways:
            return None
        late = np.array([way == LATENCY for way in self.ways])
        own = late[:, np.newaxis] & (self.deviation > 0.0)
        return np.concatenate([np.zeros((_MOVING, own.shape[1]), dtype=bool), own])

    def expected_measurement(self, kind: Kind, state: FloatArray, pose: SensorPose) -> FloatArray:
        """Return the measurements (m, n) expected of states, with the errors in the states."""
        return expected_measurement(kind, self._reported_states(state, pose)[0], pose)

    def linearise(
        self, kind: Kind, state: FloatArray, pose: SensorPose
    ) -> tuple[FloatArray, FloatArray]:
        """Return states' expected measurements, with derivative by position, velocity, errors."""
        reported, by_position, cylinder = self._reported_states(state, pose)
        seen, slope = linearise(kind, reported, pose)
        whole = np.zeros((len(seen), _MOVING + len(self.ways), seen.shape[1]))
        whole[:, :3] = matrix_product(slope[:, :3], by_position)
        if slope.shape[1] > 3:
            whole[:, 3:6] = slope[:, 3:6]
        if LATENCY in self.ways:
            whole[:, 3:6] -= whole[:, :3] * self._sum_of_errors_of_way(state, LATENCY)
        effect = self._effects_in_cylinder(state, cylinder)
        whole[:, _MOVING:] = matrix_product(slope, effect[: slope.shape[1]])
        return seen, whole

    def effects_on_reported_states(self, moving: FloatArray, pose: SensorPose) -> FloatArray:
        """Return position and velocity changes per error's standard deviation, (6, errors, n)."""
        state = np.zeros((_MOVING + len(self.ways), moving.shape[1]))
        state[:_MOVING] = moving
        return self._effects_in_cylinder(state, self._reported_states(state, pose)[2])

    def _sum_of_errors_of_way(self, state: FloatArray, way: int) -> FloatArray:
        total = np.zeros(state.shape[1])
        for i, one in enumerate(self.ways):
            if one == way:
                total = total + self.deviation[i] * state[_MOVING + i]
        return total

    def _reported_states(
        self, state: FloatArray, pose: SensorPose
    ) -> tuple[FloatArray, FloatArray, tuple[FloatArray, ...]]:
        """Return states as they would be reported, the derivative of their positions, and the
        cylinder geometry about the sensor.
        """
        reported = state[:_MOVING].copy()
        reported[3] += self._sum_of_errors_of_way(state, SPEED_NORTH)
        reported[4] += self._sum_of_errors_of_way(state, SPEED_EAST)
        reported[5] -= self._sum_of_errors_of_way(state, CLIMB)
        if LATENCY in self.ways:
            i = self.ways.index(LATENCY)
            reported[:3] -= state[_MOVING + i] * self._lead_over_late_position_m(
                state, self.deviation[i]
            )
        height = self._sum_of_errors_of_way(state, HEIGHT)
        reported[0] += self._sum_of_errors_of_way(state, NORTH) + self.age_s * (
            reported[3] - state[3]
        )
        reported[1] += self._sum_of_errors_of_way(state, EAST) + self.age_s * (
            reported[4] - state[4]
        )
        reported[2] += self.age_s * (reported[5] - state[5]) - np.where(self.at_range, 0.0, height)
        by_position = np.zeros((3, 3, state.shape[1]))
        for i in range(3):
            by_position[i, i] = 1.0
        x, y, z = away = reported[:3] - pose.position_m
        ground = np.hypot(x, y)
        far = np.maximum(np.sqrt(ground**2 + z**2), 1.0)
        if not self.at_range.any():
            safe = np.maximum(ground, _LEVEL * far)
            return reported, by_position, (x / safe, y / safe, safe, -z, far)
        # In a cylinder about the vertical: a bearing turns, a height leaves the range as it is.
        up = -z + np.where(self.at_range, height, 0.0)
        distance = np.maximum(far + self._sum_of_errors_of_way(state, RANGE), 1.0)
        level = np.sqrt(np.maximum(distance**2 - up**2, (_LEVEL * distance) ** 2))
        bearing = np.arctan2(y, x) + self._sum_of_errors_of_way(state, BEARING)
        cos, sin = np.cos(bearing), np.sin(bearing)
        turned = np.stack([level * cos, level * sin, -up]) + pose.position_m
        safe = np.maximum(ground, _LEVEL * far)
        by_level = (distance / far * away) / level
        by_level[2] += up / level
        by_bearing = np.stack([-y, x, np.zeros_like(x)]) / safe**2
        moved = np.zeros_like(by_position)
        for j in range(3):
            moved[0, j] = cos * by_level[j] - level * sin * by_bearing[j]
            moved[1, j] = sin * by_level[j] + level * cos * by_bearing[j]
        moved[2, 2] = 1.0
        at = self.at_range
        reported[:3] = np.where(at, turned, reported[:3])
        return reported, np.where(at, moved, by_position), (
            np.where(at, cos, x / safe), np.where(at, sin, y / safe), np.where(at, level, safe),
            np.where(at, up, -z), np.where(at, distance, far),
        )  # fmt: skip

    def _effects_in_cylinder(
        self, state: FloatArray, cylinder: tuple[FloatArray, ...]
    ) -> FloatArray:
        cos, sin, level, up, distance = cylinder
        result = np.zeros((_MOVING, len(self.ways), len(cos)))
        for i, (way, deviation) in enumerate(zip(self.ways, self.deviation, strict=True)):
            if way in (NORTH, EAST):
                result[way - NORTH, i] = deviation
            elif way in (SPEED_NORTH, SPEED_EAST):
                result[3 + way - SPEED_NORTH, i] = deviation
                result[way - SPEED_NORTH, i] = deviation * self.age_s
            elif way == CLIMB:
                result[5, i], result[2, i] = -deviation, -deviation * self.age_s
            elif way == LATENCY:
                result[:3, i] = -self._lead_over_late_position_m(state, deviation)
            elif way == HEIGHT:
                outward = np.where(self.at_range, -up / level, 0.0)
                result[0, i], result[1, i] = deviation * outward * cos, deviation * outward * sin
                result[2, i] = -deviation
            elif way == BEARING:
                result[0, i], result[1, i] = -deviation * level * sin, deviation * level * cos
            else:
                outward = deviation * distance / level
                result[0, i], result[1, i] = outward * cos, outward * sin
        return result


@dataclass(frozen=True, eq=False)
class Ages:
    """Ages in s of positions and velocities when used, (n,) each; 0 where nothing is reported."""

    position: FloatArray  # For how long it was carried on
    velocity: FloatArray
    since: FloatArray  # Since the track was last updated: what was new before is in its state
    late: FloatArray  # How much older a position is than it was carried on for

    def error_covariances(
        self, model: Motion, state: FloatArray, velocity_variance: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return the covariance of age's errors in position and velocity, and the state's with it.

        They are (6, 6, n) and (d, 6, n), in m and m/s. What was reported of then is what the
        motion back from now says, less what noise has changed since, seen back from now.
        `velocity_variance` (3, n) is the state's: a late position errs by it too, by the product
        of two errors, which no derivative has. The one that an aircraft always has makes it go
        with the velocity's, so it counts as two deviations.
        """
        carried, now, age = self.position, self.velocity, self.position + self.late
        place, speed = model.jacobian(state, -age)[:3], model.jacobian(state, -now)[3:_MOVING]
        by_speed = multiply_by_transpose(matrix_product(speed, model.noise(now)), speed)
        both = multiply_by_transpose(
            matrix_product(place, model.noise(np.minimum(age, now))), speed
        )
        error = np.empty((_MOVING, _MOVING, len(age)))
        error[:3, :3] = multiply_by_transpose(matrix_product(place, model.noise(age)), place)
        error[:3, :3] += carried * (both + both.swapaxes(0, 1)) + carried**2 * by_speed
        for i in range(3):
            error[i, i] += (2.0 * self.late) ** 2 * velocity_variance[i]
        error[:3, 3:] = both + carried * by_speed
        error[3:, :3], error[3:, 3:] = error[:3, 3:].swapaxes(0, 1), by_speed
        shared = np.empty((len(state), _MOVING, len(age)))
        shared[:, 3:] = -multiply_by_transpose(model.noise(np.minimum(self.since, now)), speed)
        shared[:, :3] = -multiply_by_transpose(model.noise(np.minimum(self.since, age)), place)
        shared[:, :3] += carried * shared[:, 3:]
        return symmetrised(error), shared

    def add_age_errors(
        self, moments: Moments, model: Motion, state: FloatArray, covariance: FloatArray
    ) -> Moments:
        """Return the expected measurements' moments, enlarged by errors from the reports' age."""
        own = model.model if isinstance(model, MotionWithErrors) else model
        slope = np.ascontiguousarray(moments.jacobian[:, :_MOVING])
        if not isinstance(own, ConstantVelocity):
            moments = self._correct_for_past_velocity(moments, model, state, covariance)
        speeds = np.stack([covariance[i, i] for i in (3, 4, 5)])
        error, shared = self.error_covariances(model, state, speeds)
        shared = _clip_cross_covariance(shared, error, covariance)
        known, seen = slope.shape[1], moments.jacobian.shape[1]
        new = multiply_by_transpose(matrix_product(slope, error[:known, :known]), slope)
        with_state = multiply_by_transpose(shared[:, :known], slope)  # (d, m, n)
        both = matrix_product(moments.jacobian, with_state[:seen])
        own_error = new + both.swapaxes(0, 1)
        left_over = moments.left_over
        return replace(
            moments, total=moments.total + own_error + both, cross=moments.cross + with_state,
            left_over=own_error if left_over is None else left_over + own_error,
            shared=with_state[:seen].swapaxes(0, 1),
        )  # fmt: skip

    def _correct_for_past_velocity(
        self, moments: Moments, model: Motion, state: FloatArray, covariance: FloatArray
    ) -> Moments:
        """Return moments corrected for a turn or acceleration since the velocity was reported.

        A target that turns or accelerates had another velocity when it was reported; the moments
        are those as if it had this one.
        """
        carried, now, age = self.position, self.velocity, self.position + self.late
        off, by_state = np.zeros((6, len(age))), np.zeros((6, len(state), len(age)))
        off[3:] = model.move(state, -now)[3:6] - state[3:6]
        off[:3] = model.move(state, -age)[:3] - state[:3] + age * state[3:6] + carried * off[3:]
        by_state[3:] = model.jacobian(state, -now)[3:6]
        by_state[:3] = model.jacobian(state, -age)[:3]
        for i in range(3):
            by_state[i + 3, i + 3] -= 1.0
            by_state[i, i] -= 1.0
            by_state[i, i + 3] += age
        by_state[:3] += carried * by_state[3:]
        slope = np.ascontiguousarray(moments.jacobian[:, :6])
        more = matrix_product(slope, by_state)
        with_state = multiply_by_transpose(covariance, more)
        jacobian = more.copy()
        jacobian[:, : moments.jacobian.shape[1]] += moments.jacobian
        both = matrix_product(more, moments.cross)
        total = moments.total + both + both.swapaxes(0, 1) + matrix_product(more, with_state)
        return replace(
            moments, expected=moments.expected + matrix_times_vector(slope, off),
            total=symmetrised(total),
            cross=moments.cross + with_state, jacobian=jacobian,
        )  # fmt: skip


def _clip_cross_covariance(
    shared: FloatArray, error: FloatArray, covariance: FloatArray
) -> FloatArray:
    """Return cross-covariances of states and errors (d, k, n), scaled to correlations up to 1.

    A track that later reports brought back to a late one knows some of what changed in between,
    and so shares less of it than what changed: no correlation is beyond 1.
    """
    some = np.flatnonzero((shared != 0.0).any(axis=(0, 1)))
    if len(some) == 0:
        return shared
    state, own, across = (
        select_tracks(values, some).transpose(2, 0, 1) for values in (covariance, error, shared)
    )
    scale = np.sqrt(np.maximum(np.diagonal(own, axis1=1, axis2=2), _LEAST_VARIANCE))
    own = own / (scale[:, :, np.newaxis] * scale[:, np.newaxis])
    own += _LEAST_VARIANCE * np.eye(own.shape[1])
    across = across / scale[:, np.newaxis]
    of_state = across.swapaxes(1, 2) @ np.linalg.solve(state, across)
    root = np.linalg.inv(np.linalg.cholesky(own))
    most = np.linalg.eigvalsh(root @ of_state @ root.swapaxes(1, 2))[:, -1]
    result = shared.copy()
    result[:, :, some] *= np.where(most > _ONE, 1.0 / np.sqrt(np.maximum(most, _ONE)), 1.0)
    return result
