"""Which arguments do the radar functions accept, and how do they become arrays of one shape?"""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float64]

MODELS = ("swerling0", "swerling1", "swerling2", "swerling3", "swerling4")
_ALIASES = {"swerling5": "swerling0"}

# Beyond this the sums would grow long; the contract and the tests reach 1000.
MAX_PULSES = 100_000


def as_numbers(name: str, value: ArrayLike) -> FloatArray:
    """Return `value` as a float64 array, or say that it is not a number."""
    try:
        return np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise ValueError(f"{name} is {value!r}: it must be a number or an array") from error


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


def checked_snr(value: ArrayLike) -> FloatArray:
    """Return the SNR as float64, 0 to infinity."""
    array = as_numbers("snr", value)
    # min() carries a NaN along, and every comparison with NaN is false.
    if array.size and not array.min() >= 0.0:
        refuse("snr", array, ~(array >= 0.0), "be a power ratio of 0 or more (linear, not dB)")
    return array


def checked_pulses(value: ArrayLike) -> FloatArray:
    """Return the number of pulses as float64 holding whole numbers from 1 to `MAX_PULSES`."""
    if type(value) is int and 1 <= value <= MAX_PULSES:  # the usual case, without NumPy's calls
        return np.array(float(value))
    array = as_numbers("pulses", value)
    with np.errstate(invalid="ignore"):  # floor of NaN or infinity; refused here
        bad = ~((array >= 1.0) & (array <= MAX_PULSES) & (np.floor(array) == array))
    refuse("pulses", array, bad, f"be a whole number from 1 to {MAX_PULSES}")
    return array


def checked_probability(name: str, value: ArrayLike) -> FloatArray:
    """Return a probability as float64, strictly between 0 and 1."""
    if type(value) is float and 0.0 < value < 1.0:  # the usual case, without NumPy's calls
        return np.array(value)
    array = as_numbers(name, value)
    refuse(name, array, ~((array > 0.0) & (array < 1.0)), "lie strictly between 0 and 1")
    return array


def one_of(name: str, value: object, allowed: Iterable[str]) -> str:
    """Return `value` if it is one of the allowed names, or name the nearest one."""
    names = tuple(allowed)
    if isinstance(value, str) and value in names:
        return value
    near = difflib.get_close_matches(str(value).lower(), names, n=1, cutoff=0.0)
    raise ValueError(
        f"{name} is {value!r}: it must be one of {', '.join(names)} (nearest: {near[0]!r})"
    )


def checked_model(value: object) -> str:
    """Return the canonical name of a Swerling model; swerling5 is another name of swerling0."""
    name = one_of("model", value, (*MODELS, *_ALIASES))
    return _ALIASES.get(name, name)


def broadcast_flat(**arrays: FloatArray) -> tuple[tuple[int, ...], list[FloatArray]]:
    """Broadcast together and return the shape and contiguous flat arrays.

    NumPy's vector loops for exp, log and the like may give other last bits for strided input than
    for contiguous input; flattening first makes each element's result independent of the shape.
    """
    try:
        shape = np.broadcast_shapes(*(array.shape for array in arrays.values()))
    except ValueError as error:
        shapes = ", ".join(f"{name} {array.shape}" for name, array in arrays.items())
        raise ValueError(f"the shapes do not broadcast together: {shapes}") from error
    return shape, [
        np.ascontiguousarray(np.broadcast_to(array, shape)).reshape(-1) for array in arrays.values()
    ]


def unflatten(flat: NDArray[Any], shape: tuple[int, ...]) -> Any:
    """Give a flat result its shape back; a 0-d result becomes a NumPy scalar."""
    return flat.reshape(shape)[()]
