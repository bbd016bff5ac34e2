"""The scan clock of a block in every run of a scene."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from dsa_des.arrays.run_ticks import RunTicks
from dsa_des.arrays.types import IntArray
from dsa_des.time.changing_clock import ChangingClock
from dsa_des.time.clock import ClockSpec, ScanClock
from dsa_des.time.timeline_runs import Runs

#: Scan numbers, and when these scans are.
Scans = tuple[IntArray, RunTicks]
# So many scans of each drawn clock are found at a time.
_READ_SCANS = 64
_NONE: IntArray = np.empty(0, dtype=np.int64)
#: Scans read ahead: from, until, and in order of time their ticks, runs and numbers.
_NOTHING = (0, 0, _NONE, _NONE, _NONE)


class RunClock:
    """One block's scan clocks in all runs, one for each of `specs`.

    Given a run's number, `jitter` returns the draws of its clock's jitter; with `always_draws` it
    draws also where that is 0. `changes` are from which ticks on the clocks are others, and the
    specs of every run then.
    """

    def __init__(
        self,
        specs: Sequence[ClockSpec],
        ticks_per_s: int,
        runs: Runs,
        jitter: Callable[[int], Callable[[IntArray], np.ndarray]],
        *,
        always_draws: bool = False,
        changes: Sequence[tuple[int, Sequence[ClockSpec]]] = (),
    ) -> None:
        self.spec, self.changes = specs[0], changes
        self._runs = runs
        rates = {(spec.rate_hz, spec.rate_error_ppm, spec.jitter_s) for spec in specs}
        # Clocks that differ in their offsets only are one array expression.
        self._alike = len(rates) == 1 and self.spec.jitter_s == 0 and not (always_draws or changes)

        def clock(number: int, spec: ClockSpec) -> Any:
            if not changes:
                return ScanClock(spec, ticks_per_s, jitter(number), always_draws=always_draws)
            mine = [(tick, later[number]) for tick, later in changes]
            return ChangingClock(spec, mine, ticks_per_s, jitter(number), always_draws=always_draws)

        each = enumerate(specs[:1] if self._alike else specs)
        self._clocks = [clock(number, spec) for number, spec in each]
        self.period = min(clock.period for clock in self._clocks)
        self._offsets = np.array([spec.offset_s * ticks_per_s for spec in specs], dtype=np.int64)
        self._alike_at_once = self._alike and bool((self._offsets == self._offsets[0]).all())
        self._going = range(0)  # those whose scans are kept in `_last` and `_read`
        self._last: tuple[int, int, Scans] = (0, -1, (_NONE, RunTicks.empty()))
        self._read = _NOTHING
        self._none = (0, -1)  # no scan from the first of these ticks on lies before the second

    @property
    def first_run_clock(self) -> Any:
        """The scan clock of the first run."""
        return self._clocks[0]

    def scans_between(self, start: int, end: int) -> Scans:
        """Return the scans, with start <= tick < end, of the runs that are being simulated."""
        if self._going != self._runs.going:
            self._going, self._last, self._read = self._runs.going, (0, -1, self._last[2]), _NOTHING
        # Several blocks ask for the same scans of a window, one after the other.
        if self._last[:2] != (start, end):
            self._last = start, end, self._scans_between(start, min(end, self._runs.run_ticks))
        return self._last[2]

    def lower_bound_of_next_scan(self, tick: int) -> int:
        """Return a tick that is no later than any run's scan at or after `tick`: a lower bound."""
        if self._runs.count > 1 and not self._alike_at_once:
            return tick
        # Who asks goes on in time, and what was found holds up to there.
        if not self._none[0] <= tick <= self._none[1]:
            self._none = tick, self._clocks[0].lower_bound_of_next_scan(tick)
        return max(tick, self._none[1])

    def previous_ticks(self, scans: IntArray, run: IntArray) -> IntArray:
        """Return the tick of the scan before each given one in its run; -1 before the first."""
        if self._alike:
            shift = self._offsets[run] - self._clocks[0].offset
            return np.where(scans > 0, self._clocks[0].previous_ticks(scans) + shift, -1)
        ticks = np.empty_like(scans)
        for one in np.unique(run).tolist():
            ticks[run == one] = self._clocks[one].previous_ticks(scans[run == one])
        return ticks

    def _scans_between(self, start: int, end: int) -> Scans:
        if self._runs.count == 1:
            scans, ticks = self._clocks[0].scans_between(start, end)
            return scans, RunTicks.of_run(0, ticks)
        if self._alike:
            return self._scans_between_if_alike(start, end)
        if start < self._read[0] or end > self._read[1]:
            self._cache_scans_ahead(start, end)
        ticks, runs, numbers = self._read[2:]
        rows = slice(*np.searchsorted(ticks, [start, end]).tolist())
        order = np.argsort(runs[rows], kind="stable")
        return numbers[rows][order], RunTicks(runs[rows][order], ticks[rows][order])

    def _cache_scans_ahead(self, start: int, end: int) -> None:
        """Compute the scans of all running runs for some time ahead, kept in order of time."""
        until = max(end, min(start + round(_READ_SCANS * self.period), self._runs.run_ticks))
        scans_of_each = [self._clocks[run].scans_between(start, until) for run in self._going]
        ticks = np.concatenate([ticks for _, ticks in scans_of_each])
        runs = np.repeat(np.array(self._going), [len(ticks) for _, ticks in scans_of_each])
        numbers = np.concatenate([scans for scans, _ in scans_of_each])
        order = np.argsort(ticks, kind="stable")
        self._read = start, until, ticks[order], runs[order], numbers[order]

    def _scans_between_if_alike(self, start: int, end: int) -> Scans:
        clock, runs = self._clocks[0], np.array(self._going, dtype=np.int64)
        offsets = self._offsets[runs]
        earliest, latest = int(offsets.min()), int(offsets.max())
        scans, ticks = clock.scans_between(
            start + clock.offset - latest, end + clock.offset - earliest
        )
        if not len(ticks):
            return _NONE, RunTicks.empty()
        later = offsets - clock.offset
        first, last = np.searchsorted(ticks, [start - later, end - later])
        counts = last - first
        place = np.arange(counts.sum()) + np.repeat(first - (counts.cumsum() - counts), counts)
        tick = ticks.take(place) + np.repeat(later, counts)
        return scans.take(place), RunTicks(np.repeat(runs, counts), tick)
