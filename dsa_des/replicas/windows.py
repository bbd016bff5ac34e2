"""Windows over replicas that lie end to end."""

from dsa_des.running.windows import EqualWindows, Window
from dsa_des.time.timeline import ReplicaTime


class ReplicaWindows(EqualWindows):
    """Windows that hold many whole replicas, or a part of one.

    Parameters
    ----------
    time : ReplicaTime
    longest_ticks
        As for `EqualWindows`; the time between replicas does not count.
    """

    def __init__(self, time: ReplicaTime, longest_ticks: int) -> None:
        super().__init__(time.end_tick, longest_ticks)
        self._time = time

    def next(self) -> Window | None:
        """Return the next window; one between replicas would be empty."""
        span, length = self._time.span_ticks, self._time.run_ticks
        number, within = divmod(self.start, span)
        if within >= length:
            number, within = number + 1, 0
        if number >= self._time.replicas:
            return None
        self.start = number * span + within
        together = self.longest_ticks // length
        if together > 1 and within == 0:
            last = min(number + together, self._time.replicas) - 1
            return Window(self.start, self.end_after((last - number) * span + length))
        return Window(self.start, self.end_after(min(self.longest_ticks, length - within)))
