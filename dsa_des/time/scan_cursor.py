"""The scans of a clock that fall due when a host program calls, and those it has missed."""

from dsa_des.time.clock import ScanClock


class ScanCursor:
    """Which scans of a clock have fallen due between one call and the next.

    Parameters
    ----------
    clock : ScanClock
    """

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

    def due(self, tick: int) -> tuple[int, int] | None:
        """Return the latest scan that is due at `tick`, and how many before it were missed."""
        if tick < self.tick:
            return None
        first = self.scan
        self.scan, self.tick = first + 1, self.clock.tick_of(first + 1)
        if self.tick <= tick:
            self.seek(tick + 1)
        return self.scan - 1, self.scan - 1 - first

    def after(self, tick: int) -> int:
        """Return the tick of the first scan after `tick`; the cursor stays."""
        if self.tick > tick:
            return self.tick
        ahead = ScanCursor(self.clock)
        ahead.seek(tick + 1)
        return ahead.tick
