"""Checking and shaping the arguments that every geometry function takes."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from components.arguments.checks import FloatArray, as_numbers, common_shape

LARGEST = 1e150
"""Largest size of a number we accept: its square still fits in a double, so nothing overflows."""

HIGHEST_ALTITUDE_M = 1e9
LOWEST_ALTITUDE_M = -6e6


def contiguous(name: str, value: npt.ArrayLike) -> FloatArray:
    """Turn an argument into a C-contiguous array of doubles.

    Contiguous because NumPy's loops over sin, cos or arctan2 may take another code path, with
    other last bits, when they step through memory with a stride.
    """
    return np.asarray(as_numbers(name, value), order="C")


def require_between(name: str, array: FloatArray, low: float, high: float, allowed: str) -> None:
    """Raise ValueError naming the first element outside [low, high]; NaN counts as outside."""
    # A NaN makes min() and max() NaN, and every comparison with NaN is false.
    if array.size == 0 or (array.min() >= low and array.max() <= high):
        return
    first = int(np.argmin((array >= low) & (array <= high)))
    place = f" (element {first})" if array.size > 1 else ""
    raise ValueError(f"{name} is {array.reshape(-1)[first]}{place}: it must {allowed}")


def finite(name: str, value: npt.ArrayLike) -> FloatArray:
    """Return the argument as a contiguous array of doubles, refusing NaN, infinity and over 1e150.

    Parameters
    ----------
    name : str
        The argument's name, for the message.
    value : array_like
        Any shape.

    Returns
    -------
    ndarray
        float64, C order, the same shape.

    Raises
    ------
    ValueError
        Not a number, not finite, or larger than 1e150 in size.
    """
    array = contiguous(name, value)
    require_between(name, array, -LARGEST, LARGEST, f"be finite and within ±{LARGEST:g}")
    return array


def shaped(shape: tuple[int, ...], *arrays: FloatArray) -> tuple[FloatArray, ...]:
    """Give every result the broadcast shape, its own memory, and a scalar for shape ()."""
    results = []
    for array in arrays:
        if array.shape != shape:
            # A result need not depend on every input, so it can be smaller than all of them;
            # and scalars are worked on as arrays of one element.
            if array.size == math.prod(shape):
                array = array.reshape(shape)
            else:
                array = np.ascontiguousarray(np.broadcast_to(array, shape))
        results.append(array[()])
    return tuple(results)


def positions(
    own_lat_deg: npt.ArrayLike,
    own_lon_deg: npt.ArrayLike,
    own_alt_m: npt.ArrayLike,
    lat_deg: npt.ArrayLike,
    lon_deg: npt.ArrayLike,
    alt_m: npt.ArrayLike,
    validate: bool = True,
) -> tuple[tuple[FloatArray, ...], tuple[int, ...]]:
    """Check two geodetic positions and return them as arrays of at least one axis.

    Parameters
    ----------
    own_lat_deg, own_lon_deg, own_alt_m : array_like
        The observer: geodetic latitude in [-90, 90] degrees, any longitude in degrees, height
        above the ellipsoid in metres.
    lat_deg, lon_deg, alt_m : array_like
        The target, likewise. All six broadcast.
    validate : bool
        False skips the checks of values, for callers that have done them.

    Returns
    -------
    arrays : tuple of six ndarray
        In the order of the arguments, float64, C order; shape () becomes (1,).
    shape : tuple of int
        The broadcast shape.

    Raises
    ------
    ValueError
        A latitude outside [-90, 90], a longitude that is not finite, an altitude outside
        [-6e6, 1e9] m, NaN anywhere, or shapes that do not fit.
    """
    named = {
        "own_lat_deg": contiguous("own_lat_deg", own_lat_deg),
        "own_lon_deg": contiguous("own_lon_deg", own_lon_deg),
        "own_alt_m": contiguous("own_alt_m", own_alt_m),
        "lat_deg": contiguous("lat_deg", lat_deg),
        "lon_deg": contiguous("lon_deg", lon_deg),
        "alt_m": contiguous("alt_m", alt_m),
    }
    shape = named["alt_m"].shape
    # One observer for all targets of a row is what every scan has.
    column = (*shape[:-1], 1) if len(shape) > 1 else shape
    if any(array.shape != shape and array.shape != column for array in named.values()):
        shape = common_shape(**named)
    if validate:
        for name, array in named.items():
            if "lat" in name:
                require_between(name, array, -90.0, 90.0, "lie in [-90, 90] degrees")
            elif "lon" in name:
                require_between(name, array, -LARGEST, LARGEST, f"be within ±{LARGEST:g} degrees")
            else:
                low, high = LOWEST_ALTITUDE_M, HIGHEST_ALTITUDE_M
                require_between(name, array, low, high, f"lie in [{low:g}, {high:g}] metres")
    arrays = tuple(a if a.ndim else a.reshape(1) for a in named.values())
    return arrays, shape
