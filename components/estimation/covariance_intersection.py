"""Fusion of two estimates whose errors have an unknown correlation.

Covariance intersection weighs the information of the two by w and 1 - w. What comes out is never
too sure, whatever the correlation of their errors. Source: S. J. Julier, J. K. Uhlmann, "A
non-divergent estimation algorithm in the presence of unknown correlations", Proc. American Control
Conference, 1997, p. 2369-2373, eq. 6-8; weight by the least determinant or trace as there.

Both estimates are brought into the axes in which the first one's covariance is the identity and
the second one's information diagonal (eigenvalues λ): then the best weight is the root of a
function of one variable that only falls.
"""

from typing import Literal

import numpy as np

from components.estimation.batched import (
    cholesky,
    matrix_product,
    matrix_times_vector,
    multiply_by_transpose,
    solve_lower,
    solve_lower_transposed,
    sum_in_order,
    symmetrised,
)
from dsa_des.arrays.types import FloatArray

#: What the weight makes least, or how estimates are combined without one.
Rule = Literal["determinant", "trace", "independent"]

_STEPS = 60
# A weight is good when it moves by no more than this.
_CLOSE = 1e-15


def intersect_covariances(
    covariance: FloatArray, information: FloatArray, pull: FloatArray, rule: Rule
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the state's change, the new covariance, and the given covariance's weight (0 to 1)."""
    root = cholesky(covariance)
    scaled = matrix_product(matrix_product(root.swapaxes(0, 1), information), root)
    # LAPACK takes matrix by matrix: the result does not depend on the company.
    values, axes = np.linalg.eigh(np.ascontiguousarray(symmetrised(scaled).transpose(2, 0, 1)))
    eigenvalues = np.maximum(values.T, 0.0)
    turned = matrix_product(root, np.ascontiguousarray(axes.transpose(1, 2, 0)))
    if rule == "independent":
        weight, share = np.ones(covariance.shape[-1]), np.ones(covariance.shape[-1])
    else:
        cost = np.ones_like(eigenvalues)
        if rule == "trace":
            cost = turned[0] ** 2 + turned[1] ** 2 + turned[2] ** 2
        weight = best_weight(eigenvalues, cost, 1 if rule == "determinant" else 2)
        share = 1.0 - weight
    spread = 1.0 / (weight + share * eigenvalues)
    result = symmetrised(multiply_by_transpose(turned * spread, turned))
    return share * matrix_times_vector(result, pull), result, weight


def best_weight(eigenvalues: FloatArray, cost: FloatArray, power: int) -> FloatArray:
    """Return w in [0, 1] where Σ cost (1 - λ) / (w + (1 - w) λ)^power is 0, or else the nearer end.

    By Newton's steps, halving where they leave the bracket; `power` is 1 for the determinant, 2
    for the trace.
    """
    excess = cost * (1.0 - eigenvalues)

    def slope(weight: FloatArray) -> tuple[FloatArray, FloatArray]:
        mixed = weight + (1.0 - weight) * eigenvalues
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            term = excess / mixed**power
            value = sum_in_order(term)
            change = -power * sum_in_order(term * (1.0 - eigenvalues) / mixed)
        return value, change

    count = eigenvalues.shape[-1]
    low, high = np.zeros(count), np.ones(count)
    weight = np.full(count, 0.5)
    # A piece that tells nothing of some direction must not stand alone.
    ends_low = (eigenvalues > 0.0).all(axis=0) & (slope(low)[0] <= 0.0)
    ends_high = slope(high)[0] >= 0.0
    busy = ~(ends_low | ends_high)
    for _ in range(_STEPS):
        if not busy.any():
            break
        value, change = slope(weight)
        low, high = np.where(value > 0.0, weight, low), np.where(value > 0.0, high, weight)
        with np.errstate(divide="ignore", invalid="ignore"):
            new = weight - value / change
        middle = 0.5 * (low + high)
        new = np.where((new > low) & (new < high), new, middle)
        moved = np.abs(new - weight)
        weight = np.where(busy, new, weight)
        busy &= moved > _CLOSE
    return np.where(ends_high, 1.0, np.where(ends_low, 0.0, weight))


def inverse(covariance: FloatArray) -> FloatArray:
    """Return the inverses of positive definite matrices (d, d, n)."""
    root = cholesky(covariance)
    size = len(covariance)
    identity = np.repeat(np.eye(size)[:, :, np.newaxis], covariance.shape[-1], axis=2)
    # The roots have the tracks on their last axis, the right sides a column before it.
    whole = [
        solve_lower_transposed(root, solve_lower(root, np.ascontiguousarray(identity[:, j])))
        for j in range(size)
    ]
    return symmetrised(np.stack(whole, axis=1))
