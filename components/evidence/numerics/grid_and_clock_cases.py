"""Hard cases of rounding to a grid, and of scan clocks over an hour."""

import math
from fractions import Fraction

import numpy as np

from components.evidence.numerics.case import NumericalCase
from components.sensor.resolution import round_to_grid
from dsa_des.time.clock import ClockSpec, ScanClock, parse_rational, resolution

_HOUR_S = 3600


def rounding_cases() -> list[NumericalCase]:
    """Return the hard cases of rounding to a sensor's grid."""
    value, step = math.nextafter(3.5 * 1.1, 0.0), 1.1
    return [
        NumericalCase("a last place below the edge 3.85, grid 1.1", "round(x/step)·step",
             round(value / step) * step, float(round_to_grid(value, step)),
             round(Fraction(value) / Fraction(step)) * step, "rational numbers"),
        NumericalCase("110 at a field of view of ±110, grid 4", "round(x/step)·step",
             round(110.0 / 4.0) * 4.0,
             float(round_to_grid(110.0, 4.0, limit_low=-110.0, limit_high=110.0)),
             108.0, "outermost point inside"),
        NumericalCase("2.5 and -2.5, grid 1: sum of the two", "floor(x + ½)",
             float(math.floor(2.5 + 0.5) + math.floor(-2.5 + 0.5)),
             float(round_to_grid(2.5, 1.0) + round_to_grid(-2.5, 1.0)), 0.0, "symmetry"),
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
    ticks_per_s = resolution([time for spec in specs for time in spec.exact_times()])
    scans = [ScanClock(spec, ticks_per_s).between(0, _HOUR_S * ticks_per_s)[1] for spec in specs]
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
    ticks_per_s = resolution(spec.exact_times())
    ours = ScanClock(spec, ticks_per_s).between(0, 1000 * ticks_per_s)[0].size
    return NumericalCase(
        "5 Hz for 1000 s: scans",
        "if t - last >= 1/f, t = k·0.1 s",
        fired,
        ours,
        5000,
        "5 · 1000",
    )
