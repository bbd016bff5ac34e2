"""Checks of the arguments of physics functions, which become arrays of one shape."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float64]


def as_numbers(name: str, value: ArrayLike) -> FloatArray:
    """Return `value` as a float64 array, or say that it is not a number."""
    try:
        return np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise ValueError(
            f"{name} is {value!r}: it must be a number or an array of numbers"
        ) from error


def refuse(name: str, array: FloatArray, bad: NDArray[np.bool_], rule: str) -> None:
    """Raise a ValueError naming the first bad element, if there is one."""
    if np.any(bad):
        first = float(np.broadcast_to(array, np.shape(bad))[bad].flat[0])
        # In full where six digits would show another number, as 1 for 1.0000001 pulses.
        short = f"{first:g}"
        shown = short if float(short) == first or first != first else repr(first)
        raise ValueError(f"{name} is {shown}: it must {rule}")


def positive(name: str, value: ArrayLike) -> FloatArray:
    """Return `value` as float64, all of it finite and above 0."""
    array = as_numbers(name, value)
    refuse(name, array, ~((array > 0.0) & np.isfinite(array)), "be finite and above 0")
    return array


def not_negative(name: str, value: ArrayLike) -> FloatArray:
    """Return `value` as float64, all of it finite and 0 or more."""
    array = as_numbers(name, value)
    refuse(name, array, ~((array >= 0.0) & np.isfinite(array)), "be finite and 0 or more")
    return array


def finite(name: str, value: ArrayLike) -> FloatArray:
    """Return `value` as float64, all of it finite."""
    array = as_numbers(name, value)
    refuse(name, array, ~np.isfinite(array), "be finite")
    return array


def common_shape(**arrays: FloatArray) -> tuple[int, ...]:
    """Return the shape that the named arrays broadcast to."""
    try:
        return np.broadcast_shapes(*(array.shape for array in arrays.values()))
    except ValueError as error:
        shapes = ", ".join(f"{name} {array.shape}" for name, array in arrays.items())
        raise ValueError(f"the shapes do not broadcast together: {shapes}") from error


def broadcast_flat(**arrays: FloatArray) -> tuple[tuple[int, ...], list[FloatArray]]:
    """Broadcast together and return the shape and contiguous flat arrays.

    NumPy's vector loops for exp, log, sin and the like may give other last bits for strided input
    than for contiguous input; flattening first makes each element's result independent of the
    shape and strides of the array it came in.
    """
    shape = common_shape(**arrays)
    return shape, [
        np.ascontiguousarray(
            array if array.shape == shape else np.broadcast_to(array, shape)
        ).reshape(-1)
        for array in arrays.values()
    ]


def unflatten(flat: NDArray[Any], shape: tuple[int, ...]) -> Any:
    """Give a flat result its shape back; a 0-d result becomes a NumPy scalar."""
    return flat.reshape(shape)[()]
