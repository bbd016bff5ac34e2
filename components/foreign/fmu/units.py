"""Units of FMUs and of ours: what a column's name says, and how one is made into the other."""

import math
from dataclasses import dataclass

from components.arguments.units import FOOT_M, KNOT_M_S

#: Names of our units: powers of (m, s, rad), and how large each is in SI units.
_UNITS: dict[str, tuple[tuple[int, int, int], float]] = {
    "m": ((1, 0, 0), 1.0), "km": ((1, 0, 0), 1e3), "ft": ((1, 0, 0), FOOT_M),
    "m2": ((2, 0, 0), 1.0), "s": ((0, 1, 0), 1.0), "ms": ((0, 1, 0), 1e-3),
    "rad": ((0, 0, 1), 1.0), "deg": ((0, 0, 1), math.pi / 180),
    "m/s": ((1, -1, 0), 1.0), "km/h": ((1, -1, 0), 1 / 3.6), "kn": ((1, -1, 0), KNOT_M_S),
    "m/s2": ((1, -2, 0), 1.0), "m2/s2": ((2, -2, 0), 1.0), "rad2": ((0, 0, 2), 1.0),
    "deg2": ((0, 0, 2), (math.pi / 180) ** 2), "rad/s": ((0, -1, 1), 1.0),
    "deg/s": ((0, -1, 1), math.pi / 180), "Hz": ((0, -1, 0), 1.0), "1/s": ((0, -1, 0), 1.0),
}  # fmt: skip
#: How a column's name ends, and its unit; longer endings first.
_ENDINGS = {
    "_rad_s": "rad/s", "_deg_s": "deg/s", "_m_s": "m/s", "_mps": "m/s", "_mps2": "m/s2",
    "_rad": "rad", "_deg": "deg", "_km": "km", "_hz": "Hz", "_db": "dB", "_dbsm": "dBsm",
    "_rad2": "rad2", "_m2": "m2", "_m2_s2": "m2/s2", "_m": "m", "_s": "s",
}  # fmt: skip


def unit_of_column(name: str) -> str:
    """Return the unit that a column's name ends with, or an empty text."""
    ending = max((end for end in _ENDINGS if name.endswith(end)), key=len, default="")
    return _ENDINGS.get(ending, "")


@dataclass(frozen=True)
class Scale:
    """A unit: its powers of m, s, rad, kg, A, K, mol, cd; x of it are factor x + offset in SI."""

    powers: tuple[int, ...]
    factor: float
    offset: float = 0.0


def scale_of(unit: str) -> Scale | None:
    """Return the `Scale` of one of the units used here, or None for any other unit."""
    named = unit.replace("²", "2").replace("^", "")
    if named not in _UNITS:
        return None
    powers, factor = _UNITS[named]
    return Scale((*powers, 0, 0, 0, 0, 0), factor)
