"""``python -m docs.make.campaign FOLDER ...``: the table of losses of docs/platforms.md.

Folders are those of ``dsa-des study velocity_pairs`` and ``velocity_rings``, also with fewer cells
or stopped before their end: what is there of a cell counts together.
"""

import argparse
import sys
from collections.abc import Iterable
from pathlib import Path

import pandas as pd  # type: ignore[import-untyped]

from dsa_des.results.statistics import wilson
from dsa_des.terminal.interruption import plain_ending
from dsa_des.terminal.terminal import say

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


def counted(folders: Iterable[Path]) -> dict[tuple[str, int], tuple[int, int]]:
    """Return events and runs of each cell of some studies' folders."""
    found: dict[tuple[str, int], tuple[int, int]] = {}
    for folder in folders:
        runs = pd.read_parquet(folder / "parts")
        axis = next(name for name in _AXES if name in runs)
        for (value, error_m), mine in runs.groupby([axis, "error_m"]):
            cell = _AXES[axis].format(int(value)), int(error_m)
            events, many = found.get(cell, (0, 0))
            lost = mine["well_clear_lost_mitigated"]
            found[cell] = events + int(lost.sum()), many + len(lost)
    return found


def rows(folders: Iterable[Path]) -> list[str]:
    """Return the lines of the table, pairs first."""
    lines = [
        "| cell | error, m | lost | of runs | probability, 95 % | published | in each other's |",
        "|---|---|---|---|---|---|---|",
    ]
    for cell, (events, runs) in sorted(counted(folders).items()):
        ours = _between(events, runs)
        theirs, agree = "", ""
        if cell in PUBLISHED:
            other = _between(*PUBLISHED[cell])
            theirs = _words(other)
            inside = ours[1] <= other[0] <= ours[2] and other[1] <= ours[0] <= other[2]
            agree = "yes" if inside else "no"
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


def main(arguments: list[str] | None = None) -> int:
    """Run the command and return its exit code."""
    parser = argparse.ArgumentParser(
        prog="python -m docs.make.campaign",
        description="Print the table of losses beside the published ones.",
    )
    parser.add_argument("folders", type=Path, nargs="+", help="of the two studies")
    for line in rows(parser.parse_args(arguments).folders):
        say(line)
    return 0


if __name__ == "__main__":
    with plain_ending():
        sys.exit(main())
