"""Hard cases of geometry: short lines, poles, the antimeridian, the zenith."""

import math
from fractions import Fraction
from typing import Any

from components.evidence.numerics.case import NumericalCase
from components.geometry import ellipsoid, geodesic
from components.geometry.angles import longitude_difference_deg
from components.geometry.attitude import body_angles
from components.geometry.sensor_angles import sensor_angles
from components.high_precision.multiprecision import multiprecision

DEG = math.pi / 180.0
Position = tuple[float, float, float]

# what, own lat lon alt, target lat lon alt
_LINES: list[tuple[str, Position, Position]] = [
    ("1 mm to the north", (51.0, 4.0, 100.0), (51.000000009, 4.0, 100.0)),
    ("1 mm upward at 40 km", (51.0, 4.0, 40_000.0), (51.0, 4.0, 40_000.001)),
    ("1 m across the pole", (89.9999955, 0.0, 0.0), (89.9999955, 180.0, 0.0)),
]


def geometry_cases() -> list[NumericalCase]:
    """Return the hard cases of geometry."""
    cases = [_slant_range(*line) for line in _LINES]
    cases += [
        _antimeridian(),
        _longitudes(),
        _quarter_meridian(),
        _zenith(),
        _pitch_astern(),
    ]
    return cases


def _ecef(lib: Any, position: Position) -> tuple[Any, Any, Any]:
    """Return ECEF coordinates in the arithmetic of `lib`, math or mpmath."""
    number = getattr(lib, "mpf", float)
    flattening = 1 / number("298.257223563")
    e2 = flattening * (2 - flattening)
    lat, lon = lib.radians(number(position[0])), lib.radians(number(position[1]))
    normal = 6378137 / lib.sqrt(1 - e2 * lib.sin(lat) ** 2)
    height = number(position[2])
    level = (normal + height) * lib.cos(lat)
    return (
        level * lib.cos(lon),
        level * lib.sin(lon),
        (normal * (1 - e2) + height) * lib.sin(lat),
    )


def _distance(lib: Any, own: Position, target: Position) -> float:
    offset = [b - a for a, b in zip(_ecef(lib, own), _ecef(lib, target), strict=True)]
    return float(lib.sqrt(sum(part * part for part in offset)))


def _slant_range(what: str, own: Position, target: Position) -> NumericalCase:
    mpmath = multiprecision()
    with mpmath.workdps(40):
        truth = _distance(mpmath, own, target)
    ours = float(ellipsoid.line_of_sight(*own, *target)[2])
    naive = _distance(math, own, target)
    return NumericalCase(
        f"{what}: range, m", "ECEF coordinates subtracted", naive, ours, truth, "mpmath"
    )


def _antimeridian() -> NumericalCase:
    mpmath = multiprecision()
    own, target = (10.0, 179.9999, 500.0), (10.0, -179.9999, 500.0)
    east = (target[1] - own[1]) * 111_195.0 * math.cos(own[0] * DEG)
    with mpmath.workdps(40):
        truth = _distance(mpmath, own, target)
    ours = float(ellipsoid.line_of_sight(*own, *target)[2])
    return NumericalCase(
        "across the antimeridian: range, m",
        "thesis eq. 2, not wrapped",
        -east,
        ours,
        truth,
        "mpmath",
    )


def _longitudes() -> NumericalCase:
    first, second = 359.9, -0.1
    naive = (second - first + 180.0) % 360.0 - 180.0
    ours = float(longitude_difference_deg(first, second)[0])
    exact = float(Fraction(second) - Fraction(first) + 360)
    return NumericalCase(
        "from lon 359.9 to -0.1: difference, deg",
        "remainder by 360",
        naive,
        ours,
        exact,
        "rational numbers",
    )


def _quarter_meridian() -> NumericalCase:
    mpmath = multiprecision()
    naive = 90.0 * 111_195.0
    ours = float(geodesic.line_of_sight(0.0, 0.0, 0.0, 90.0, 0.0, 0.0)[2])
    with mpmath.workdps(40):
        flattening = 1 / mpmath.mpf("298.257223563")
        truth = float(6378137 * mpmath.ellipe(flattening * (2 - flattening)))
    return NumericalCase(
        "equator to pole: ground distance, m",
        "111,195 m per degree",
        naive,
        ours,
        truth,
        "a E(e²), mpmath",
    )


def _zenith() -> NumericalCase:
    off = 1e-6
    naive = math.pi / 2 - math.asin(1.0 / math.hypot(off, 1.0))
    ours = math.pi / 2 - float(body_angles(off, 0.0, -1.0)[1])
    return NumericalCase(
        "1 µrad off the zenith: 90° - elevation, rad",
        "asin(h/R)",
        naive,
        ours,
        math.atan(off),
        "atan(1e-6)",
        digits=6,
    )


def _pitch_astern() -> NumericalCase:
    _, q = sensor_angles(math.pi, 0.0, 0.0, 5.0 * DEG, 0.0)
    return NumericalCase(
        "target astern, ownship pitched up 5°: elevation q, deg",
        "thesis eq. 5",
        -5.0,
        round(float(q) / DEG, 12),
        5.0,
        "rotation by hand",
    )
