"""``python -m components.benchmark.measure KIND NAME``: measure one thing, print a JSON object.

The command starts it anew for every thing, so that peak memory is that thing's own and nothing is
warm from another.
"""

import argparse
import os
import sys
from typing import Any

from dsa_des.terminal.terminal import say_json

KINDS = ("scenes", "pairs", "rates", "calls")


def main(arguments: list[str] | None = None) -> int:
    """Run one benchmark case and print its result."""
    parser = argparse.ArgumentParser(prog="python -m components.benchmark.measure")
    parser.add_argument("kind", choices=KINDS)
    parser.add_argument("name")
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--repeats", type=int, default=5)
    options = parser.parse_args(arguments)
    if options.kind != "calls":  # a host has all of its machine
        pin_to_one_processor()
    say_json(_measure_by_kind(options.kind, options.name, options.quick, options.repeats))
    return 0


def _measure_by_kind(kind: str, name: str, quick: bool, repeats: int) -> dict[str, Any]:
    """Return one benchmark's row, importing only what its kind needs, so that memory is its own."""
    if kind == "scenes":
        from components.benchmark import scenes

        return scenes.measure_scene(name, quick, repeats)
    if kind == "rates":
        from components.benchmark import rates

        return rates.measure_rate(name, quick, repeats)
    if kind == "calls":
        from components.benchmark import call_times

        return call_times.measure_calls(300 if quick else 1800, repeats)
    from components.benchmark import pairs

    return pairs.measure_pairs(name, quick, repeats)


def pin_to_one_processor() -> None:
    """Keep this process on one processor, where the system can."""
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})


if __name__ == "__main__":
    sys.exit(main())
