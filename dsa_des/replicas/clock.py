"""The scan clocks of replicas that run in lock step, as one clock on their common timeline."""

from collections.abc import Callable, Sequence

import numpy as np

from dsa_des.arrays.types import IntArray
from dsa_des.time.clock import ClockSpec, ScanClock
from dsa_des.time.timeline import ReplicaTime, first_scan, split_scans

Scans = tuple[IntArray, IntArray]
# So many scans of each drawn clock are found at a time.
_READ_SCANS = 64
_NONE: IntArray = np.empty(0, dtype=np.int64)
#: Scans read ahead: from, until, and in order of time within the replicas these times, the scan
#: numbers and the ticks on the line.
_NOTHING = (0, 0, _NONE, _NONE, _NONE)


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
        self._runs = range(0)  # those whose scans are kept in `_last` and `_read`
        self._read = _NOTHING

    def between(self, start: int, end: int) -> Scans:
        """Return the scans of the replicas that run now, with start <= tick < end within each."""
        if self._runs != self._time.runs:
            self._runs, self._last, self._read = self._time.runs, (0, -1, None), _NOTHING
        return super().between(start, min(end, self._time.run_ticks))

    def before(self, scans: IntArray) -> IntArray:
        """Return when the scan before each was, in ticks of its own run; -1 before the first."""
        replica, own = split_scans(scans)
        if self._alike:
            shift = self._offsets[replica] - self._clocks[0].offset
            return np.where(own > 0, self._clocks[0].before(own) + shift, -1)
        found = np.empty_like(own)
        for run in np.unique(replica).tolist():
            found[replica == run] = self._clocks[run].before(own[replica == run])
        return found

    def _between(self, start: int, end: int) -> Scans:
        """Return their scan numbers and ticks on the common timeline, in order."""
        if self._alike:
            return self._alike_between(start, end)
        if start < self._read[0] or end > self._read[1]:
            self._read_ahead(start, end)
        own, numbers, ticks = self._read[2:]
        rows = slice(*np.searchsorted(own, [start, end]).tolist())
        order = np.argsort(ticks[rows], kind="stable")
        return numbers[rows][order], ticks[rows][order]

    def _read_ahead(self, start: int, end: int) -> None:
        """Keep the scans of a while, in order of time: drawn ones are found clock by clock."""
        until = max(end, min(start + round(_READ_SCANS * self.period), self._time.run_ticks))
        found = [self._clocks[run].between(start, until) for run in self._runs]
        own = np.concatenate([ticks for _, ticks in found])
        replica = np.repeat(np.array(self._runs), [len(ticks) for _, ticks in found])
        numbers = np.concatenate([scans for scans, _ in found]) + replica * first_scan(1)
        order = np.argsort(own, kind="stable")
        ticks = own + replica * self._time.span_ticks
        self._read = start, until, own[order], numbers[order], ticks[order]

    def _alike_between(self, start: int, end: int) -> Scans:
        clock, replicas = self._clocks[0], np.array(self._runs, dtype=np.int64)
        offsets = self._offsets[replicas]
        earliest, latest = int(offsets.min()), int(offsets.max())
        scans, ticks = clock.between(start + clock.offset - latest, end + clock.offset - earliest)
        within = ticks + (offsets - clock.offset)[:, np.newaxis]
        on_line = within + (replicas * self._time.span_ticks)[:, np.newaxis]
        numbers = scans + first_scan(1) * replicas[:, np.newaxis]
        wanted = (within >= start) & (within < end)
        return numbers[wanted], on_line[wanted]
