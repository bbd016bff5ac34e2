"""The unscented Kalman filter: the same update with moments taken from sigma points.

Source: Julier, Uhlmann, *Unscented filtering and nonlinear estimation*, Proc. IEEE 92 (2004);
weights of Wan, van der Merwe (2000). Means of angles are those of unit vectors.
"""

from dataclasses import dataclass

import numpy as np

from components.estimation.batched import (
    cholesky,
    multiply_by_transpose,
    solve_lower,
    solve_lower_transposed,
    symmetrised,
)
from components.estimation.carried_errors import ReportedErrors
from components.estimation.estimator import Estimates, ExtendedKalmanFilter, SingleModelFilter
from components.estimation.frame import SensorPose
from components.estimation.kalman import Moments
from components.estimation.measurement import Kind, expected_measurement, residual
from components.estimation.motion import Motion
from dsa_des.arrays.types import FloatArray


@dataclass(frozen=True)
class SigmaPoints:
    """Parameters of the unscented transform: spread and weights of its sigma points.

    With the defaults no weight is negative, so that no covariance can lose its sign.
    """

    alpha: float = 1.0  # Spread
    beta: float = 2.0  # Knowledge of the distribution, 2 for a Gaussian
    kappa: float = 0.0  # Second spread

    def weights(self, size: int) -> tuple[FloatArray, FloatArray, float]:
        """Return weights of means and covariances, (2 d + 1,), and the squared scale d + lambda."""
        spread = self.alpha**2 * (size + self.kappa)
        mean = np.full(2 * size + 1, 0.5 / spread)
        mean[0] = (spread - size) / spread
        covariance = mean.copy()
        covariance[0] += 1.0 - self.alpha**2 + self.beta
        return mean, covariance, spread

    def points_around(self, state: FloatArray, covariance: FloatArray) -> FloatArray:
        """Return sigma points (d, 2 d + 1, n) about states (d, n), the state itself first."""
        size = len(state)
        apart = cholesky(covariance) * np.sqrt(self.weights(size)[2])
        points = np.repeat(state[:, np.newaxis], 2 * size + 1, axis=1)
        points[:, 1 : size + 1] += apart
        points[:, size + 1 :] -= apart
        return points


@dataclass(frozen=True)
class UnscentedKalmanFilter(SingleModelFilter):
    """Kalman filter of one model that takes means and covariances from sigma points."""

    sigma: SigmaPoints = SigmaPoints()

    @property
    def linearised(self) -> ExtendedKalmanFilter:
        """The extended Kalman filter, as straight sigma points leave a curved uncertainty."""
        return ExtendedKalmanFilter(self.model)

    def predict(self, tracks: Estimates, dt_s: FloatArray) -> Estimates:
        """Return the tracks predicted by these times (n,), s, by moving sigma points."""
        (state,), (covariance,), weights = tracks
        state, covariance = predict_unscented(self.model, state, covariance, dt_s, self.sigma)
        return Estimates([state], [covariance], weights)

    def expect(
        self,
        kind: Kind,
        tracks: Estimates,
        pose: SensorPose,
        reported: ReportedErrors | None = None,
    ) -> list[Moments]:
        """Return mean and covariance of expected measurements, by sigma points."""
        (state,), (covariance,), _ = tracks
        return [unscented_moments(kind, state, covariance, pose, self.sigma, reported)]


def predict_unscented(
    model: Motion,
    state: FloatArray,
    covariance: FloatArray,
    dt_s: FloatArray,
    sigma: SigmaPoints,
) -> tuple[FloatArray, FloatArray]:
    """Return predicted state and covariance, those of the moved sigma points plus noise."""
    size, count = state.shape
    of_mean, of_covariance, _ = sigma.weights(size)
    points = sigma.points_around(state, covariance)
    many = points.shape[1]
    moved = model.move(points.reshape(size, -1), np.tile(dt_s, many)).reshape(size, many, count)
    mean = _weighted_sum_of_points(moved, of_mean)
    apart = moved - mean[:, np.newaxis]
    spread = multiply_by_transpose(apart * of_covariance[:, np.newaxis], apart)
    return mean, symmetrised(spread + model.noise(dt_s))


def unscented_moments(
    kind: Kind,
    state: FloatArray,
    covariance: FloatArray,
    pose: SensorPose,
    sigma: SigmaPoints,
    reported: ReportedErrors | None = None,
) -> Moments:
    """Return mean and covariance of the measurements expected of sigma points about the state.

    The slope that it bears is that of statistical linearisation, Cᵀ P⁻¹, and its spread what the
    slope leaves over: with both, the Joseph form gives P - K S Kᵀ and stays positive.
    """
    size, count = state.shape
    of_mean, of_covariance, _ = sigma.weights(size)
    points = sigma.points_around(state, covariance)
    many = points.shape[1]
    poses = SensorPose(
        np.tile(pose.position_m, many),
        np.tile(pose.to_body, many),
        None if pose.velocity_m_s is None else np.tile(pose.velocity_m_s, many),
    )
    how = expected_measurement if reported is None else reported.repeat(many).expected_measurement
    seen = how(kind, points.reshape(size, -1), poses).reshape(kind.size, many, count)
    mean = _weighted_sum_of_points(seen, of_mean)
    for angle in range(2):
        sin = _weighted_sum_of_points(np.sin(seen[angle])[np.newaxis], of_mean)[0]
        cos = _weighted_sum_of_points(np.cos(seen[angle])[np.newaxis], of_mean)[0]
        mean[angle] = np.arctan2(sin, cos)
    flat = np.repeat(mean[:, np.newaxis], many, axis=1).reshape(kind.size, -1)
    apart = residual(seen.reshape(kind.size, -1), flat).reshape(seen.shape)
    weighted = apart * of_covariance[:, np.newaxis]
    total = multiply_by_transpose(weighted, apart)
    cross = multiply_by_transpose(points - state[:, np.newaxis], weighted)
    root = cholesky(covariance)
    slope = solve_lower_transposed(root, solve_lower(root, cross)).swapaxes(0, 1)
    # As a sum of squares it keeps its sign, which the difference of the two would lose.
    moved = points - state[:, np.newaxis]
    rest = apart.copy()
    for k in range(size):
        rest -= slope[:, k, np.newaxis] * moved[k]
    left_over = symmetrised(multiply_by_transpose(rest * of_covariance[:, np.newaxis], rest))
    return Moments(mean, symmetrised(total), cross, slope, left_over)


def _weighted_sum_of_points(points: FloatArray, weights: FloatArray) -> FloatArray:
    total = weights[0] * points[:, 0]
    for k in range(1, points.shape[1]):
        total += weights[k] * points[:, k]
    return total
