"""Windows in which shared processors do what was rehearsed, and no surprise is left."""

from collections.abc import Iterable

from dsa_des.running.rehearsed_lines import RehearsedLines
from dsa_des.running.rewind import Rewinder
from dsa_des.running.windows import EqualWindows, Failure, Window

# At the start a window has this part of its full length.
_START = 32
# So many times a window with surprises is run again as a whole, guessing by who sent in it.
_ATTEMPTS = 3


class RehearsedWindows(EqualWindows):
    """Windows that are undone at a surprise and run again up to it, now that it is known.

    Parameters
    ----------
    end_tick, longest_ticks, cuts
        As for `EqualWindows`.
    rewinder : Rewinder
    lines : RehearsedLines
    """

    def __init__(
        self,
        end_tick: int,
        longest_ticks: int,
        cuts: Iterable[int],
        rewinder: Rewinder,
        lines: RehearsedLines,
    ) -> None:
        super().__init__(end_tick, longest_ticks, cuts)
        self._rewinder, self._lines = rewinder, lines
        self._length = 0
        self._attempts = 0
        self._known: Window | None = None  # what is right of a window that was undone

    def next(self) -> Window | None:
        """Return what is right of the last window, or a new one that may be undone."""
        if self.start >= self.end_tick:
            return None
        if self._known is not None:
            return self._known
        self._rewinder.mark()
        length = self._length or max(1, self.longest_ticks // _START)
        return Window(self.start, self.end_after(length), True)

    def heard(self, window: Window, failure: Failure | None) -> int | None:
        """Undo a window with a surprise, or one in which a block failed later than it began."""
        surprise = self._lines.first_surprise()
        if failure is not None and (surprise is None or surprise >= failure.ticks[0]):
            if window.end - window.start > 1:
                self._undo(window, self._before(failure, window))
                return None
        elif surprise is not None:
            self._lines.learn(surprise)
            self._attempts += 1
            again = self._attempts <= _ATTEMPTS
            self._undo(window, window.end if again else surprise + 1)
            return None
        self._lines.close()
        length = window.end - window.start
        self._length = min(2 * length, self.longest_ticks)
        self._known, self._attempts = None, 0
        return super().heard(window, failure)

    def _undo(self, window: Window, end: int) -> None:
        self._rewinder.restore()
        self._lines.undo()
        self._known = Window(window.start, end, True)

    @staticmethod
    def _before(failure: Failure, window: Window) -> int:
        """Return where a shorter window ends: before what failed, or behind its first instant."""
        first = int(failure.ticks[0])
        if first > window.start:
            return first
        return int(failure.ticks[1]) if len(failure.ticks) > 1 else window.start + 1
