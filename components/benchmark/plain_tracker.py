"""The yardstick of track updates: one small Kalman filter per track, in a plain loop.

What one writes in an afternoon: for every look and every track a predicted state, the measurement
linearised, gates, a global assignment by SciPy and an update in Joseph form, on 6 by 6 matrices.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import atan2, hypot, pi, sqrt

import numpy as np
from scipy.optimize import linear_sum_assignment

from dsa_des.arrays.types import FloatArray

# Chi-square quantiles at 0.997, by degrees of freedom.
_GATES = {2: 11.618, 3: 13.931}
_UNUSED = 1e6


@dataclass(frozen=True, eq=False)
class PlainLook:
    """One look of one sensor.

    Parameters
    ----------
    time_s : float
    position_m : (3,)
        Of the sensor, north, east, down.
    to_body : (3, 3)
    measured, variance : (detections, 2) or (detections, 3)
        Azimuth, elevation and, where it is measured, range.
    """

    time_s: float
    position_m: FloatArray
    to_body: FloatArray
    measured: FloatArray
    variance: FloatArray


def seen(state: FloatArray, look: PlainLook, size: int) -> tuple[FloatArray, FloatArray]:
    """Return what a look would measure of a state, (size,), and the derivative, (size, 6)."""
    away = state[:3] - look.position_m
    x, y, z = look.to_body @ away
    level, distance = hypot(x, y), sqrt(x * x + y * y + z * z)
    slope = np.zeros((size, 6))
    by_body = np.array(
        [
            [-y / level**2, x / level**2, 0.0],
            [x * z / (level * distance**2), y * z / (level * distance**2), -level / distance**2],
            [x / distance, y / distance, z / distance],
        ]
    )
    slope[:, :3] = by_body[:size] @ look.to_body
    return np.array([atan2(y, x), atan2(-z, level), distance])[:size], slope


def track_plainly(
    looks: Sequence[PlainLook],
    states: Sequence[FloatArray],
    covariances: Sequence[FloatArray],
    intensity: float,
    begin_s: float = 0.0,
) -> tuple[list[FloatArray], list[FloatArray]]:
    """Return states and covariances of tracks after all looks.

    Parameters
    ----------
    looks : sequence of PlainLook
        In order of time.
    states, covariances : sequences of (6,) and (6, 6)
        Of the tracks, at `begin_s`.
    intensity : float
        Of the white acceleration, m²/s³.
    """
    states, covariances, last_s = list(states), list(covariances), begin_s
    step, identity = np.eye(6), np.eye(6)
    for look in looks:
        dt = look.time_s - last_s
        last_s = look.time_s
        step[:3, 3:] = dt * np.eye(3)
        noise = intensity * np.kron([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]], np.eye(3))
        count, size = look.measured.shape
        cost = np.full((len(states), count), _UNUSED)
        known = []
        for k in range(len(states)):
            state, covariance = step @ states[k], step @ covariances[k] @ step.T + noise
            states[k], covariances[k] = state, covariance
            if count == 0:
                continue
            expected, slope = seen(state, look, size)
            apart = look.measured - expected
            apart[:, 0] = (apart[:, 0] + pi) % (2.0 * pi) - pi
            total = slope @ covariance @ slope.T
            known.append((slope, apart))
            # A box about the gate first: most detections are someone else's.
            near = np.flatnonzero(
                (apart**2 <= _GATES[size] * (np.diag(total) + look.variance)).all(axis=1)
            )
            for j in near.tolist():
                spread = total + np.diag(look.variance[j])
                distance = float(apart[j] @ np.linalg.solve(spread, apart[j]))
                if distance <= _GATES[size]:
                    cost[k, j] = distance + np.log(np.linalg.det(spread))
        for k, j in zip(*linear_sum_assignment(cost), strict=True):
            if cost[k, j] >= _UNUSED:
                continue
            slope, apart = known[k]
            errors = np.diag(look.variance[j])
            spread = slope @ covariances[k] @ slope.T + errors
            gain = np.linalg.solve(spread, slope @ covariances[k]).T
            rest = identity - gain @ slope
            states[k] = states[k] + gain @ apart[j]
            covariances[k] = rest @ covariances[k] @ rest.T + gain @ errors @ gain.T
    return states, covariances
