"""Hard cases of the numerics: geometry, rounding to a grid, and scan clocks over an hour."""

import math
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np

from components.geometry import (
    body_angles,
    body_angles_of_sight_line,
    geodesic_line_of_sight,
    line_of_sight,
    longitude_difference_deg,
)
from components.high_precision.multiprecision import mpmath_library
from components.sensor.grid import Grid
from dsa_des.time.clock import ClockSpec, ScanClock, common_ticks_per_second, parse_rational

DIGITS = 12


@dataclass(frozen=True)
class NumericalCase:
    """One hard case with three results."""

    #: The case and the quantity with its unit.
    what: str
    #: The naive way.
    formula: str
    naive: float
    ours: float
    reference: float
    #: Where the reference comes from.
    source: str
    #: Significant digits shown. Our last digits may depend on the machine's mathematical library:
    #: show fewer than are exact.
    digits: int = DIGITS

    def text(self, value: float) -> str:
        """Return a value as it is shown."""
        if value != value:
            return "NaN"
        whole = float(value).is_integer() and abs(value) < 1e15
        return str(int(value)) if whole else f"{float(value):.{self.digits}g}"


DEG = math.pi / 180.0
_HOUR_S = 3600
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
    mpmath = mpmath_library()
    with mpmath.workdps(40):
        truth = _distance(mpmath, own, target)
    ours = float(line_of_sight(*own, *target)[2])
    naive = _distance(math, own, target)
    return NumericalCase(
        f"{what}: range, m", "ECEF coordinates subtracted", naive, ours, truth, "mpmath"
    )


def _antimeridian() -> NumericalCase:
    mpmath = mpmath_library()
    own, target = (10.0, 179.9999, 500.0), (10.0, -179.9999, 500.0)
    east = (target[1] - own[1]) * 111_195.0 * math.cos(own[0] * DEG)
    with mpmath.workdps(40):
        truth = _distance(mpmath, own, target)
    ours = float(line_of_sight(*own, *target)[2])
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
    mpmath = mpmath_library()
    naive = 90.0 * 111_195.0
    ours = float(geodesic_line_of_sight(0.0, 0.0, 0.0, 90.0, 0.0, 0.0)[2])
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
    _, q = body_angles_of_sight_line(math.pi, 0.0, 0.0, 5.0 * DEG, 0.0)
    return NumericalCase(
        "target astern, ownship pitched up 5°: elevation q, deg",
        "thesis eq. 5",
        -5.0,
        round(float(q) / DEG, 12),
        5.0,
        "rotation by hand",
    )


def _rounded(value: float, step: float, **limits: float) -> float:
    return float(Grid(step, **limits).round(np.array([value]))[0])


def rounding_cases() -> list[NumericalCase]:
    """Return the hard cases of rounding to a sensor's grid."""
    value, step = math.nextafter(3.5 * 1.1, 0.0), 1.1
    return [
        NumericalCase("a last place below the edge 3.85, grid 1.1", "round(x/step)·step",
             round(value / step) * step, _rounded(value, step),
             round(Fraction(value) / Fraction(step)) * step, "rational numbers"),
        NumericalCase("110 at a field of view of ±110, grid 4", "round(x/step)·step",
             round(110.0 / 4.0) * 4.0,
             _rounded(110.0, 4.0, limit_low=-110.0, limit_high=110.0),
             108.0, "outermost point inside"),
        NumericalCase("2.5 and -2.5, grid 1: sum of the two", "floor(x + ½)",
             float(math.floor(2.5 + 0.5) + math.floor(-2.5 + 0.5)),
             _rounded(2.5, 1.0) + _rounded(-2.5, 1.0), 0.0, "symmetry"),
    ]  # fmt: skip


def clock_cases() -> list[NumericalCase]:
    """Return the hard cases of scan clocks."""
    return [
        _meetings("10 and 30 Hz: scans at the same instant in an hour", "t += 1/f",
                  _meetings_of_sums(10.0, 30.0), (10, 30), 36_000),
        _meetings("29.97 and 10 Hz: the same", "rate taken from the float",
                  _meetings_of_fractions(Fraction(29.97), Fraction(10)), (29.97, 10), 36),
        _meetings('"30000/1001" and 25 Hz: the same', "k·(1/f) as floats",
                  _meetings_of_products(30_000 / 1001, 25.0), ("30000/1001", 25),
                  _meetings_of_fractions(Fraction(30_000, 1001), Fraction(25))),
        _firings(),
    ]  # fmt: skip


def _meetings(
    what: str, formula: str, naive: int, rates: tuple[object, object], truth: int
) -> NumericalCase:
    specs = [ClockSpec(parse_rational(rate)) for rate in rates]
    ticks_per_s = common_ticks_per_second(
        [time for spec in specs for time in spec.times_needing_whole_ticks()]
    )
    scans = [
        ScanClock(spec, ticks_per_s).scans_between(0, _HOUR_S * ticks_per_s)[1] for spec in specs
    ]
    ours = np.intersect1d(scans[0], scans[1]).size
    return NumericalCase(what, formula, naive, ours, truth, "rational numbers")


def _meetings_of_sums(first_hz: float, second_hz: float) -> int:
    times = []
    for rate in (first_hz, second_hz):
        steps = np.full(round(_HOUR_S * rate), 1.0 / rate)
        steps[0] = 0.0
        times.append(np.cumsum(steps))
    return int(np.intersect1d(times[0], times[1]).size)


def _meetings_of_products(first_hz: float, second_hz: float) -> int:
    times = [np.arange(math.ceil(_HOUR_S * rate)) * (1.0 / rate) for rate in (first_hz, second_hz)]
    return int(np.intersect1d(times[0], times[1]).size)


def _meetings_of_fractions(first_hz: Fraction, second_hz: Fraction) -> int:
    """Count k/f1 = j/f2 before the hour is over: every q-th scan of the first, f1/f2 = q/p."""
    every_s = (first_hz / second_hz).numerator / first_hz
    return math.ceil(_HOUR_S / every_s)


def _firings() -> NumericalCase:
    fired, last = 0, -1.0
    for step in range(10_000):
        time_s = step * 0.1
        if time_s - last >= 1.0 / 5.0:
            fired, last = fired + 1, time_s
    spec = ClockSpec(Fraction(5))
    ticks_per_s = common_ticks_per_second(spec.times_needing_whole_ticks())
    ours = ScanClock(spec, ticks_per_s).scans_between(0, 1000 * ticks_per_s)[0].size
    return NumericalCase(
        "5 Hz for 1000 s: scans",
        "if t - last >= 1/f, t = k·0.1 s",
        fired,
        ours,
        5000,
        "5 · 1000",
    )
