"""The extended Kalman filter's update, and how far a measurement lies from a track.

Sources: Bar-Shalom, Li, Kirubarajan (2001), §10.3; the Joseph form is eq. 7.3.4-4 of Bucy, Joseph
(1968) and keeps a covariance symmetric and positive whatever the gain's rounding.
"""

from dataclasses import dataclass

import numpy as np

from components.estimation.batched import (
    Batch,
    cholesky,
    is_everything,
    log_determinant_from_root,
    matrix_product,
    multiply_by_transpose,
    select_tracks,
    solve_lower,
    solve_lower_transposed,
    symmetrised,
)
from dsa_des.arrays.types import BoolArray, FloatArray, IntArray

# So many tracks are updated at a time: their matrices stay in the processor's cache.
_TOGETHER = 2048


@dataclass(frozen=True, eq=False)
class Innovation(Batch):
    """Predicted measurement, root of residual covariance, and state-measurement covariance."""

    expected: FloatArray  # (m, n)
    root: FloatArray  # (m, m, n), lower triangular root of the covariance of the residual
    cross: FloatArray  # (d, m, n), covariance of the state with the measurement
    # (m, d, n), of the measurement by the state; for an unscented filter the regression's slope
    jacobian: FloatArray
    # (m, n) or (m, m, n): Variances of the measurement's own errors; for an unscented filter
    # with what the regression leaves over, which makes it a matrix
    spread: FloatArray
    # (m, k, n) or None: Of those errors, the covariance with the state's first k; `cross` has it
    shared: FloatArray | None = None
    # (k, n) or None: Which of the state's first k are considered and not corrected (Schmidt 1966)
    considered: BoolArray | None = None


@dataclass(frozen=True, eq=False)
class Moments:
    """Mean and covariance of the predicted measurement, without its own errors."""

    expected: FloatArray  # (m, n)
    total: FloatArray  # (m, m, n), covariance of what is expected
    cross: FloatArray  # As in `Innovation`
    jacobian: FloatArray  # As in `Innovation`
    # (m, m, n) or None: What the slope leaves of `total`; None where it is exact
    left_over: FloatArray | None = None
    # (m, k, n) or None: As in `Innovation`; then `left_over` has H times it as well, transposed
    shared: FloatArray | None = None
    considered: BoolArray | None = None  # As in `Innovation`

    def innovation(self, variance: FloatArray, which: IntArray | None = None) -> Innovation:
        """Return the innovation, with variances (m, k) added, for tracks `which` (k,), or all."""
        expected, total, cross, jacobian = self.expected, self.total, self.cross, self.jacobian
        spread, shared, considered = self.left_over, self.shared, self.considered
        if which is not None and not is_everything(which, expected.shape[1]):
            expected, total = select_tracks(expected, which), select_tracks(total, which)
            cross, jacobian = select_tracks(cross, which), select_tracks(jacobian, which)
            spread = None if spread is None else select_tracks(spread, which)
            shared = None if shared is None else select_tracks(shared, which)
            considered = None if considered is None else considered.take(which, axis=-1)
        else:
            total = total.copy()
            spread = None if spread is None else spread.copy()
        for i in range(len(total)):
            total[i, i] += variance[i]
            if spread is not None:
                spread[i, i] += variance[i]
        return Innovation(
            expected, cholesky(total), cross, jacobian, variance if spread is None else spread,
            shared, considered,
        )  # fmt: skip


def linear_moments(expected: FloatArray, jacobian: FloatArray, covariance: FloatArray) -> Moments:
    """Return mean and covariance of the expected measurement, linearised by its Jacobian."""
    cross = multiply_by_transpose(covariance[:, : jacobian.shape[1]], jacobian)
    return Moments(expected, matrix_product(jacobian, cross[: jacobian.shape[1]]), cross, jacobian)


def innovation(
    expected: FloatArray, jacobian: FloatArray, covariance: FloatArray, variance: FloatArray
) -> Innovation:
    """Return a linearised measurement's innovation, for independent errors of variances (m, n)."""
    return linear_moments(expected, jacobian, covariance).innovation(variance)


def update(
    state: FloatArray, covariance: FloatArray, innovation: Innovation, residual: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return state and covariance after the Kalman update with these residuals, in Joseph form."""
    count = state.shape[1]
    if count <= _TOGETHER:
        return _update_batch(state, covariance, innovation, residual)
    moved, spread = np.empty_like(state), np.empty_like(covariance)
    for first in range(0, count, _TOGETHER):
        part = slice(first, first + _TOGETHER)
        moved[:, part], spread[:, :, part] = _update_batch(
            state[:, part], covariance[:, :, part], innovation.take(part), residual[:, part]
        )
    return moved, spread


def _update_batch(
    state: FloatArray, covariance: FloatArray, innovation: Innovation, residual: FloatArray
) -> tuple[FloatArray, FloatArray]:
    # With S = root · rootᵀ: K r = (root⁻¹ (P Hᵀ)ᵀ)ᵀ (root⁻¹ r).
    weighted = solve_lower(innovation.root, innovation.cross.swapaxes(0, 1))
    apart = solve_lower(innovation.root, residual)
    moved = state + weighted[0] * apart[0]
    for k in range(1, len(apart)):
        moved += weighted[k] * apart[k]
    spread = joseph_covariance(covariance, weighted, innovation)
    if innovation.considered is not None:
        # With no gain of their own their covariances with the others are those of the best gain.
        for i, stays in enumerate(innovation.considered):
            moved[i] = np.where(stays, state[i], moved[i])
            spread[i, i] = np.where(stays, covariance[i, i], spread[i, i])
    return moved, spread


def joseph_covariance(
    covariance: FloatArray, weighted: FloatArray, innovation: Innovation
) -> FloatArray:
    """Return (I - K H) P (I - K H)ᵀ + K R Kᵀ, (d, d, n), symmetric to the bit.

    For the components that are measured (the first of `innovation.jacobian`) it is worked out as
    D - (D Hᵀ - K R) Kᵀ with D = P - K S Kᵀ, which is the same whatever the gain's rounding. What
    is left over, of and with the others, is P - K S Kᵀ in either form: H has no columns there.
    """
    known, size = innovation.jacobian.shape[1], len(covariance)
    whole = np.empty(covariance.shape)
    if known < size:
        _subtract_gain_squares(covariance, weighted, slice(known, size), slice(0, size), whole)
        whole[:known, known:] = whole[known:, :known].swapaxes(0, 1)
    measured = slice(0, known)
    block = whole[measured, measured]
    _subtract_gain_squares(covariance, weighted, measured, measured, whole)
    gain = solve_lower_transposed(innovation.root, weighted[:, measured])
    if innovation.spread.ndim == 2:
        own = gain * innovation.spread[:, np.newaxis]
    else:
        own = matrix_product(innovation.spread, gain)
    error = matrix_product(innovation.jacobian, block) - own  # (D Hᵀ - K R)ᵀ
    if innovation.shared is not None:
        # With errors that the state shares, S = H P Hᵀ + R + H M + (H M)ᵀ and K S = P Hᵀ + M:
        # D Hᵀ = K (R + H M) - M, and `spread` is R + (H M)ᵀ.
        error[:, : innovation.shared.shape[1]] += innovation.shared
    term = np.empty_like(block)
    for k in range(len(gain)):
        np.multiply(error[k, :, np.newaxis], gain[k, np.newaxis], out=term)
        block -= term
    whole[measured, measured] = symmetrised(block)
    return whole


def _subtract_gain_squares(
    covariance: FloatArray, weighted: FloatArray, rows: slice, columns: slice, out: FloatArray
) -> None:
    """Write P - K S Kᵀ for these rows and columns into `out`, exactly symmetric."""
    part = out[rows, columns]
    term = np.empty_like(part)
    np.multiply(weighted[0, rows, np.newaxis], weighted[0, np.newaxis, columns], out=term)
    np.subtract(covariance[rows, columns], term, out=part)
    for one in weighted[1:]:
        np.multiply(one[rows, np.newaxis], one[np.newaxis, columns], out=term)
        part -= term


# Beyond this many times its variance a measurement that tells nothing new is not inflated.
_MOST = 1e9


def equivalent_independent_variance(
    variance: FloatArray, common: FloatArray, spread: FloatArray
) -> FloatArray:
    """Return a variance that, if independent, improves the track as much as this correlated one.

    Where the error of a measurement has the covariance κ with that of what a track expects of it
    (of variance p), the best estimate of both has the variance (p R - κ²) / (p + R - 2 κ)
    (Bar-Shalom, Campo, IEEE Trans. AES 22 (1986)); a measurement with an error of its own would
    give the same with the variance p (p R - κ²) / (p - κ)².
    """
    # What lasts may be more than a detection states: a camera knows no range, so its angles hold
    # nothing of an error of its place.
    variance = np.maximum(variance, common)
    shared = np.minimum(common, spread)
    left = np.maximum(spread - shared, 1e-6 * spread)
    new = spread * (spread * variance - shared * shared) / (left * left)
    return np.where(common > 0.0, np.clip(new, variance, _MOST * variance), variance)


def log_likelihood(innovation: Innovation, distance: FloatArray) -> FloatArray:
    """Return the log Gaussian density (n,), given innovation and squared Mahalanobis distances."""
    many = len(innovation.root)
    return -0.5 * (
        distance + log_determinant_from_root(innovation.root) + many * np.log(2.0 * np.pi)
    )
