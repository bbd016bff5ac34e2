"""The scan clocks of replicas that run in lock step, as one clock on their common timeline."""

from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction

import numpy as np

from dsa_des.arrays.types import IntArray
from dsa_des.time.clock import ScanClock
from dsa_des.time.timeline import ReplicaTime, first_scan

Scans = tuple[IntArray, IntArray]


class ReplicaClock(ScanClock):
    """One block's scans in every replica.

    Parameters
    ----------
    clocks : sequence of ScanClock
        One for each replica.
    time : ReplicaTime
    """

    def __init__(self, clocks: Sequence[ScanClock], time: ReplicaTime) -> None:
        first = clocks[0]
        self.spec, self.ticks_per_s = first.spec, first.ticks_per_s
        self.period = min(clock.period for clock in clocks)
        self._clocks = clocks
        self._time = time
        rates = {replace(clock.spec, offset_s=Fraction(0)) for clock in clocks}
        # Clocks that differ in their offsets only are one array expression.
        self._alike = len(rates) == 1 and first.spec.jitter_s == 0
        self._offsets = np.array([clock.offset for clock in clocks], dtype=np.int64)
        self._last = (0, -1, None)

    def _between(self, start: int, end: int) -> Scans:
        """Return the scan numbers and ticks on the common timeline, in order."""
        span, length = self._time.span_ticks, self._time.run_ticks
        first = max(0, start // span)
        last = min(-(-end // span), self._time.replicas)
        if self._alike and last - first > 1:
            return self._alike_between(start, end, first, last)
        found: list[Scans] = []
        for replica in range(first, last):
            begin = replica * span
            scans, ticks = self._clocks[replica].between(
                max(start - begin, 0), min(end - begin, length)
            )
            found.append((scans + first_scan(replica), ticks + begin))
        if not found:
            empty = np.empty(0, dtype=np.int64)
            return empty, empty
        return np.concatenate([s for s, _ in found]), np.concatenate([t for _, t in found])

    def _alike_between(self, start: int, end: int, first: int, last: int) -> Scans:
        clock = self._clocks[first]
        earliest = int(self._offsets[first:last].min())
        scans, ticks = clock.between(0, self._time.run_ticks + clock.offset - earliest)
        replicas = np.arange(first, last, dtype=np.int64)
        begin = (replicas * self._time.span_ticks)[:, np.newaxis]
        within = ticks + (self._offsets[first:last] - clock.offset)[:, np.newaxis]
        on_line = within + begin
        numbers = scans + first_scan(1) * replicas[:, np.newaxis]
        wanted = (within < self._time.run_ticks) & (on_line >= start) & (on_line < end)
        return numbers[wanted], on_line[wanted]
