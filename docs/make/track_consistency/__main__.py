"""The command: the table of every case, or of some."""

import argparse
import sys

from docs.make.track_consistency.cases import CASES
from docs.make.track_consistency.nees import nees_of, summary
from dsa_des.terminal.interruption import exit_plainly_on_signal
from dsa_des.terminal.terminal import say


def main(arguments: list[str] | None = None) -> int:
    """Run the command and return its exit code."""
    parser = argparse.ArgumentParser(
        prog="python -m docs.make.track_consistency",
        description="Print the mean normalised error squared of tracks, with its bounds.",
    )
    parser.add_argument("cases", nargs="*", metavar="case", help=f"of {', '.join(CASES)}")
    parser.add_argument("--replicas", type=int, default=200)
    options = parser.parse_args(arguments)
    unknown = [name for name in options.cases if name not in CASES]
    if unknown:
        parser.error(f"no case {unknown[0]!r}; allowed: {', '.join(CASES)}")
    say(
        "| case | tracks | mean | 95 % bounds | instants | inside | single inside | median | lost |"
    )
    say("|---|---|---|---|---|---|---|---|---|")
    for name in options.cases or CASES:
        s = summary(nees_of(CASES[name], options.replicas))
        say(
            f"| {CASES[name].says} | {s['tracks']} | {s['mean']:.2f} | {s['low']:.2f} to "
            f"{s['high']:.2f} | {s['least']:.2f} to {s['most']:.2f} | {s['inside']:.0%} | "
            f"{s['share']:.1%} | {s['median']:.2f} | {s['lost']:.2%} |"
        )
    return 0


if __name__ == "__main__":
    with exit_plainly_on_signal():
        sys.exit(main())
