"""The extended Kalman filter's update, and how far a measurement lies from a track.

Sources: Bar-Shalom, Li, Kirubarajan (2001), §10.3; the Joseph form is eq. 7.3.4-4 of Bucy, Joseph
(1968) and keeps a covariance symmetric and positive whatever the gain's rounding.
"""

from dataclasses import dataclass

import numpy as np

from components.estimation.batched import (
    cholesky,
    is_everything,
    log_determinant,
    product,
    product_transposed,
    solve_lower,
    solve_upper,
    squared_length,
)
from dsa_des.arrays.types import FloatArray, IntArray

# So many tracks are updated at a time: their matrices stay in the processor's cache.
_TOGETHER = 2048


@dataclass(frozen=True, eq=False)
class Innovation:
    """What a filter expects of a measurement, and how its covariance relates to it.

    Parameters
    ----------
    expected : (m, n)
    root : (m, m, n)
        Lower triangular root of the covariance of the residual.
    cross : (d, m, n)
        Covariance of the state with the measurement.
    jacobian : (m, d, n)
        Of the measurement by the state; for an unscented filter the regression's slope.
    spread : (m, n) or (m, m, n)
        Variances of the measurement's own errors; for an unscented filter with what the
        regression leaves over, which makes it a matrix.
    """

    expected: FloatArray
    root: FloatArray
    cross: FloatArray
    jacobian: FloatArray
    spread: FloatArray

    def take(self, which: IntArray | slice) -> "Innovation":
        """Return those of some tracks."""
        return Innovation(
            self.expected[..., which], self.root[..., which], self.cross[..., which],
            self.jacobian[..., which], self.spread[..., which],
        )  # fmt: skip


@dataclass(frozen=True, eq=False)
class Moments:
    """What a filter expects of any measurement of its tracks, before that one's own errors.

    Parameters
    ----------
    expected : (m, n)
    total : (m, m, n)
        Covariance of what is expected.
    cross, jacobian
        As in `Innovation`.
    left_over : (m, m, n) or None
        What the slope leaves of `total`; None where it is exact.
    """

    expected: FloatArray
    total: FloatArray
    cross: FloatArray
    jacobian: FloatArray
    left_over: FloatArray | None = None

    def innovation(self, variance: FloatArray, which: IntArray | None = None) -> Innovation:
        """Return the innovation of measurements with variances (m, k) of tracks (k,)."""
        expected, total, cross, jacobian = self.expected, self.total, self.cross, self.jacobian
        spread = self.left_over
        if which is not None and not is_everything(which, expected.shape[1]):
            expected, total = expected[..., which], total[..., which]
            cross, jacobian = cross[..., which], jacobian[..., which]
            spread = None if spread is None else spread[..., which]
        else:
            total = total.copy()
            spread = None if spread is None else spread.copy()
        for i in range(len(total)):
            total[i, i] += variance[i]
            if spread is not None:
                spread[i, i] += variance[i]
        return Innovation(
            expected, cholesky(total), cross, jacobian, variance if spread is None else spread
        )


def linear_moments(expected: FloatArray, jacobian: FloatArray, covariance: FloatArray) -> Moments:
    """Return the moments of an extended Kalman filter.

    Parameters
    ----------
    expected : (m, n)
    jacobian : (m, k, n)
        By the first k components of the state; the others do not enter.
    covariance : (d, d, n)
        Of the predicted state.
    """
    cross = product_transposed(covariance[:, : jacobian.shape[1]], jacobian)
    return Moments(expected, product(jacobian, cross[: jacobian.shape[1]]), cross, jacobian)


def innovation(
    expected: FloatArray, jacobian: FloatArray, covariance: FloatArray, variance: FloatArray
) -> Innovation:
    """Return the innovation of an extended Kalman filter for variances (m, n)."""
    return linear_moments(expected, jacobian, covariance).innovation(variance)


def updated(
    state: FloatArray, covariance: FloatArray, found: Innovation, residual: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return state and covariance after a measurement, in Joseph form.

    Parameters
    ----------
    state : (d, n)
    covariance : (d, d, n)
    found : Innovation
    residual : (m, n)
        Measured less expected.

    Returns
    -------
    state, covariance : arrays of the same shapes
    """
    count = state.shape[1]
    if count <= _TOGETHER:
        return _updated(state, covariance, found, residual)
    moved, spread = np.empty_like(state), np.empty_like(covariance)
    for first in range(0, count, _TOGETHER):
        part = slice(first, first + _TOGETHER)
        moved[:, part], spread[:, :, part] = _updated(
            state[:, part], covariance[:, :, part], found.take(part), residual[:, part]
        )
    return moved, spread


def _updated(
    state: FloatArray, covariance: FloatArray, found: Innovation, residual: FloatArray
) -> tuple[FloatArray, FloatArray]:
    gain = gain_of(found)
    moved = state.copy()
    for k in range(len(residual)):
        moved += gain[:, k] * residual[k]
    return moved, joseph(covariance, gain, found)


def gain_of(found: Innovation) -> FloatArray:
    """Return the gain, (d, m, n)."""
    weighted = solve_upper(found.root, solve_lower(found.root, found.cross.swapaxes(0, 1)))
    return weighted.swapaxes(0, 1)


def joseph(covariance: FloatArray, gain: FloatArray, found: Innovation) -> FloatArray:
    """Return (I - K H) P (I - K H)ᵀ + K R Kᵀ, (d, d, n).

    Its upper triangle is worked out and mirrored, so that it is symmetric to the bit. The product
    on the left is P - K (P Hᵀ)ᵀ, with what the innovation knows of P Hᵀ.
    """
    size, known, many = len(gain), found.jacobian.shape[1], gain.shape[1]
    shrunk = covariance[:, :known] - product_transposed(gain, found.cross[:known])
    right = -product(gain, found.jacobian)  # of (I - K H), what is not of the identity
    for i in range(known):
        right[i, i] += 1.0
    if found.spread.ndim == 2:
        weighted = gain * np.sqrt(found.spread)
        other = weighted
    else:
        weighted, other = product(gain, found.spread), gain
    whole = np.empty_like(covariance)
    term = np.empty((size, covariance.shape[2]))
    for j in range(size):
        column, part = whole[: j + 1, j], term[: j + 1]
        np.multiply(weighted[: j + 1, 0], other[j, 0], out=column)
        for k in range(1, many):
            np.multiply(weighted[: j + 1, k], other[j, k], out=part)
            column += part
        for k in range(known):
            np.multiply(shrunk[: j + 1, k], right[j, k], out=part)
            column += part
        if j >= known:
            column += covariance[: j + 1, j]
            for k in range(many):
                np.multiply(gain[: j + 1, k], found.cross[j, k], out=part)
                column -= part
        whole[j, :j] = whole[:j, j]
    return whole


def distance_squared(found: Innovation, residual: FloatArray) -> FloatArray:
    """Return the squared Mahalanobis distance of residuals (m, n), shape (n,)."""
    return squared_length(solve_lower(found.root, residual))


def log_likelihood(found: Innovation, distance: FloatArray) -> FloatArray:
    """Return the logarithm of the density of measurements at squared distances, (n,)."""
    many = len(found.root)
    return -0.5 * (distance + log_determinant(found.root) + many * np.log(2.0 * np.pi))
