"""A scan clock whose rate, drift, jitter or phase changes at some instants."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from fractions import Fraction

import numpy as np

from dsa_des.arrays.types import IntArray
from dsa_des.time.clock import MAX_TICK, ClockSpec, ScanClock

#: A clock, the first instant of which it tells the scans, and what its block says of it.
Change = tuple[int, ClockSpec]


class ChangingClock:
    """Scan instants of a block whose clock changes in a run, numbered on over all changes.

    A clock of a new rate counts from the instant of the change on, where its first scan is. One
    that drifts or jitters otherwise goes on from the scans before; another offset moves them by as
    much as it differs. A scan belongs to the clock that tells the time at its instant on the grid,
    and jitter does not move it out of that clock's stretch.

    It has what `ScanClock` has that the scans of a run are asked for.
    """

    def __init__(
        self,
        spec: ClockSpec,
        changes: Sequence[Change],
        ticks_per_s: int,
        jitter_draw: Callable[[IntArray], np.ndarray],
        *,
        always_draws: bool = False,
    ) -> None:
        #: From which tick on each clock tells the time, and the end of the last.
        self._from = np.array([0, *(tick for tick, _ in changes), MAX_TICK], dtype=np.int64)
        self._clocks: list[ScanClock] = []
        #: The first scan of each clock by its own numbers, and its number in the run.
        self._own: list[int] = []
        self._number = [0]

        def draw_from(first: int) -> Callable[[IntArray], np.ndarray]:
            return lambda scans: jitter_draw(scans + first)

        for part, (start, new) in enumerate([(0, spec), *changes]):
            if part:
                new = _continue_clock(spec, new, self._clocks[-1], start, ticks_per_s)
                spec = changes[part - 1][1]
            clock = ScanClock(new, ticks_per_s, always_draws=always_draws)
            own = clock.first_scan_at_or_after(start)
            shift = self._number[-1] - own
            clock = ScanClock(new, ticks_per_s, draw_from(shift), always_draws=always_draws)
            self._clocks.append(clock)
            self._own.append(own)
            count = clock.first_scan_at_or_after(int(self._from[part + 1])) - own
            self._number.append(self._number[-1] + count)
        self.spec = self._clocks[0].spec
        self.offset = self._clocks[0].offset
        self.period: Fraction = min(clock.period for clock in self._clocks)

    def ticks(self, scans: IntArray) -> IntArray:
        """Return the ticks of the scans with the given numbers, (n,)."""
        scans = np.asarray(scans, dtype=np.int64)
        part = np.searchsorted(self._number[1:-1], scans, side="right")
        ticks = np.empty_like(scans)
        for one in np.unique(part).tolist():
            mine = part == one
            own = scans[mine] - (self._number[one] - self._own[one])
            first, end = self._from[one : one + 2]
            ticks[mine] = np.clip(self._clocks[one].ticks(own), first, end - 1)
        return ticks

    def previous_ticks(self, scans: IntArray) -> IntArray:
        """Return the tick of the scan before each given one in its run; -1 before the first."""
        earlier = np.asarray(scans, dtype=np.int64) - 1
        return np.where(earlier < 0, -1, self.ticks(np.maximum(earlier, 0)))

    def lower_bound_of_next_scan(self, tick: int) -> int:
        """Return a tick that is no later than any scan at or after `tick`: a lower bound."""
        return tick

    def scans_between(self, start: int, end: int) -> tuple[IntArray, IntArray]:
        """Return (scan numbers, ticks) of the scans with start <= tick < end, in order."""
        found: list[IntArray] = [np.empty(0, dtype=np.int64)]
        for part, clock in enumerate(self._clocks):
            first, last = max(start, int(self._from[part])), min(end, int(self._from[part + 1]))
            if first < last:
                # Jitter moves a scan by less than a period off its grid.
                low = clock.first_scan_at_or_after(first) - 1
                high = clock.first_scan_at_or_after(last) + 1
                shift = self._number[part] - self._own[part]
                low = max(low + shift, self._number[part])
                high = min(high + shift, self._number[part + 1])
                found.append(np.arange(low, high, dtype=np.int64))
        scans = np.concatenate(found)
        ticks = self.ticks(scans)
        inside = (ticks >= start) & (ticks < end)
        return scans[inside], ticks[inside]


def _continue_clock(
    old: ClockSpec, new: ClockSpec, clock: ScanClock, start: int, ticks_per_s: int
) -> ClockSpec:
    """Return the clock specification from tick `start`, on the old grid unless the rate changes."""
    if new.rate_hz != old.rate_hz:
        return replace(new, offset_s=Fraction(start, ticks_per_s))
    scan = clock.first_scan_at_or_after(start)
    tick = clock.offset + round(scan * clock.period)
    moved = tick + (new.offset_s - old.offset_s) * ticks_per_s
    return replace(new, offset_s=Fraction(moved, ticks_per_s))
