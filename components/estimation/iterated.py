"""Updates by measurements that turn out far from where they were linearised, iterated.

An extended Kalman filter takes what is measured for linear all the way from where a target was
expected to where it is. Where that is so far across the line of sight that the arc leaves its
tangent by more than the measurement's own error, the corrected state is off by what lies between,
and states a variance in which it is not. Then the update is done again by slopes where it led.

Source: B. M. Bell, F. W. Cathey, "The iterated Kalman filter update as a Gauss-Newton method", IEEE
Trans. Automatic Control 38 (1993).
"""

import numpy as np

from components.estimation.batched import matrix_times_vector, select_tracks
from components.estimation.frame import SensorPose
from components.estimation.kalman import Innovation, innovation, update
from components.estimation.measurement import Kind, expected_measurement, linearise, residual
from dsa_des.arrays.types import FloatArray

# By how many deviations of a measurement a step may leave the measured curve: one that leaves it
# by more is repeated, until one leaves it by less than the other.
_FAR, _NEAR = 1.0, 0.05
# A step that has not come to rest by then is left as the first one: none is known to be better.
_MOST_STEPS = 10


def iterate_updates_in_place(
    kind: Kind,
    pose: SensorPose,
    before: tuple[FloatArray, FloatArray],
    after: tuple[FloatArray, FloatArray],
    first: Innovation,
    apart: FloatArray,
) -> None:
    """Repeat, in `after`, Kalman updates with too nonlinear a measurement, until they settle.

    `before` and `after` are states and covariances without and with measurements, of which `first`
    is the innovation and `apart` the residual; their errors must be none that states carry. Updates
    within tolerance stay as they are, to the bit.
    """
    left = np.flatnonzero(
        _nonlinearity_in_deviations(kind, pose, before[0], after[0], first) > _FAR
    )
    if len(left) == 0:
        return
    state, covariance = select_tracks(before[0], left), select_tracks(before[1], left)
    measured = select_tracks(first.expected + apart, left)
    variance, pose, at = (
        select_tracks(first.spread, left),
        pose.take(left),
        select_tracks(after[0], left),
    )
    for _ in range(_MOST_STEPS):
        seen, jacobian = linearise(kind, at, pose)
        here = innovation(seen, jacobian, covariance, variance)
        back = matrix_times_vector(jacobian, (at - state)[: jacobian.shape[1]])
        moved, spread = update(state, covariance, here, residual(measured, seen) + back)
        bend = _nonlinearity_in_deviations(kind, pose, at, moved, here)
        ends = np.flatnonzero(bend <= _NEAR)
        after[0][:, left[ends]], after[1][:, :, left[ends]] = moved[:, ends], spread[:, :, ends]
        rest = np.flatnonzero(bend > _NEAR)
        if not len(rest):
            return
        left, at, pose = left[rest], select_tracks(moved, rest), pose.take(rest)
        state, covariance = select_tracks(state, rest), select_tracks(covariance, rest)
        measured, variance = select_tracks(measured, rest), select_tracks(variance, rest)


def _nonlinearity_in_deviations(
    kind: Kind, pose: SensorPose, state: FloatArray, moved: FloatArray, slope: Innovation
) -> FloatArray:
    """Return the largest error at `moved` of linearising at `state`, in standard deviations."""
    step = (moved - state)[: slope.jacobian.shape[1]]
    off = residual(
        expected_measurement(kind, moved, pose),
        slope.expected + matrix_times_vector(slope.jacobian, step),
    )
    return np.asarray(np.sqrt((off * off / slope.spread).max(axis=0)))
