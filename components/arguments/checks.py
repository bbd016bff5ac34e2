"""Checks of the arguments of physics functions, which become arrays of one shape."""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dsa_des.arrays.types import FloatArray

# Beyond this the gap between neighbouring doubles is over a tenth of a radian: no direction is left
# in the number.
_LARGEST_MEANINGFUL_ANGLE_RAD = 1e15

MODELS = ("swerling0", "swerling1", "swerling2", "swerling3", "swerling4")
_ALIASES = {"swerling5": "swerling0"}

# Beyond this the sums would grow long; the contract and the tests reach 1000.
MAX_PULSES = 100_000

LOWEST_FREQUENCY_HZ = 1e9

LARGEST = 1e150
"""Largest size of a number we accept: its square still fits in a double, so nothing overflows."""

HIGHEST_ALTITUDE_M = 1e9
LOWEST_ALTITUDE_M = -6e6


def check_numbers(name: str, value: ArrayLike) -> FloatArray:
    """Return `value` as a float64 array; ValueError if it holds no numbers."""
    try:
        return np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise ValueError(
            f"{name} is {value!r}: it must be a number or an array of numbers"
        ) from error


def refuse(name: str, array: FloatArray, bad: NDArray[np.bool_], rule: str) -> None:
    """Raise a ValueError naming the first bad element, if there is one."""
    if np.count_nonzero(bad):
        first = float(np.broadcast_to(array, np.shape(bad))[bad].flat[0])
        # In full where six digits would show another number, as 1 for 1.0000001 pulses.
        short = f"{first:g}"
        shown = short if float(short) == first or first != first else repr(first)
        raise ValueError(f"{name} is {shown}: it must {rule}")


def check_positive(name: str, value: ArrayLike) -> FloatArray:
    """Return `value` as float64, all of it finite and above 0."""
    array = check_numbers(name, value)
    refuse(name, array, ~((array > 0.0) & np.isfinite(array)), "be finite and above 0")
    return array


def check_not_negative(name: str, value: ArrayLike) -> FloatArray:
    """Return `value` as float64, all of it finite and 0 or more."""
    array = check_numbers(name, value)
    refuse(name, array, ~((array >= 0.0) & np.isfinite(array)), "be finite and 0 or more")
    return array


def check_finite(name: str, value: ArrayLike) -> FloatArray:
    """Return `value` as float64, all of it finite, however large (see `check_squarable`)."""
    array = check_numbers(name, value)
    refuse(name, array, ~np.isfinite(array), "be finite")
    return array


def common_shape(**arrays: FloatArray) -> tuple[int, ...]:
    """Return the shape to which named arrays broadcast; ValueError with their names if none."""
    shapes_of = {array.shape for array in arrays.values()}
    if len(shapes_of) == 1:  # the usual case, without NumPy's call
        return shapes_of.pop()
    try:
        return np.broadcast_shapes(*shapes_of)
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
    """Return a flat result reshaped, for the empty shape as a NumPy scalar."""
    return flat.reshape(shape)[()]


def check_angle_rad(name: str, value: ArrayLike) -> FloatArray:
    """Return an angle in radians as finite float64, safe to add to another one.

    Values beyond 1e15 rad carry no direction any more; they are reduced only so that sums of two
    of them cannot overflow. Everything smaller passes through unchanged, to the bit.
    """
    array = check_finite(name, value)
    if np.any(np.abs(array) > _LARGEST_MEANINGFUL_ANGLE_RAD):
        array = np.where(
            np.abs(array) > _LARGEST_MEANINGFUL_ANGLE_RAD, np.fmod(array, 2.0 * np.pi), array
        )
    return array


def checked_frequency_ghz(frequency_hz: ArrayLike, highest_hz: float) -> FloatArray:
    """Return the frequency in GHz, from 1 GHz to the highest a Recommendation covers."""
    frequency = check_numbers("frequency_hz", frequency_hz)
    refuse(
        "frequency_hz",
        frequency,
        ~((frequency >= LOWEST_FREQUENCY_HZ) & (frequency <= highest_hz)),
        f"lie in [1e9, {highest_hz:g}] Hz",
    )
    return frequency * 1e-9


def check_within(name: str, value: ArrayLike, low: float, high: float, unit: str) -> FloatArray:
    """Return `value` as float64, all of it in [low, high]."""
    array = check_numbers(name, value)
    refuse(name, array, ~((array >= low) & (array <= high)), f"lie in [{low:g}, {high:g}] {unit}")
    return array


def check_snr(value: ArrayLike) -> FloatArray:
    """Return the SNR as float64, 0 to infinity."""
    array = check_numbers("snr", value)
    # min() carries a NaN along, and every comparison with NaN is false.
    if array.size and not array.min() >= 0.0:
        refuse("snr", array, ~(array >= 0.0), "be a power ratio of 0 or more (linear, not dB)")
    return array


def check_pulses(value: ArrayLike) -> FloatArray:
    """Return the number of pulses as float64 holding whole numbers from 1 to `MAX_PULSES`."""
    if type(value) is int and 1 <= value <= MAX_PULSES:  # the usual case, without NumPy's calls
        return np.array(float(value))
    array = check_numbers("pulses", value)
    with np.errstate(invalid="ignore"):  # floor of NaN or infinity; refused here
        bad = ~((array >= 1.0) & (array <= MAX_PULSES) & (np.floor(array) == array))
    refuse("pulses", array, bad, f"be a whole number from 1 to {MAX_PULSES}")
    return array


def check_probability(name: str, value: ArrayLike) -> FloatArray:
    """Return a probability as float64, strictly between 0 and 1."""
    if type(value) is float and 0.0 < value < 1.0:  # the usual case, without NumPy's calls
        return np.array(value)
    array = check_numbers(name, value)
    refuse(name, array, ~((array > 0.0) & (array < 1.0)), "lie strictly between 0 and 1")
    return array


def check_one_of(name: str, value: object, allowed: Iterable[str]) -> str:
    """Return `value` if it is one of the allowed names, or name the nearest one."""
    names = tuple(allowed)
    if isinstance(value, str) and value in names:
        return value
    near = difflib.get_close_matches(str(value).lower(), names, n=1, cutoff=0.0)
    raise ValueError(
        f"{name} is {value!r}: it must be one of {', '.join(names)} (nearest: {near[0]!r})"
    )


def check_swerling_model(value: object) -> str:
    """Return the canonical name of a Swerling model; swerling5 is another name of swerling0."""
    name = check_one_of("model", value, (*MODELS, *_ALIASES))
    return _ALIASES.get(name, name)


def contiguous_float64(name: str, value: ArrayLike) -> FloatArray:
    """Return an argument as a C-contiguous float64 array; ValueError if it holds no numbers.

    Contiguous because NumPy's loops over sin, cos or arctan2 may take another code path, with
    other last bits, when they step through memory with a stride.
    """
    return np.asarray(check_numbers(name, value), order="C")


def require_between(name: str, array: FloatArray, low: float, high: float, allowed: str) -> None:
    """Raise ValueError naming the first element outside [low, high]; NaN counts as outside."""
    # A NaN makes min() and max() NaN, and every comparison with NaN is false.
    if array.size == 0 or (array.min() >= low and array.max() <= high):
        return
    first = int(np.argmin((array >= low) & (array <= high)))
    place = f" (element {first})" if array.size > 1 else ""
    raise ValueError(f"{name} is {array.reshape(-1)[first]}{place}: it must {allowed}")


def check_squarable(name: str, value: ArrayLike) -> FloatArray:
    """Return the argument as a contiguous array of doubles, finite and within ±1e150.

    Stricter than `finite`: for what is squared on the way, so that the square fits as well.

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
    array = contiguous_float64(name, value)
    require_between(name, array, -LARGEST, LARGEST, f"be finite and within ±{LARGEST:g}")
    return array


def broadcast_results(shape: tuple[int, ...], *arrays: FloatArray) -> tuple[FloatArray, ...]:
    """Return every result broadcast to one shape in its own memory, as a scalar for shape ()."""
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


def check_positions(
    own_lat_deg: ArrayLike,
    own_lon_deg: ArrayLike,
    own_alt_m: ArrayLike,
    lat_deg: ArrayLike,
    lon_deg: ArrayLike,
    alt_m: ArrayLike,
    validate: bool = True,
) -> tuple[tuple[FloatArray, ...], tuple[int, ...]]:
    """Return six checked arrays (own lat, lon, altitude, the target's; ≥ 1-D) and broadcast shape.

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
        "own_lat_deg": contiguous_float64("own_lat_deg", own_lat_deg),
        "own_lon_deg": contiguous_float64("own_lon_deg", own_lon_deg),
        "own_alt_m": contiguous_float64("own_alt_m", own_alt_m),
        "lat_deg": contiguous_float64("lat_deg", lat_deg),
        "lon_deg": contiguous_float64("lon_deg", lon_deg),
        "alt_m": contiguous_float64("alt_m", alt_m),
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
