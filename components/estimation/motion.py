"""How targets move between looks: constant velocity, coordinated turn, constant acceleration.

States are in a fixed local frame, north, east, down (`components.estimation.frame`): position in
m, velocity in m/s, then what the model has besides. Noise is given by intensities of white noise in
continuous time, so that two short steps are one long one.

Sources: Bar-Shalom, Li, Kirubarajan, *Estimation with Applications to Tracking and Navigation*
(2001), §6.2.2 (white acceleration), §6.2.3 (white jerk), §11.7 (coordinated turn, rate unknown).
"""

from dataclasses import dataclass
from typing import ClassVar, Protocol

import numpy as np

from components.estimation.batched import matrix_product, multiply_by_transpose, symmetrised
from dsa_des.arrays.types import FloatArray

# Below this |turn rate · time| series take the place of quotients; their error is under 1e-17.
_SMALL_TURN = 1e-2


class Motion(Protocol):
    """A motion model: predicts states and their covariances over time."""

    @property
    def size(self) -> int:
        """Number of components of the state; the first six are position and velocity."""
        ...

    def move(self, state: FloatArray, dt_s: FloatArray) -> FloatArray:
        """Return the states (d, n) moved on by the times (n,), s, without noise."""
        ...

    def jacobian(self, state: FloatArray, dt_s: FloatArray) -> FloatArray:
        """Return the derivative of `move` by the state, (d, d, n)."""
        ...

    def noise(self, dt_s: FloatArray) -> FloatArray:
        """Return the covariance that process noise adds in the time, (d, d, n)."""
        ...


def predict(
    model: Motion, state: FloatArray, covariance: FloatArray, dt_s: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return state and covariance predicted by a time, linearised at the state."""
    if isinstance(model, ConstantVelocity):
        return model.predict(state, covariance, dt_s)
    step = model.jacobian(state, dt_s)
    spread = multiply_by_transpose(matrix_product(step, covariance), step)
    spread += model.noise(dt_s)
    return model.move(state, dt_s), symmetrised(spread)


@dataclass(frozen=True)
class ConstantVelocity:
    """Nearly constant velocity, disturbed by white acceleration."""

    # Of the acceleration, the same along every axis: after a time t the velocity has gained the
    # variance intensity · t
    intensity_m2_s3: float
    size: ClassVar[int] = 6

    def move(self, state: FloatArray, dt_s: FloatArray) -> FloatArray:
        """Return states (6, n) after the time (n,)."""
        moved = state.copy()
        moved[:3] += dt_s * state[3:6]
        return moved

    def jacobian(self, state: FloatArray, dt_s: FloatArray) -> FloatArray:
        """Return the derivative of `move` by the state, (6, 6, n)."""
        step = np.zeros((6, 6, len(dt_s)))
        for i in range(6):
            step[i, i] = 1.0
        for i in range(3):
            step[i, i + 3] = dt_s
        return step

    def noise(self, dt_s: FloatArray) -> FloatArray:
        """Return the covariance of what white acceleration adds, (6, 6, n)."""
        return white_acceleration_covariance(6, self.intensity_m2_s3, dt_s)

    def predict(
        self, state: FloatArray, covariance: FloatArray, dt_s: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return state and covariance after a time; exact, as the model is linear."""
        moved = self.move(state, dt_s)
        spread = np.empty(covariance.shape)
        velocity, both_ways = covariance[3:, 3:], covariance[:3, 3:]
        gained = dt_s * velocity
        np.add(both_ways, gained, out=spread[:3, 3:])
        # A + t (B + Bᵀ + t C), symmetric to the bit as A and C are.
        gained += both_ways + both_ways.swapaxes(0, 1)
        gained *= dt_s
        np.add(covariance[:3, :3], gained, out=spread[:3, :3])
        spread[3:, 3:] = velocity
        q, t = self.intensity_m2_s3, dt_s
        position, both, speed = q * (t * t * t / 3.0), q * (t * t / 2.0), q * t
        elements = spread.reshape(36, len(dt_s))  # every seventh lies along a diagonal
        elements[0:15:7] += position
        elements[3:18:7] += both
        elements[21:36:7] += speed
        spread[3:, :3] = spread[:3, 3:].swapaxes(0, 1)
        return moved, spread


@dataclass(frozen=True)
class ConstantAcceleration:
    """Nearly constant acceleration: white jerk. The state has accelerations (m/s²) at 6, 7, 8."""

    intensity_m2_s5: float  # Of the jerk, the same along every axis
    size: ClassVar[int] = 9

    def move(self, state: FloatArray, dt_s: FloatArray) -> FloatArray:
        """Return states (9, n) after the time (n,)."""
        moved = state.copy()
        moved[:3] += dt_s * (state[3:6] + 0.5 * dt_s * state[6:9])
        moved[3:6] += dt_s * state[6:9]
        return moved

    def jacobian(self, state: FloatArray, dt_s: FloatArray) -> FloatArray:
        """Return the derivative of `move` by the state, (9, 9, n)."""
        step = np.zeros((9, 9, len(dt_s)))
        for i in range(9):
            step[i, i] = 1.0
        for i in range(6):
            step[i, i + 3] = dt_s
        for i in range(3):
            step[i, i + 6] = 0.5 * dt_s * dt_s
        return step

    def noise(self, dt_s: FloatArray) -> FloatArray:
        """Return the covariance of what white jerk adds, (9, 9, n)."""
        added = np.zeros((9, 9, len(dt_s)))
        powers = [dt_s]
        for _ in range(4):
            powers.append(powers[-1] * dt_s)
        # Element (a, b) of the axis: t^(5-a-b) / ((5-a-b) (2-a)! (2-b)!).
        factorial = (1.0, 1.0, 2.0)
        for a in range(3):
            for b in range(3):
                power = 5 - a - b
                value = powers[power - 1] / (power * factorial[2 - a] * factorial[2 - b])
                for i in range(3):
                    added[3 * a + i, 3 * b + i] = self.intensity_m2_s5 * value
        return added


@dataclass(frozen=True)
class CoordinatedTurn:
    """A level turn at a rate that is part of the state.

    The state has the turn rate (rad/s, positive to the right: north over east) at 6. Velocity is
    disturbed by white acceleration, the rate by white noise of its own.
    """

    intensity_m2_s3: float  # Of the acceleration
    turn_intensity_rad2_s3: float  # Of the turn rate's derivative
    size: ClassVar[int] = 7

    def move(self, state: FloatArray, dt_s: FloatArray) -> FloatArray:
        """Return states (7, n) after the time (n,)."""
        along, across, _, _ = turn_displacements_and_slopes(state[6], dt_s)
        cos, sin = np.cos(state[6] * dt_s), np.sin(state[6] * dt_s)
        north, east = state[3], state[4]
        moved = state.copy()
        moved[0] += along * north - across * east
        moved[1] += across * north + along * east
        moved[2] += dt_s * state[5]
        moved[3] = cos * north - sin * east
        moved[4] = sin * north + cos * east
        return moved

    def jacobian(self, state: FloatArray, dt_s: FloatArray) -> FloatArray:
        """Return the derivative of `move` by the state, (7, 7, n)."""
        along, across, along_by_rate, across_by_rate = turn_displacements_and_slopes(state[6], dt_s)
        cos, sin = np.cos(state[6] * dt_s), np.sin(state[6] * dt_s)
        north, east = state[3], state[4]
        step = np.zeros((7, 7, len(dt_s)))
        for i in (0, 1, 2, 5, 6):
            step[i, i] = 1.0
        step[0, 3], step[0, 4] = along, -across
        step[1, 3], step[1, 4] = across, along
        step[2, 5] = dt_s
        step[3, 3], step[3, 4] = cos, -sin
        step[4, 3], step[4, 4] = sin, cos
        step[0, 6] = along_by_rate * north - across_by_rate * east
        step[1, 6] = across_by_rate * north + along_by_rate * east
        step[3, 6] = -dt_s * (sin * north + cos * east)
        step[4, 6] = dt_s * (cos * north - sin * east)
        return step

    def noise(self, dt_s: FloatArray) -> FloatArray:
        """Return the process noise covariance of the time, (7, 7, n), as for a straight path."""
        added = white_acceleration_covariance(7, self.intensity_m2_s3, dt_s)
        added[6, 6] = self.turn_intensity_rad2_s3 * dt_s
        return added


def turn_displacements_and_slopes(
    rate_rad_s: FloatArray, dt_s: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return a turn's displacement along and across the initial velocity, per unit of speed, then
    the derivatives of these two by turn rate.
    """
    turned = rate_rad_s * dt_s
    small = np.abs(turned) < _SMALL_TURN
    safe = np.where(small, 1.0, turned)
    sin, half = np.sin(safe), np.sin(0.5 * safe)
    versed = 2.0 * half * half
    square = turned * turned
    one = np.where(small, 1.0 - square / 6.0 * (1.0 - square / 20.0 * (1.0 - square / 42.0)),
                   sin / safe)  # fmt: skip
    other = np.where(
        small,
        turned / 2.0 * (1.0 - square / 12.0 * (1.0 - square / 30.0 * (1.0 - square / 56.0))),
        versed / safe,
    )
    # The derivatives by ωt lose digits sooner, so their series reach one term further.
    one_by = np.where(
        small,
        -turned / 3.0 * (1.0 - square / 10.0 * (1.0 - square / 28.0 * (1.0 - square / 54.0))),
        (np.cos(safe) - one) / safe,
    )
    other_by = np.where(
        small,
        0.5 - square / 8.0 * (1.0 - square / 18.0 * (1.0 - square / 40.0)),
        (sin - other) / safe,
    )
    return dt_s * one, dt_s * other, dt_s * dt_s * one_by, dt_s * dt_s * other_by


def white_acceleration_covariance(
    size: int, intensity_m2_s3: float, dt_s: FloatArray
) -> FloatArray:
    """Return position and velocity covariance from white acceleration in time, (size, size, n)."""
    added = np.zeros((size, size, len(dt_s)))
    square = dt_s * dt_s
    for i in range(3):
        added[i, i] = intensity_m2_s3 * (square * dt_s / 3.0)
        added[i, i + 3] = added[i + 3, i] = intensity_m2_s3 * (square / 2.0)
        added[i + 3, i + 3] = intensity_m2_s3 * dt_s
    return added
