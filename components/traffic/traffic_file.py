"""The content of a traffic file, and the one error it raises when it cannot be read."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field

from components.traffic.trajectory import SampledTrajectory
from dsa_des.errors import Lines, nearest
from dsa_des.text.safe_text import shortened

MOST_PROBLEMS = 20
"""Problems listed in one error; further ones are only counted."""
MOST_COLUMNS = 30
"""Names of columns listed in a message."""
MOST_OF_A_CELL = 24
"""Letters of a cell that a message repeats."""


class TrafficFileError(ValueError):
    """A traffic file cannot be used; `problems` says everything that is wrong with it.

    Parameters
    ----------
    path : str
        The file.
    problems : list of str
        Each with line, column, value and what is allowed, as far as they apply.
    """

    def __init__(self, path: str, problems: Iterable[str]) -> None:
        self.path = str(path)
        self.problems = list(problems)
        # Plain positional arguments: pickling and SimPy rebuild an exception from them.
        super().__init__(self.path, self.problems)

    def __str__(self) -> str:
        if len(self.problems) == 1:
            return Lines.of([f"{self.path}: {self.problems[0]}"])
        lines = [f"{self.path}: {len(self.problems)} problems"]
        return Lines.of(lines + [f"  {problem}" for problem in self.problems])


@dataclass(frozen=True)
class TrafficFile:
    """The aircraft of a traffic file.

    Parameters
    ----------
    ownship : SampledTrajectory
        The first aircraft named in the file, or the one asked for.
    intruders : list of SampledTrajectory
        All others, in the order in which the file first names them.
    start_time_s : float
        The file's own time of its earliest sample. Times in the trajectories count from there.
    notes : list of str
        What was assumed, reordered or ignored.
    """

    ownship: SampledTrajectory
    intruders: list[SampledTrajectory]
    start_time_s: float
    notes: list[str] = field(default_factory=list)

    @property
    def aircraft(self) -> list[SampledTrajectory]:
        """Ownship first, then the intruders."""
        return [self.ownship, *self.intruders]


class Problems:
    """Collects what is wrong with one file, to be reported at once.

    Parameters
    ----------
    path : str
        The file.
    """

    def __init__(self, path: str) -> None:
        self.path = path
        #: Line (infinite for none) and text.
        self._found: list[tuple[float, str]] = []
        self._more = 0

    def add(self, problem: str, *, line: int | None = None, column: str | None = None) -> None:
        """Note a problem, with its line and column where it has them."""
        place = [f"line {line}"] if line is not None else []
        place += [f"column {column}"] if column is not None else []
        if len(self._found) < MOST_PROBLEMS:
            text = f"{', '.join(place)}: {problem}" if place else problem
            self._found.append((math.inf if line is None else line, text))
        else:
            self._more += 1

    def raise_if_any(self) -> None:
        """Raise one `TrafficFileError` with all problems so far, in order of their lines."""
        if not self._found:
            return
        found = [text for _, text in sorted(self._found, key=lambda one: one[0])]
        if self._more:
            found[-1] += f" (and {self._more} more problems)"
        raise TrafficFileError(self.path, found)

    def fail(self, problem: str, *, line: int | None = None, column: str | None = None) -> None:
        """Note a problem that makes reading on pointless, and raise."""
        self.add(problem, line=line, column=column)
        self.raise_if_any()


def shown_columns(headers: Iterable[str], known: bool) -> str:
    """Return the names of columns for a message; `known` says whether any is one of ours.

    A file without any of our columns is something else, whose content is not quoted.
    """
    names = [shortened(header, MOST_OF_A_CELL) for header in headers]
    if not known:
        return f"the {len(names)} columns of the first row"
    return ", ".join(names[:MOST_COLUMNS]) + (", …" if len(names) > MOST_COLUMNS else "")


def did_you_mean(name: str, allowed: Iterable[str]) -> str:
    """Return a suggestion for a misspelt name, or an empty string when nothing is close."""
    close = nearest(name, sorted(allowed))
    return f"; did you mean {close!r}?" if close else ""
