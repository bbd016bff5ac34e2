"""``python -m docs.make.platforms FOLDER ...``: a table of docs/platforms.md, of studies' folders.

The folders are those of ``dsa-des study equipage`` or ``link_latency``, or of ``velocity_pairs``
and ``velocity_rings``; also with fewer cells, or stopped before their end: what is there counts
together.
"""

import argparse
import sys
from pathlib import Path

import pandas as pd  # type: ignore[import-untyped]

from docs.make.platforms import campaign, equipage, link_latency
from dsa_des.terminal.interruption import exit_plainly_on_signal
from dsa_des.terminal.terminal import say


def main(arguments: list[str] | None = None) -> int:
    """Run the command and return its exit code."""
    parser = argparse.ArgumentParser(
        prog="python -m docs.make.platforms", description="Print a table of docs/platforms.md."
    )
    parser.add_argument("folders", type=Path, nargs="+", help="of studies")
    folders = parser.parse_args(arguments).folders
    found = (pd.read_parquet(folder / "parts") for folder in folders)
    runs = [one for one in found if len(one)]  # nothing is there yet of one just begun
    rows = equipage.rows if "equipage" in runs[0] else campaign.rows
    rows = link_latency.rows if link_latency.LATENCY in runs[0] else rows
    for line in rows(runs):
        say(line)
    return 0


if __name__ == "__main__":
    with exit_plainly_on_signal():
        sys.exit(main())
