"""Who needs a block's rows, and when: a block on demand runs at the scans of those downstream."""

from dataclasses import dataclass

from dsa_des.arrays.types import IntArray
from dsa_des.time.clock import ScanClock
from dsa_des.time.timeline import ReplicaTime


@dataclass
class Demand:
    """A clocked block downstream, and how long before its scan it needs our row."""

    block: str
    clock: ScanClock
    lead_ticks: int
    time: ReplicaTime

    def between(self, start: int, end: int) -> IntArray:
        """Return the ticks in [start, end) at which this block needs a row."""
        if not self.lead_ticks:
            return self.clock.between(start, end)[1]
        # A row that would arrive after the end of the run is not needed.
        last = min(end + self.lead_ticks, self.time.end_tick)
        _, ticks = self.clock.between(start + self.lead_ticks, last)
        if self.time.span_ticks and not self.time.side_by_side:
            # Rows from before a replica's start do not exist.
            ticks = ticks[ticks % self.time.span_ticks >= self.lead_ticks]
        return ticks - self.lead_ticks
