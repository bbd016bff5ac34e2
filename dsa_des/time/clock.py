"""Exact time: integer ticks, and clocks whose k-th scan never drifts.

The resolution R (ticks per second) is chosen per scene so that every period, offset and delay is a
whole number of ticks; two clocks then meet exactly when rational arithmetic says so, after a second
or after a month. Seconds as float appear only where physics or people read them.
"""

import math
import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from dsa_des.arrays.types import IntArray

NANOSECONDS = 10**9
# Ticks are kept in int64 arrays; one bit is left for sums of two ticks.
MAX_TICK = 2**62
#: How far jitter moves a scan at most, in times between scans: scans keep their order.
MOST_JITTER = 0.45
# Digits of an exact number's numerator and denominator. Fractions are whole numbers of any size,
# and "1e-9999999" is one of ten million digits that every sum would carry along.
_MOST_DIGITS = 60
_LARGEST: int = 10**_MOST_DIGITS
_EXPONENT = re.compile(r"[eE]([+-]?\d+)\s*$")
_LONGEST_TEXT = 200


def parse_rational(value: object) -> Fraction:
    """Return a number or text such as ``"30000/1001"`` as an exact fraction.

    A float is read the way it is written (29.97 becomes 2997/100): the binary value behind it
    would never coincide with any other clock.

    A `ValueError` says so if the value is not a finite number, or one of too many digits.
    """
    if isinstance(value, bool) or not isinstance(value, int | float | str | Fraction):
        raise ValueError('must be a number or a text such as "30000/1001"')
    if isinstance(value, float):
        if not math.isfinite(value):
            raise ValueError("must be finite")
        value = repr(float(value))
    elif isinstance(value, str) and _has_too_many_digits(value):
        raise ValueError(_TOO_LONG)
    try:
        number = Fraction(value)
    except (ValueError, ZeroDivisionError):
        raise ValueError('must be a number or a text such as "30000/1001"') from None
    if abs(number.numerator) > _LARGEST or number.denominator > _LARGEST:
        raise ValueError(_TOO_LONG)
    return number


_TOO_LONG = f"must be a number that is a fraction of whole numbers of at most {_MOST_DIGITS} digits"


def _has_too_many_digits(text: str) -> bool:
    """Return whether a number's text or exponent is too long to expand into an exact fraction."""
    exponent = _EXPONENT.search(text[-_LONGEST_TEXT:])
    return len(text) > _LONGEST_TEXT or (
        exponent is not None and abs(int(exponent[1])) > _LONGEST_TEXT
    )


def common_ticks_per_second(times_s: Iterable[Fraction]) -> int:
    """Return the ticks per second in which all given times are whole: lcm(10^9, denominators)."""
    return math.lcm(NANOSECONDS, *(time.denominator for time in times_s))


def ticks_to_nanoseconds(ticks: IntArray, ticks_per_s: int) -> IntArray:
    """Return ticks as whole nanoseconds, which key the random draws of an instant.

    A block more or less in a scene may change the resolution; what an instant draws must not.
    """
    return ticks // max(1, ticks_per_s // NANOSECONDS)


@dataclass(frozen=True)
class ClockSpec:
    """Settings of a scan clock: rate in Hz, offset in s, rate error in ppm, jitter in s.

    `jitter_s` is the standard deviation of the scan instants about their grid, before they are cut
    at `MOST_JITTER`.
    """

    rate_hz: Fraction
    offset_s: Fraction = Fraction(0)
    rate_error_ppm: Fraction = Fraction(0)
    jitter_s: float = 0.0

    @property
    def period_s(self) -> Fraction:
        """Nominal time between scans in s."""
        return 1 / self.rate_hz

    def times_needing_whole_ticks(self) -> list[Fraction]:
        """Return the times (s) that must be whole ticks for this clock to be exact."""
        return [self.period_s, self.offset_s]


class ScanClock:
    """The scan instants of one block's clock, in ticks.

    Scan k is at ``offset + k * period``, exactly. A clock with a rate error runs at
    ``rate * (1 + ppm * 1e-6)``; its instants are rounded once each to the nearest tick (never
    accumulated), so the error stays below half a tick for ever. Jitter adds a keyed normal draw,
    cut at `MOST_JITTER` so that scans keep their order, and rounded once; a jittered first scan
    never falls before tick 0.

    `jitter_draw` gives standard normal draws keyed by the scan numbers given to it; with
    `always_draws` also where the jitter is 0.
    """

    def __init__(
        self,
        spec: ClockSpec,
        ticks_per_s: int,
        jitter_draw: Callable[[IntArray], np.ndarray] | None = None,
        *,
        always_draws: bool = False,
    ) -> None:
        self.spec = spec
        self.ticks_per_s = ticks_per_s
        offset = spec.offset_s * ticks_per_s
        true_rate = spec.rate_hz * (1 + spec.rate_error_ppm / 1_000_000)
        period = ticks_per_s / true_rate
        if offset.denominator != 1:
            raise ValueError(f"offset {spec.offset_s} s is not a whole number of ticks")
        if period < 1:
            raise ValueError(f"a rate of {float(spec.rate_hz)} Hz is above the tick rate")
        self.offset = int(offset)
        self.period = period
        self._whole, rest = divmod(period.numerator, period.denominator)
        self._rest, self._denominator = rest, period.denominator
        self._two_periods = 2 * period.numerator
        self._jitter_draw = jitter_draw if spec.jitter_s > 0 or always_draws else None
        self._jitter_ticks = spec.jitter_s * ticks_per_s
        self._jitter_limit = MOST_JITTER * float(period)
        #: How far jitter moves a scan off its grid at most, ticks.
        self._margin = 0 if self._jitter_draw is None else math.ceil(self._jitter_limit) + 1

    def _grid_ticks(self, scans: IntArray) -> IntArray:
        ticks: IntArray = self.offset + scans * self._whole
        if self._rest == 0:
            return ticks
        largest = int(np.abs(scans).max(initial=0))
        if 2 * largest * self._rest + self._denominator < MAX_TICK:
            extra = (2 * scans * self._rest + self._denominator) // (2 * self._denominator)
        else:  # exact in Python integers; only rates given to many digits come here
            exact = [self._grid_tick(k) for k in scans.ravel().tolist()]
            return np.array(exact, dtype=np.int64).reshape(scans.shape)
        return ticks + extra

    def ticks(self, scans: IntArray) -> IntArray:
        """Return the ticks of the scans with the given numbers (same shape, int64)."""
        scans = np.asarray(scans, dtype=np.int64)
        ticks = self._grid_ticks(scans)
        if self._jitter_draw is not None:
            shift = self._jitter_ticks * self._jitter_draw(scans)
            shift = np.clip(shift, -self._jitter_limit, self._jitter_limit)
            ticks = np.maximum(ticks + np.rint(shift).astype(np.int64), 0)
        return ticks

    def previous_ticks(self, scans: IntArray) -> IntArray:
        """Return the tick of the scan before each given one in its run; -1 before the first."""
        earlier = np.asarray(scans, dtype=np.int64) - 1
        return np.where(earlier < 0, -1, self.ticks(np.maximum(earlier, 0)))

    def tick_of(self, scan: int) -> int:
        """Return the tick of one scan."""
        if self._jitter_draw is None:
            return self._grid_tick(scan)
        return int(self.ticks(np.array([scan], dtype=np.int64))[0])

    def first_scan_at_or_after(self, tick: int) -> int:
        """Return the number, from 0, of the first scan at or after `tick`, ignoring jitter."""
        # Half a tick before it or later, in Python integers, which neither round nor overflow;
        # Fractions took ten times as long.
        half_ticks = 2 * (tick - self.offset) - 1
        return max(0, -(-half_ticks * self._denominator // self._two_periods))

    def _grid_tick(self, scan: int) -> int:
        """Return the tick of one scan without jitter, in Python integers, which cannot overflow."""
        r, d = self._rest, self._denominator
        return self.offset + scan * self._whole + (2 * scan * r + d) // (2 * d)

    def lower_bound_of_next_scan(self, tick: int) -> int:
        """Return a tick that is no later than any scan at or after `tick`: a lower bound."""
        return self._grid_tick(self.first_scan_at_or_after(tick - self._margin)) - self._margin

    def scans_between(self, start: int, end: int) -> tuple[IntArray, IntArray]:
        """Return (scan numbers, ticks) of the scans with start <= tick < end, in order."""
        if end > MAX_TICK:
            raise ValueError(f"end is {end}: ticks must stay below {MAX_TICK} (64 bits)")
        if end <= start:
            empty = np.empty(0, dtype=np.int64)
            return empty, empty
        margin = self._margin
        first = self.first_scan_at_or_after(start - margin)
        last = self.first_scan_at_or_after(end + margin)
        scans = np.arange(first, last, dtype=np.int64)
        ticks = self.ticks(scans)
        if margin:
            inside = (ticks >= start) & (ticks < end)
            scans, ticks = scans[inside], ticks[inside]
        return scans, ticks


class ScanCursor:
    """Steps through the scans of a clock and says which have become due since the last call."""

    def __init__(self, clock: ScanClock) -> None:
        self.clock = clock
        self.seek(0)

    def seek(self, tick: int) -> None:
        """Make the first scan at or after `tick` the next one."""
        # Jitter moves a scan by less than half a period off its grid.
        scan = max(0, self.clock.first_scan_at_or_after(tick) - 1)
        while (at := self.clock.tick_of(scan)) < tick:
            scan += 1
        self.scan, self.tick = scan, at

    def pop_due_scan(self, tick: int) -> tuple[int, int] | None:
        """Return (latest scan due at `tick`, number missed) and move on; None if none is due."""
        if tick < self.tick:
            return None
        first = self.scan
        self.scan, self.tick = first + 1, self.clock.tick_of(first + 1)
        if self.tick <= tick:
            self.seek(tick + 1)
        return self.scan - 1, self.scan - 1 - first

    def next_scan_tick(self, tick: int) -> int:
        """Return the tick of the first scan after `tick`, without moving the cursor."""
        if self.tick > tick:
            return self.tick
        ahead = ScanCursor(self.clock)
        ahead.seek(tick + 1)
        return ahead.tick
