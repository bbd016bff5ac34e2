"""Losses of separation beside published ones, from the runs of the two studies of velocities."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from dsa_des.results.statistics import estimate_rare_probability, wilson_interval

#: Events and runs by plain counting in github.com/fazlurnu/OpenCDaRR (MIT), scripts/validation, of
#: pairs by crossing angle and of rings by number, and the errors of positions, m.
PUBLISHED = {
    ("pair, 45°", 30): (50, 12_387),
    ("pair, 90°", 30): (61, 54_900),
    ("pair, 180°", 30): (53, 80_953),
    ("pair, 180°", 10): (66, 2_387_430),
    ("pair, 135°", 5): (61, 4_009_594),
    ("ring of 3", 30): (57, 30_429),
    ("ring of 8", 30): (75, 3_393),
    ("ring of 8", 5): (61, 185_341),
    ("ring of 3", 5): (106, 3_164_328),
}
#: Of other cells the same by a plain loop, whose rules are in tests/platforms/test_a_plain_loop.py.
BY_A_LOOP = {
    ("pair, 135°", 30): (119, 200_000),
    ("ring of 4", 30): (119, 30_000),
    ("ring of 6", 30): (331, 28_000),
}
_AXES = {"crossing_deg": "pair, {}°", "aircraft": "ring of {}"}
_CONFIDENCE = 0.95
#: Of fewer events an interval says little.
_LEAST = 50
_LOST = "well_clear_lost_mitigated"


def counted(studies: Sequence[Any]) -> dict[tuple[str, int], tuple[int, int]]:
    """Return events and runs of each cell of some studies whose runs are counted."""
    found: dict[tuple[str, int], tuple[int, int]] = {}
    for cell, mine in _cells(studies, split=False):
        events, many = found.get(cell, (0, 0))
        found[cell] = events + int(mine[_LOST].sum()), many + len(mine)
    return found


def _cells(studies: Sequence[Any], *, split: bool) -> Iterator[tuple[tuple[str, int], Any]]:
    """Give the cells of studies whose runs are split, or counted."""
    for runs in studies:
        axis = next(name for name in _AXES if name in runs)
        for (value, error_m), mine in runs.groupby([axis, "error_m"]):
            if (f"{_LOST}.runs" in mine) == split:
                yield (_AXES[axis].format(int(value)), int(error_m)), mine


def rows(studies: Sequence[Any]) -> list[str]:
    """Return the lines of the table, pairs first."""
    lines = [
        "| cell | error, m | lost | of runs | probability, 95 % "
        "| published, or by a loop | in each other's |",
        "|---|---|---|---|---|---|---|",
    ]
    for cell, (events, runs) in sorted(counted(studies).items()):
        lines.append(_line(cell, str(events), runs, _between(events, runs), events >= _LEAST))
    for cell, mine in _cells(studies, split=True):
        found = estimate_rare_probability(
            np.array(mine[_LOST]), np.array(mine[f"{_LOST}.unseen"]), _CONFIDENCE
        )
        many = int(mine[f"{_LOST}.runs"].sum())
        collapsed = f"split, {int(mine[f'{_LOST}.collapsed'].sum())} of {len(mine)} collapsed"
        lines.append(_line(cell, collapsed, many, (found.value, found.low, found.high), True))
    return lines


def _line(
    cell: tuple[str, int], lost: str, runs: int, ours: tuple[float, float, float], enough: bool
) -> str:
    theirs, agree = "", ""
    if known := PUBLISHED.get(cell) or BY_A_LOOP.get(cell):
        other = _between(*known)
        theirs = _words(other) + ("" if cell in PUBLISHED else " loop")
        inside = ours[1] <= other[0] <= ours[2] and other[1] <= ours[0] <= other[2]
        agree = ("yes" if inside else "no") if enough else f"under {_LEAST} lost"
    return f"| {cell[0]} | {cell[1]} | {lost} | {runs:,} | {_words(ours)} | {theirs} | {agree} |"


def _between(events: int, runs: int) -> tuple[float, float, float]:
    return events / runs, *wilson_interval(events, runs, _CONFIDENCE)


def _words(between: tuple[float, float, float]) -> str:
    value, low, high = (f"{of:.2e}".replace("e-0", "e-") for of in between)
    return f"{value} ({low} to {high})"
