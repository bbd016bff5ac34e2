"""A row of docs/published.md: what others published, what we get, and a verdict; and its table."""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

Verdict = Literal["equal", "inside", "outside"]

_HEAD = (
    "| what | published | ours | difference | verdict |",
    "|---|---|---|---|---|",
)


@dataclass(frozen=True)
class PublishedRow:
    """One published number beside ours.

    Parameters
    ----------
    what : str
    published, ours : float
    unit : str
        Of both; none by default.
    within : float, optional
        How far apart both may be and count as equal: what was asked, or half of the last digit
        that is printed.
    interval : (low, high), optional
        Where ours lies with 95 % (or as the section says), of what is estimated by chance.
    digits : int
        Decimals that are shown.
    """

    what: str
    published: float
    ours: float
    unit: str = ""
    within: float | None = None
    interval: tuple[float, float] | None = None
    digits: int = 3

    @property
    def verdict(self) -> Verdict:
        """Equal within what was asked; inside our interval; or outside."""
        if self.within is not None and abs(self.ours - self.published) <= self.within:
            return "equal"
        if self.interval is not None and self.interval[0] <= self.published <= self.interval[1]:
            return "inside"
        return "outside"

    def line(self) -> str:
        """Return the line of the table."""
        unit = f" {self.unit}" if self.unit else ""
        ours = f"{self._shown(self.ours)}{unit}"
        if self.interval is not None:
            ours += f" ({self._shown(self.interval[0])} to {self._shown(self.interval[1])})"
        verdict: str = self.verdict
        if verdict == "equal":
            verdict += f" (within {self.within:g}{unit})"
        cells = self.what, f"{self._shown(self.published)}{unit}", ours, self._off(), verdict
        return f"| {' | '.join(cells)} |"

    def _shown(self, value: float) -> str:
        return f"{value:.{self.digits}f}"

    def _off(self) -> str:
        off = self.ours - self.published
        if not math.isfinite(off):
            return "-"
        return "0" if round(off, self.digits) == 0 else f"{off:+.{self.digits}f}"


def table(rows: Iterable[PublishedRow]) -> str:
    """Return the table of some rows."""
    return "\n".join([*_HEAD, *(row.line() for row in rows)])
