"""Checks of the arguments that the radar functions accept."""

from __future__ import annotations

import difflib
from collections.abc import Iterable

import numpy as np
from numpy.typing import ArrayLike

from components.arguments.checks import FloatArray, as_numbers, refuse

MODELS = ("swerling0", "swerling1", "swerling2", "swerling3", "swerling4")
_ALIASES = {"swerling5": "swerling0"}

# Beyond this the sums would grow long; the contract and the tests reach 1000.
MAX_PULSES = 100_000


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
