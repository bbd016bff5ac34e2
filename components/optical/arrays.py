"""How do the optical functions turn any mix of inputs into arrays of one shape?"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float64]

# Beyond this the gap between neighbouring doubles is over a tenth of a radian: no direction is left
# in the number.
_LARGEST_MEANINGFUL_ANGLE_RAD = 1e15


def as_finite(name: str, value: ArrayLike) -> FloatArray:
    """Return `value` as float64, or say which argument is not a finite number.

    Raises
    ------
    ValueError
        If the value is not numeric or holds NaN or infinity.
    """
    try:
        array = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise ValueError(
            f"{name} is {value!r}: it must be a number or an array of numbers"
        ) from error
    finite = np.isfinite(array)
    if not finite.all():
        raise ValueError(
            f"{name} is {_first(array, ~finite)}: it must be finite (no NaN, no infinity) in every "
            "element"
        )
    return array


def require(name: str, array: FloatArray, allowed: NDArray[np.bool_], rule: str) -> None:
    """Raise one clear ValueError naming the first element of `array` that breaks `rule`.

    Raises
    ------
    ValueError
        If any element of `allowed` is False.
    """
    if not np.all(allowed):
        raise ValueError(f"{name} is {_first(array, ~allowed)}: it must be {rule}")


def non_negative(name: str, value: ArrayLike) -> FloatArray:
    """Return `value` as finite float64, all of it 0 or more."""
    array = as_finite(name, value)
    require(name, array, array >= 0.0, "0 or more")
    return array


def positive(name: str, value: ArrayLike) -> FloatArray:
    """Return `value` as finite float64, all of it above 0."""
    array = as_finite(name, value)
    require(name, array, array > 0.0, "above 0")
    return array


def angle(name: str, value: ArrayLike) -> FloatArray:
    """Return an angle in radians as finite float64, safe to add to another one.

    Values beyond 1e15 rad carry no direction any more; they are reduced only so that sums of two
    of them cannot overflow. Everything smaller passes through unchanged, to the bit.
    """
    array = as_finite(name, value)
    if np.any(np.abs(array) > _LARGEST_MEANINGFUL_ANGLE_RAD):
        array = np.where(
            np.abs(array) > _LARGEST_MEANINGFUL_ANGLE_RAD, np.fmod(array, 2.0 * np.pi), array
        )
    return array


def flatten_together(**arrays: FloatArray) -> tuple[tuple[int, ...], list[FloatArray]]:
    """Broadcast the arrays together and return the shape and contiguous flat copies.

    NumPy's vector loops for sin, exp and the like may give other last bits for strided input than
    for contiguous input. Flattening first makes an element's result independent of the shape and
    strides of the array it came in.
    """
    try:
        shape = np.broadcast_shapes(*(array.shape for array in arrays.values()))
    except ValueError:
        shapes = ", ".join(f"{name} {array.shape}" for name, array in arrays.items())
        raise ValueError(f"the shapes do not broadcast together: {shapes}") from None
    flat = []
    for array in arrays.values():
        if array.shape != shape:
            filled = np.empty(shape)
            filled[...] = array
            array = filled
        flat.append(np.ascontiguousarray(array).reshape(-1))
    return shape, flat


def unflatten(flat: NDArray[Any], shape: tuple[int, ...]) -> Any:
    """Give a flat result the broadcast shape back; a 0-d result becomes a NumPy scalar."""
    return flat.reshape(shape)[()]


def _first(array: FloatArray, bad: NDArray[np.bool_]) -> float:
    return float(np.broadcast_to(array, np.shape(bad))[bad].flat[0])
