"""What a target does between the instant of what it tells and now.

A place is told of some time ago and carried on by a velocity that is told of another. What the
target's motion has changed since is an error of both, and the same change is in the error of the
predicted state: a filter that takes the two for independent is too sure of the velocity.

Source: Bar-Shalom, Li, Kirubarajan (2001), §8.3.1 (correlated noises).
"""

from dataclasses import dataclass, replace

import numpy as np

from components.estimation.batched import product, product_transposed
from components.estimation.carried_errors import MotionWithErrors
from components.estimation.kalman import Moments
from components.estimation.motion import ConstantVelocity, Motion
from dsa_des.arrays.types import FloatArray


@dataclass(frozen=True, eq=False)
class Ages:
    """How old reported positions and velocities are, (n,) each, s; 0 where not reported."""

    place: FloatArray
    velocity: FloatArray
    since: FloatArray  # Since the track was last updated: what was new before is in its state

    def errors(self, model: Motion, state: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return covariances of what is told of place and velocity, and of the state with it.

        Both are (6, 6, n), in m and m/s; of the second one rows are the state's.
        """
        own = model.model if isinstance(model, MotionWithErrors) else model
        age, now = self.place, self.velocity
        both = np.minimum(age, now)
        then, told, common = (own.noise(t) for t in (age, now, both))
        held, gained = (own.noise(np.minimum(self.since, t)) for t in (age, now))
        error, shared = np.zeros((6, 6, len(age))), np.zeros((6, 6, len(age)))
        for i in range(3):
            v = i + 3
            error[i, i] = then[i, i] - 2.0 * age * (then[i, v] - common[i, v])
            error[i, i] += age * age * (then[v, v] + told[v, v] - 2.0 * common[v, v])
            error[i, v] = common[i, v] - age * (common[v, v] - told[v, v])
            error[v, i], error[v, v] = error[i, v], told[v, v]
            shared[i, i] = age * (held[i, v] - gained[i, v]) - held[i, i]
            shared[v, i] = age * (held[v, v] - gained[v, v]) - held[i, v]
            shared[i, v], shared[v, v] = -gained[i, v], -gained[v, v]
        if not isinstance(own, ConstantVelocity):
            # By how much the model itself has it change: that is not carried back.
            changed = model.move(state, -now)[3:6] - state[3:6]
            for i in range(3):
                error[i, i] += (age * changed[i]) ** 2
                error[i + 3, i + 3] += changed[i] ** 2
        return error, shared

    def added(self, moments: Moments, model: Motion, state: FloatArray) -> Moments:
        """Return what is expected of measurements, with what ages add to it."""
        error, shared = self.errors(model, state)
        slope = np.ascontiguousarray(moments.jacobian[:, :6])
        known = slope.shape[1]
        new = product_transposed(product(slope, error[:known, :known]), slope)
        with_state = product_transposed(shared[:, :known], slope)  # (6, m, n)
        both = product(slope, with_state[:known])
        cross = moments.cross.copy()
        cross[:6] += with_state
        own = new + both.swapaxes(0, 1)
        return replace(
            moments, total=moments.total + own + both, cross=cross,
            left_over=own if moments.left_over is None else moments.left_over + own,
            shared=with_state.swapaxes(0, 1),
        )  # fmt: skip
