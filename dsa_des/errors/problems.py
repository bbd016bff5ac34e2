"""Problems and errors, each reported once and completely.

Every error of a scene is a `Problem`; a scene with any raises one `SceneError` that lists them
all. An exception inside a block becomes a `BlockFailure` that says which block, when.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from datetime import date, time
from difflib import get_close_matches
from typing import Any

from dsa_des.text.safe_text import MOST_OF_A_VALUE, escape_unprintable, shorten

#: Problems that are listed in one error; the others are only counted.
MOST_PROBLEMS = 20
# What one problem shows of a value, a key and a message.
_KEY_LENGTH = 200
_LINE_LENGTH = 1000
_MOST_LINES = 2 * MOST_PROBLEMS
# Names longer or more than these are not compared: that takes longer than a user waits.
_LONGEST_NAME = 100
_MOST_NAMES = 2000


def nearest_name(name: str, allowed: Iterable[str]) -> str | None:
    """Return the allowed name closest to a misspelt one, or None when nothing is close."""
    if len(name) > _LONGEST_NAME:
        return None
    names = [candidate for candidate in allowed if len(candidate) <= _LONGEST_NAME]
    if len(names) > _MOST_NAMES:
        return None
    lower = {candidate.lower(): candidate for candidate in names}
    result = get_close_matches(name.lower(), list(lower), n=1, cutoff=0.6)
    return lower[result[0]] if result else None


def did_you_mean(name: str, allowed: Iterable[str]) -> str:
    """Return ``"; did you mean 'x'?"`` or, when nothing is close, the list of what is allowed."""
    names = sorted(allowed)
    close = nearest_name(name, names)
    if close is not None:
        return f"; did you mean {close!r}?"
    if not names:
        return ""
    shown = ", ".join(shorten(name, MOST_OF_A_VALUE) for name in names[:12])
    shown += ", ..." if len(names) > 12 else ""
    return f"; allowed: {shown}"


class Disagreements(ValueError):
    """Several things that keys of one table disagree about, each a problem of its own.

    Parameters
    ----------
    texts : iterable of str
        One or more.
    """

    def __init__(self, texts: Iterable[str]) -> None:
        self.texts = tuple(texts)
        super().__init__("; ".join(self.texts))

    @classmethod
    def raise_if_any(cls, texts: Iterable[str]) -> None:
        """Raise one exception with all the texts, if there are any."""
        if result := tuple(texts):
            raise cls(result)


class Lines(str):
    """A message of several lines, each of which is printable already."""

    __slots__ = ()

    @classmethod
    def from_lines(cls, lines: Iterable[object]) -> "Lines":
        """Return the lines, made printable, as one text of several lines."""
        return cls("\n".join(escape_unprintable(line) for line in lines))


def shortened_repr(value: Any) -> str:
    """Return how a value is shown in a message: as Python writes it, cut off where it is long.

    Dates and times, which only TOML has, are shown as TOML writes them.
    """
    if isinstance(value, str):
        # Cut before it is quoted: a long text is not copied.
        return shorten(repr(str(value[: MOST_OF_A_VALUE + 1])), MOST_OF_A_VALUE)
    if isinstance(value, int) and not isinstance(value, bool) and value.bit_length() > 400:
        return f"a whole number of {value.bit_length()} bits"
    if isinstance(value, dict | list | tuple):
        left, right = "{}" if isinstance(value, dict) else "[]" if isinstance(value, list) else "()"
        text = left
        for item in value:
            text += ", " if len(text) > 1 else ""
            text += shortened_repr(item)
            if isinstance(value, dict):
                text += f": {shortened_repr(value[item])}"
            if len(text) > MOST_OF_A_VALUE:
                return shorten(text, MOST_OF_A_VALUE)
        text += "," if isinstance(value, tuple) and len(value) == 1 else ""
        return shorten(text + right, MOST_OF_A_VALUE)
    if isinstance(value, date | time):
        return value.isoformat()
    return shorten(repr(value), MOST_OF_A_VALUE)


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
        where = shorten(self.source, _LINE_LENGTH)
        where += f": {shorten(self.key, _KEY_LENGTH)}" if self.key else ""
        if self.value is not _UNSET:
            where += f" = {shortened_repr(self.value)}"
        # On one line whatever stands in a name: a name cannot imitate a message of ours.
        lines = self.message.split("\n") if isinstance(self.message, Lines) else [self.message]
        return f"{where}: " + "\n".join(shorten(line, _LINE_LENGTH) for line in lines[:_MOST_LINES])


class SceneError(Exception):
    """A scene cannot be run; `problems` lists everything that is wrong with it.

    As text, the first `MOST_PROBLEMS` of them and the number of all.
    """

    def __init__(self, problems: Iterable[Problem]) -> None:
        self.problems = list(problems)
        super().__init__(self.problems)

    def __str__(self) -> str:
        if len(self.problems) == 1:
            return str(self.problems[0])
        lines = [f"{len(self.problems)} problems:"]
        lines += [f"  {problem}" for problem in self.problems[:MOST_PROBLEMS]]
        if len(self.problems) > MOST_PROBLEMS:
            lines.append(f"  and {len(self.problems) - MOST_PROBLEMS} more")
        return "\n".join(lines)


class UsageError(Exception):
    """A command was called with something it cannot use (exit code 2).

    Each argument is one line of the message.
    """

    def __str__(self) -> str:
        return "\n".join(escape_unprintable(line) for line in self.args)


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

    @property
    def exit_code(self) -> int:
        """The command's exit code: the cause's if it has one (3: a foreign part), else 1."""
        return int(getattr(self.__cause__, "exit_code", 1))

    def __str__(self) -> str:
        scan = "" if self.scan is None else f", scan {self.scan}"
        return escape_unprintable(
            f"{self.block} ({self.path}) failed at t = {self.time_s:.3f} s{scan}: {self.reason}"
        )


class SetupFailure(BlockFailure):
    """A block raised an exception before anything ran: the scene cannot be used."""

    @property
    def exit_code(self) -> int:
        """The exit code of a command that ends with this error: 2, or 3 if a foreign part died."""
        return 3 if super().exit_code == 3 else 2


class RunRefused(Exception):
    """The engine itself cannot go on with a run as it was put together; no block has failed."""


class OutputError(Exception):
    """Results could not be written: the disk is full, their folder is gone (exit code 1)."""
