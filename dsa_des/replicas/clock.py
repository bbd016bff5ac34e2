"""The scan clocks of replicas that run in lock step, as one clock on their common timeline."""

from collections.abc import Callable, Sequence

import numpy as np

from dsa_des.arrays.types import IntArray
from dsa_des.time.clock import ClockSpec, ScanClock
from dsa_des.time.timeline import ReplicaTime, first_scan

Scans = tuple[IntArray, IntArray]
# So many scans of each drawn clock are found at a time.
_READ_SCANS = 64


class ReplicaClock(ScanClock):
    """One block's scans in every replica.

    Parameters
    ----------
    specs : sequence of ClockSpec
        One for each replica.
    ticks_per_s : int
    time : ReplicaTime
    jitter : callable
        Given a replica's number, returns the draws of its clock's jitter.
    """

    def __init__(
        self,
        specs: Sequence[ClockSpec],
        ticks_per_s: int,
        time: ReplicaTime,
        jitter: Callable[[int], Callable[[IntArray], np.ndarray]],
    ) -> None:
        self.spec, self.ticks_per_s = specs[0], ticks_per_s
        self._time = time
        rates = {(spec.rate_hz, spec.rate_error_ppm, spec.jitter_s) for spec in specs}
        # Clocks that differ in their offsets only are one array expression.
        self._alike = len(rates) == 1 and self.spec.jitter_s == 0
        self._clocks = [
            ScanClock(spec, ticks_per_s, jitter(number))
            for number, spec in enumerate(specs[:1] if self._alike else specs)
        ]
        self.period = min(clock.period for clock in self._clocks)
        self._offsets = np.array([spec.offset_s * ticks_per_s for spec in specs], dtype=np.int64)
        self._last = (0, -1, None)
        none = np.empty(0, dtype=np.int64)
        #: Scans read ahead: from, until, and in order of time within the replicas these times,
        #: the scan numbers and the ticks on the line.
        self._read = (0, 0, none, none, none)

    def _between(self, start: int, end: int) -> Scans:
        """Return the scan numbers and ticks on the common timeline, in order."""
        if self._time.side_by_side:
            return self._of_all(start, end)
        span, length = self._time.span_ticks, self._time.run_ticks
        first = max(0, start // span)
        last = min(-(-end // span), self._time.replicas)
        if self._alike and last > first:
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

    def _of_all(self, start: int, end: int) -> Scans:
        """Return the scans of every replica with start <= tick < end within it."""
        end = min(end, self._time.run_ticks)
        if self._alike:
            return self._alike_between(start, end, 0, self._time.replicas)
        if start < self._read[0] or end > self._read[1]:
            self._read_ahead(start, end)
        own, numbers, ticks = self._read[2:]
        rows = slice(*np.searchsorted(own, [start, end]).tolist())
        order = np.argsort(ticks[rows], kind="stable")
        return numbers[rows][order], ticks[rows][order]

    def _read_ahead(self, start: int, end: int) -> None:
        """Keep the scans of a while, in order of time: drawn ones are found clock by clock."""
        until = max(end, min(start + round(_READ_SCANS * self.period), self._time.run_ticks))
        found = [clock.between(start, until) for clock in self._clocks]
        own = np.concatenate([ticks for _, ticks in found])
        replica = np.repeat(np.arange(len(found)), [len(ticks) for _, ticks in found])
        numbers = np.concatenate([scans for scans, _ in found]) + replica * first_scan(1)
        order = np.argsort(own, kind="stable")
        ticks = own + replica * self._time.span_ticks
        self._read = start, until, own[order], numbers[order], ticks[order]

    def _alike_between(self, start: int, end: int, first: int, last: int) -> Scans:
        clock = self._clocks[0]
        earliest = int(self._offsets[first:last].min())
        begin, until = 0, self._time.run_ticks
        if self._time.side_by_side:
            begin, until = start, end
        elif last - first == 1:
            first_tick = first * self._time.span_ticks
            begin, until = max(start - first_tick, 0), min(end - first_tick, until)
        latest = int(self._offsets[first:last].max())
        scans, ticks = clock.between(begin + clock.offset - latest, until + clock.offset - earliest)
        replicas = np.arange(first, last, dtype=np.int64)
        within = ticks + (self._offsets[first:last] - clock.offset)[:, np.newaxis]
        on_line = within + (replicas * self._time.span_ticks)[:, np.newaxis]
        numbers = scans + first_scan(1) * replicas[:, np.newaxis]
        if self._time.side_by_side:
            wanted = (within >= start) & (within < end)
        else:
            wanted = (within < self._time.run_ticks) & (on_line >= start) & (on_line < end)
        return numbers[wanted], on_line[wanted]
