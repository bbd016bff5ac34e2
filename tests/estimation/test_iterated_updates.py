"""Updates far along a tangent are repeated, and come where least squares come."""

import numpy as np
from scipy.optimize import least_squares

from components.estimation.frame import SensorPose
from components.estimation.iterated import iterate_updates_in_place
from components.estimation.kalman import innovation, update
from components.estimation.measurement import Kind, expected_measurement, linearise, residual

KIND = Kind()
DEGREE = np.pi / 180.0


def corrected(east_m, deviation):
    """Return tracks expected 6 km ahead, seen `east_m` off, before and after; deviations by row."""
    count = len(east_m)
    pose = SensorPose(np.zeros((3, count)), np.repeat(np.eye(3)[:, :, np.newaxis], count, axis=2))
    state = np.zeros((6, count))
    state[0], state[4] = 6000.0, 50.0
    one = np.diag([350.0**2] * 3 + [70.0**2] * 3)
    one[0, 3] = one[3, 0] = one[1, 4] = one[4, 1] = one[2, 5] = one[5, 2] = 5.0 * 70.0**2 * 0.9
    covariance = np.repeat(one[:, :, np.newaxis], count, axis=2)
    there = state.copy()
    there[1] = east_m
    measured, variance = expected_measurement(KIND, there, pose), np.empty((3, count))
    variance[:] = np.square(deviation)[:, np.newaxis]
    first = innovation(*linearise(KIND, state, pose), covariance, variance)
    apart = residual(measured, first.expected)
    once = update(state, covariance, first, apart)
    again = tuple(part.copy() for part in once)
    iterate_updates_in_place(KIND, pose, (state, covariance), again, first, apart)
    return (state, covariance, measured, pose, variance), once, again


def test_a_precise_radar_far_across_is_where_least_squares_put_it():
    """The posterior's mode by a general solver, its covariance by the information there."""
    (state, covariance, measured, pose, variance), once, again = corrected(
        np.array([1000.0, -400.0]), (0.02 * DEGREE, 0.02 * DEGREE, 1.0)
    )
    for k in range(2):
        white = np.linalg.inv(np.linalg.cholesky(covariance[..., k]))
        here = pose.take(slice(k, k + 1))

        def off(x, k=k, white=white, here=here):
            left = residual(
                measured[:, k : k + 1], expected_measurement(KIND, x[:, np.newaxis], here)
            )[:, 0]
            return np.append(white @ (x - state[:, k]), left / np.sqrt(variance[:, k]))

        best = least_squares(off, state[:, k], x_scale="jac", xtol=1e-15, ftol=1e-15, gtol=1e-15).x
        np.testing.assert_allclose(again[0][:, k], best, atol=0.02)
        slope = np.zeros((3, 6))
        slope[:, :3] = linearise(KIND, best[:, np.newaxis], here)[1][..., 0]
        known = np.linalg.inv(covariance[..., k]) + slope.T @ np.diag(1 / variance[:, k]) @ slope
        np.testing.assert_allclose(again[1][..., k], np.linalg.inv(known), rtol=1e-3, atol=0.02)
    # The tangent at 6 km leaves the circle by 1000² / (2 · 6000) = 83 m; it states 1 m.
    assert np.hypot(once[0][0, 0], once[0][1, 0]) - measured[2, 0] > 75.0


def test_what_is_within_tolerance_stays_as_it_is():
    """100 m across 6 km are 0.8 m off the tangent; who else is updated changes nothing."""
    deviation = (0.02 * DEGREE, 0.02 * DEGREE, 1.0)
    _, once, again = corrected(np.array([100.0, 1000.0]), deviation)
    _, _, alone = corrected(np.array([1000.0]), deviation)
    for before, after, single in zip(once, again, alone, strict=True):
        assert (before[..., 0] == after[..., 0]).all()
        assert (before[..., 1] != after[..., 1]).any()
        assert (after[..., 1] == single[..., 0]).all()
