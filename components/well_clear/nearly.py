"""Equality of numbers up to rounding, as the alerting logic of DO-365 takes it.

Two numbers are nearly equal if few doubles lie between them; a zero and a number, if the latter
is tiny. Alerts hang on it only where an aircraft is on an edge to the last digits.
"""

from typing import Any

import numpy as np

from dsa_des.arrays.types import BoolArray, FloatArray

#: Doubles that nearly equal times may lie apart.
DOUBLES_APART = 16_348
#: A number nearly equals zero below this.
TINY = 1e-13
# More than `DOUBLES_APART` doubles are apart by this part of their size.
_CLOSE = DOUBLES_APART * 2.0**-52


def nearly_equal(
    first: Any, second: Any, doubles_apart: int = DOUBLES_APART, tiny: float = TINY
) -> BoolArray:
    """Tell whether numbers are equal up to rounding.

    Parameters
    ----------
    first, second : array_like
        Of any unit; infinities of one sign are equal.
    doubles_apart : int
        Most steps from one double to the next between them.
    tiny : float
        Bound on both where one of them is 0.

    Returns
    -------
    ndarray of bool
    """
    a = np.asarray(first, dtype=np.float64)
    b = np.asarray(second, dtype=np.float64)
    # Doubles of one sign are in the order of their bits read as whole numbers.
    apart = np.abs(np.abs(a).view(np.int64) - np.abs(b).view(np.int64))
    alike = (apart <= doubles_apart) & ((a >= 0.0) == (b >= 0.0))
    zero = (a == 0.0) | (b == 0.0)
    both_tiny = (np.abs(a) < tiny) & (np.abs(b) < tiny)
    return np.asarray((alike & ~zero) | (zero & both_tiny))


def surely_less(first: Any, second: Any) -> BoolArray:
    """Tell whether one number lies below another, and not only by rounding."""
    first, second = np.asarray(first), np.asarray(second)
    less = np.asarray(first < second)
    with np.errstate(invalid="ignore"):  # of infinities of one sign, neither is less
        gap = second - first
    # Few pairs are so close that their doubles have to be counted; no infinite gap is.
    close = less & (gap < _CLOSE * (np.abs(first) + np.abs(second)) + 2.0 * TINY)
    if close.any():
        less = less & ~(close & nearly_equal(first, second))
    return less


def nearly_zero(values: FloatArray) -> BoolArray:
    """Tell whether numbers are zero up to rounding."""
    return np.asarray(np.abs(values) < TINY)
