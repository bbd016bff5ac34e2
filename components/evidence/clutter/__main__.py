"""``python -m components.evidence.clutter docs/clutter.md``: make the page and its figure."""

import argparse
import sys
from pathlib import Path

from components.evidence.clutter.page import page
from dsa_des.files.output_file import write_file
from dsa_des.terminal.interruption import plain_ending


def main(arguments: list[str] | None = None) -> int:
    """Run the command and return its exit code."""
    parser = argparse.ArgumentParser(
        prog="python -m components.evidence.clutter",
        description="Run scenes with clutter and write their page; the figure goes to images/.",
    )
    parser.add_argument("page", type=Path)
    target = parser.parse_args(arguments).page
    write_file(target, page(target.parent / "images").encode())
    return 0


if __name__ == "__main__":
    with plain_ending():
        sys.exit(main())
