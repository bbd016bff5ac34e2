"""What can go wrong, said once and completely.

Every error of a scene is a `Problem`; a scene with any raises one `SceneError` that lists them
all. An exception inside a block becomes a `BlockFailure` that says which block, when.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from difflib import get_close_matches
from typing import Any

from dsa_des.safe_text import MOST_OF_A_VALUE, printable, shortened


def nearest(name: str, allowed: Iterable[str]) -> str | None:
    """Return the allowed name closest to a misspelt one, or None when nothing is close."""
    names = list(allowed)
    lower = {candidate.lower(): candidate for candidate in names}
    found = get_close_matches(name.lower(), list(lower), n=1, cutoff=0.6)
    return lower[found[0]] if found else None


def did_you_mean(name: str, allowed: Iterable[str]) -> str:
    """Return ``"; did you mean 'x'?"`` or, when nothing is close, the list of what is allowed."""
    names = sorted(allowed)
    close = nearest(name, names)
    if close is not None:
        return f"; did you mean {close!r}?"
    if not names:
        return ""
    shown = ", ".join(names[:12]) + (", ..." if len(names) > 12 else "")
    return f"; allowed: {shown}"


class Lines(str):
    """A message of several lines, each of which is printable already."""

    __slots__ = ()

    @classmethod
    def of(cls, lines: Iterable[object]) -> "Lines":
        """Return lines, made printable, as one message."""
        return cls("\n".join(printable(line) for line in lines))


_UNSET: Any = object()


@dataclass(frozen=True)
class Problem:
    """One thing wrong with a scene.

    Parameters
    ----------
    source : str
        The file, or ``command line``, in which the offending key was written.
    key : str
        Its dotted key, for example ``blocks.radar.scan_rate_hz``; empty for a whole file.
    message : str
        What is wrong and what is allowed.
    value : object, optional
        The offending value, shown as it was written.
    """

    source: str
    key: str
    message: str
    value: Any = _UNSET

    def __str__(self) -> str:
        where = f"{self.source}: {self.key}" if self.key else self.source
        if self.value is not _UNSET:
            where += f" = {shortened(repr(self.value), MOST_OF_A_VALUE)}"
        # On one line whatever stands in a name: nobody can write a message of ours.
        several = isinstance(self.message, Lines)
        return f"{printable(where)}: {printable(self.message, lines=several)}"


class SceneError(Exception):
    """A scene cannot be run; `problems` lists everything that is wrong with it."""

    def __init__(self, problems: Iterable[Problem]) -> None:
        self.problems = list(problems)
        super().__init__(self.problems)

    def __str__(self) -> str:
        if len(self.problems) == 1:
            return str(self.problems[0])
        lines = [f"{len(self.problems)} problems:"]
        lines += [f"  {problem}" for problem in self.problems]
        return "\n".join(lines)


class UsageError(Exception):
    """A command was called with something it cannot use (exit code 2).

    Each argument is one line of the message.
    """

    def __str__(self) -> str:
        return "\n".join(printable(line) for line in self.args)


class BlockFailure(Exception):
    """A block raised an exception while the simulation ran.

    The original exception is its ``__cause__``.
    """

    def __init__(self, block: str, path: str, time_s: float, scan: int | None, reason: str) -> None:
        self.block, self.path, self.time_s, self.scan, self.reason = (
            block,
            path,
            time_s,
            scan,
            reason,
        )
        super().__init__(block, path, time_s, scan, reason)

    #: Exit code of a command that it ends.
    exit_code = 1

    def __str__(self) -> str:
        scan = "" if self.scan is None else f", scan {self.scan}"
        return printable(
            f"{self.block} ({self.path}) failed at t = {self.time_s:.3f} s{scan}: {self.reason}"
        )


class SetupFailure(BlockFailure):
    """A block raised an exception before anything ran: the scene cannot be used."""

    exit_code = 2
