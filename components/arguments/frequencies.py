"""Checks of the arguments that the atmosphere's functions accept."""

from __future__ import annotations

from numpy.typing import ArrayLike

from components.arguments.checks import FloatArray, as_numbers, refuse

LOWEST_FREQUENCY_HZ = 1e9


def checked_frequency(frequency_hz: ArrayLike, highest_hz: float) -> FloatArray:
    """Return the frequency in GHz, from 1 GHz to the highest a Recommendation covers."""
    frequency = as_numbers("frequency_hz", frequency_hz)
    refuse(
        "frequency_hz",
        frequency,
        ~((frequency >= LOWEST_FREQUENCY_HZ) & (frequency <= highest_hz)),
        f"lie in [1e9, {highest_hz:g}] Hz",
    )
    return frequency * 1e-9


def within(name: str, value: ArrayLike, low: float, high: float, unit: str) -> FloatArray:
    """Return `value` as float64, all of it in [low, high]."""
    array = as_numbers(name, value)
    refuse(name, array, ~((array >= low) & (array <= high)), f"lie in [{low:g}, {high:g}] {unit}")
    return array
