"""``python -m components.numerics``: print docs/numerics.md, or check that it is up to date."""

import argparse
import sys
from pathlib import Path

from components.numerics.document import PAGE, differences, markdown
from dsa_des.interruption import plain_ending
from dsa_des.terminal import say, say_lines


def main(arguments: list[str] | None = None) -> int:
    """Run the command and return its exit code: 1 when the page differs, 2 when it cannot run."""
    parser = argparse.ArgumentParser(
        prog="python -m components.numerics",
        description="Compute the hard cases of docs/numerics.md and print the page.",
    )
    parser.add_argument(
        "--check",
        action="store_true",
        help="print nothing but what differs between the page and our results; exit code 1 then",
    )
    parser.add_argument("--page", type=Path, default=PAGE, help="the page to check")
    options = parser.parse_args(arguments)
    try:
        if not options.check:
            say_lines(markdown().removesuffix("\n"))
            return 0
        found = differences(options.page.read_text(encoding="utf-8"))
    except (ImportError, OSError) as error:
        say(error, err=True)
        return 2
    for line in found:
        say(line)
    return 1 if found else 0


if __name__ == "__main__":
    with plain_ending():
        sys.exit(main())
