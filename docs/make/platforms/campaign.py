"""Losses of separation beside published ones, from the runs of the two studies of velocities."""

from collections.abc import Sequence
from typing import Any

from dsa_des.results.statistics import wilson

#: Events and runs by plain counting in github.com/fazlurnu/OpenCDaRR (MIT), scripts/validation, of
#: pairs by crossing angle and of rings by number, and the errors of positions, m.
PUBLISHED = {
    ("pair, 45°", 30): (50, 12_387),
    ("pair, 90°", 30): (61, 54_900),
    ("pair, 180°", 10): (66, 2_387_430),
    ("pair, 135°", 5): (61, 4_009_594),
    ("ring of 3", 30): (57, 30_429),
    ("ring of 8", 30): (75, 3_393),
    ("ring of 8", 5): (61, 185_341),
    ("ring of 3", 5): (106, 3_164_328),
}
_AXES = {"crossing_deg": "pair, {}°", "aircraft": "ring of {}"}
_CONFIDENCE = 0.95
#: Of fewer events an interval says little.
_LEAST = 50


def counted(studies: Sequence[Any]) -> dict[tuple[str, int], tuple[int, int]]:
    """Return events and runs of each cell of some studies."""
    found: dict[tuple[str, int], tuple[int, int]] = {}
    for runs in studies:
        axis = next(name for name in _AXES if name in runs)
        for (value, error_m), mine in runs.groupby([axis, "error_m"]):
            cell = _AXES[axis].format(int(value)), int(error_m)
            events, many = found.get(cell, (0, 0))
            lost = mine["well_clear_lost_mitigated"]
            found[cell] = events + int(lost.sum()), many + len(lost)
    return found


def rows(studies: Sequence[Any]) -> list[str]:
    """Return the lines of the table, pairs first."""
    lines = [
        "| cell | error, m | lost | of runs | probability, 95 % | published | in each other's |",
        "|---|---|---|---|---|---|---|",
    ]
    for cell, (events, runs) in sorted(counted(studies).items()):
        ours = _between(events, runs)
        theirs, agree = "", ""
        if cell in PUBLISHED:
            other = _between(*PUBLISHED[cell])
            theirs = _words(other)
            inside = ours[1] <= other[0] <= ours[2] and other[1] <= ours[0] <= other[2]
            agree = "yes" if inside else "no"
            agree = agree if min(events, PUBLISHED[cell][0]) >= _LEAST else f"under {_LEAST} lost"
        what, error_m = cell
        lines.append(
            f"| {what} | {error_m} | {events} | {runs:,} | {_words(ours)} | {theirs} | {agree} |"
        )
    return lines


def _between(events: int, runs: int) -> tuple[float, float, float]:
    return events / runs, *wilson(events, runs, _CONFIDENCE)


def _words(between: tuple[float, float, float]) -> str:
    value, low, high = (f"{of:.2e}".replace("e-0", "e-") for of in between)
    return f"{value} ({low} to {high})"
