"""The largest numbers of a scene: far beyond anything that flies, far within a double.

Physics takes fourth powers, products and exponentials of what a scene says. Within these limits
they stay finite; a number outside them is a slip of the pen and is refused before anything runs.
"""

from collections.abc import Mapping
from typing import Any

#: Numbers without a unit below: products of several, and their squares, are still finite.
LARGEST = 1e30
#: Numbers closer to 0 than this must be 0; reciprocals and squares are still finite.
SMALLEST = 1e-30

#: Largest size by the unit at the end of a name. Levels in dB become powers of ten, and several
#: of them are added first; the others keep what they are multiplied with finite.
LARGEST_BY_UNIT: Mapping[str, float] = {
    "db": 300.0,
    "dbsm": 300.0,
    "deg": 1e6,
    "rad": 1e6,
    "deg_s": 1e6,
    "km": 1e9,
    "m": 1e12,
    "m2": 1e12,
    "mps": 1e6,
    "s": 1e12,
    "w": 1e15,
    "hz": 1e18,
}
_UNITS = sorted(LARGEST_BY_UNIT, key=len, reverse=True)


def largest_of(name: str) -> float:
    """Return the largest size allowed of a quantity, by the unit at the end of its name."""
    unit = next((unit for unit in _UNITS if name.endswith(f"_{unit}")), None)
    return LARGEST if unit is None else LARGEST_BY_UNIT[unit]


def refuse_extremes(name: str, value: Any) -> None:
    """Raise ValueError when a number, or one in a list or table, is too large or too small.

    Parameters
    ----------
    name : str
        Name of the quantity, with its unit at the end.
    value : object
        What is no number, list or table of numbers passes.
    """
    if isinstance(value, float | int):
        size = abs(value)
        if 0.0 < size < SMALLEST or size > largest_of(name):
            raise ValueError(
                f"must be 0, or from {SMALLEST:g} to {largest_of(name):g} in size: that is what "
                "can be computed with"
            )
    elif isinstance(value, list | tuple):
        for item in value:
            refuse_extremes(name, item)
    elif isinstance(value, Mapping):
        for item in value.values():
            refuse_extremes(name, item)
