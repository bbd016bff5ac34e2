"""Small dense algebra over many tracks at once: components first, tracks last.

A vector of every track is an array (d, n), a matrix (a, b, n). Every operation is an elementwise
one over the last axis, so that a track's result is the same to the bit however many others are
computed with it; sums run over components in a fixed order.
"""

from collections.abc import Sequence
from typing import Any, Self

import numpy as np

from dsa_des.arrays.types import FloatArray, IntArray


def matrix_product(left: FloatArray, right: FloatArray) -> FloatArray:
    """Return left · right for matrices (a, k, n) and (k, b, n)."""
    terms = zip(left.swapaxes(0, 1)[:, :, np.newaxis], right[:, np.newaxis], strict=True)
    column, row = next(terms)
    total = column * row
    if len(right) > 1:
        term = np.empty_like(total)  # one for all terms: memory is the cost here
        for column, row in terms:
            np.multiply(column, row, out=term)
            total += term
    return total


def multiply_by_transpose(left: FloatArray, right: FloatArray) -> FloatArray:
    """Return left · rightᵀ for matrices (a, k, n) and (b, k, n)."""
    return matrix_product(left, right.swapaxes(0, 1))


def matrix_times_vector(matrix: FloatArray, vector: FloatArray) -> FloatArray:
    """Return matrix · vector for (a, k, n) and (k, n)."""
    total = matrix[:, 0] * vector[0]
    for k in range(1, matrix.shape[1]):
        total += matrix[:, k] * vector[k]
    return total


def select_tracks(values: FloatArray, which: IntArray) -> FloatArray:
    """Return a copy of the values (…, n) of these tracks only, contiguous in memory."""
    return values.take(which, axis=-1)


class Batch:
    """A record of arrays whose last axis is tracks; parts may also be lists of arrays or None."""

    def take(self, which: IntArray | slice) -> Self:
        """Return the record for these tracks only."""
        return type(self)(*(_select_part(part, which) for part in vars(self).values()))


def _select_part(part: Any, which: IntArray | slice) -> Any:
    if isinstance(part, np.ndarray):
        return part[..., which] if isinstance(which, slice) else part.take(which, axis=-1)
    if isinstance(part, list):
        return [_select_part(one, which) for one in part]
    return None if part is None else part.take(which)


def is_everything(which: IntArray, count: int) -> bool:
    """Return whether an index array counts 0 to count - 1, so that selecting changes nothing."""
    if len(which) != count or (count and (which[0] != 0 or which[-1] != count - 1)):
        return False
    return count < 3 or bool((which == np.arange(count)).all())


def symmetrised(matrix: FloatArray) -> FloatArray:
    """Return the mean of matrices (d, d, n) and their transposes."""
    return 0.5 * (matrix + matrix.swapaxes(0, 1))


def cholesky(matrix: FloatArray) -> FloatArray:
    """Return lower triangular Cholesky roots (d, d, n); NaN where not positive definite."""
    size = len(matrix)
    root = np.zeros(matrix.shape)
    with np.errstate(invalid="ignore", divide="ignore"):
        for j in range(size):
            pivot = matrix[j, j]
            for k in range(j):
                pivot = pivot - root[j, k] * root[j, k]
            np.sqrt(np.where(pivot > 0.0, pivot, np.nan), out=root[j, j])
            for i in range(j + 1, size):
                value = matrix[i, j]
                for k in range(j):
                    value = value - root[i, k] * root[j, k]
                np.divide(value, root[j, j], out=root[i, j])
    return root


def solve_lower(root: FloatArray, right: FloatArray) -> FloatArray:
    """Return root⁻¹ · right for lower triangular roots (d, d, n) and right sides (d, …, n)."""
    result = np.empty((*right.shape[:-1], root.shape[-1]))
    for i in range(len(root)):
        value = right[i]
        for k in range(i):
            value = value - root[i, k] * result[k]
        np.divide(value, root[i, i], out=result[i])
    return result


def solve_lower_transposed(root: FloatArray, right: FloatArray) -> FloatArray:
    """Return root⁻ᵀ · right for lower triangular roots (d, d, n) and right sides (d, …, n)."""
    size = len(root)
    result = np.empty((*right.shape[:-1], root.shape[-1]))
    for i in range(size - 1, -1, -1):
        value = right[i]
        for k in range(i + 1, size):
            value = value - root[k, i] * result[k]
        np.divide(value, root[i, i], out=result[i])
    return result


def squared_length(vector: FloatArray) -> FloatArray:
    """Return the sum of squares over components, (d, n) → (n,)."""
    total = vector[0] * vector[0]
    for value in vector[1:]:
        total += value * value
    return total


def mahalanobis_squared(root: FloatArray, apart: FloatArray) -> FloatArray:
    """Return squared Mahalanobis distances (n,) of differences (d, n), by Cholesky roots."""
    return squared_length(solve_lower(root, apart))


def sum_in_order(parts: Sequence[FloatArray] | FloatArray) -> FloatArray:
    """Return the sum of arrays, or of one over its first axis, added one after the other."""
    total: FloatArray = parts[0]
    for part in parts[1:]:
        total = total + part
    return total


def log_determinant_from_root(root: FloatArray) -> FloatArray:
    """Return the logarithm of the determinant of each matrix, given its Cholesky root (d, d, n)."""
    total = np.log(root[0, 0])
    for i in range(1, len(root)):
        total = total + np.log(root[i, i])
    return 2.0 * total
