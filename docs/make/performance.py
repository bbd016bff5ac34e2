"""``python -m docs.make.performance docs``: all tables of the page, measured anew.

Every table of ``docs/performance.md`` stands between two comments that name it. They are measured
one after the other, each in processes of its own, and kept in ``performance.json`` beside the page
with the commit; ``--from-json`` writes the tables of that file again. The machine must be idle.
"""

import argparse
import os
import platform
import re
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from components.benchmark.pairs import PAIRS
from components.benchmark.rates import RATES
from components.benchmark.run_benchmark import measure_in_new_process
from components.benchmark.scenes import CASES
from docs.make import performance_growth, performance_queues
from docs.make.performance_queues import VARIANTS
from dsa_des.files.input_files import read_input_text
from dsa_des.files.output_file import write_file
from dsa_des.record.run_folder import write_json
from dsa_des.terminal.interruption import exit_plainly_on_signal
from dsa_des.terminal.terminal import say

PAGE, ROWS = "performance.md", "performance.json"
_BLOCK = "<!-- {name} -->\n{body}\n<!-- end of {name} -->"
_TRACKS = ("track_updates", "track_updates_alone")
_RATES = ("pair_alerts", "bands")
_ENCOUNTERS = ("replicas", "replicas_all", "flights", "loop", "risk", "risk_tracked")


def commit() -> str:
    """Return the commit that this code is of, and whether it was changed since."""
    root = Path(__file__).parents[2]

    def git(*words: str) -> str:
        done = subprocess.run(
            ["git", *words], cwd=root, capture_output=True, text=True, check=False
        )
        return done.stdout.strip()

    changed = git("status", "--porcelain", "--untracked-files=no")
    return (git("rev-parse", "--short", "HEAD") or "unknown") + (" and changes" if changed else "")


def measured(repeats: int, quick: bool) -> dict[str, Any]:
    """Measure everything and return the rows by kind."""
    started = time.monotonic()
    found: dict[str, Any] = {
        "commit": commit(),
        "date": datetime.now(UTC).date().isoformat(),
        "python": platform.python_version(),
        "numpy": np.__version__,
        "processors": os.cpu_count(),
        "load": os.getloadavg()[0] if hasattr(os, "getloadavg") else None,
        "repeats": repeats,
    }
    kinds: dict[str, tuple[Any, ...]] = {"scenes": CASES, "pairs": PAIRS, "rates": RATES}
    for kind, items in kinds.items():
        # The scenes' rows have been kept under another name from the first on.
        rows = found["cases" if kind == "scenes" else kind] = {}
        for item in items:
            say(f"{time.monotonic() - started:4.0f} s: {item.name}", err=True)
            rows[item.name] = measure_in_new_process(kind, item.name, quick, repeats)
    found["queues"] = {
        one.name: performance_queues.measure_in_new_process(one.name, quick, repeats)
        for one in VARIANTS
    }
    found["calls"] = measure_in_new_process("calls", "embed", quick, repeats)
    found["took_s"] = round(time.monotonic() - started)
    return found


def _table(headings: str, rows: list[list[str]]) -> str:
    names = headings.split("|")
    lines = [f"| {' | '.join(name.strip() for name in names)} |", "|" + "---|" * len(names)]
    return "\n".join([*lines, *(f"| {' | '.join(row)} |" for row in rows)])


def _when(rows: Mapping[str, Any]) -> str:
    return (
        f"Measured at commit {rows['commit']} on {rows['date']}, in one go of {rows['took_s']:,} s "
        f"(medians of {rows['repeats']}, pinned to one of {rows['processors']} processors; "
        f"Python {rows['python']}, NumPy {rows['numpy']}):"
    )


def _scenes(rows: Mapping[str, Any]) -> str:
    return _table(
        "scene | target-scans/s | × yardstick | wanted | build | run | peak memory | Parquet adds",
        [
            [
                f"`{case.name}`: {case.what}",
                f"{row['target_scans_per_s'] / 1e6:.2g} M",
                f"{row['ratio_to_yardstick']:.1f}",
                f"{case.wanted:g}",
                f"{row['build_s']:.2f} s",
                f"{row['cpu_s']:.3f} s",
                f"{row['peak_memory_mb']:.0f} MB",
                f"{100 * row['parquet_adds']:.0f} %",
            ]
            for case, row in ((case, rows["cases"][case.name]) for case in CASES)
        ],
    )


def _pairs(rows: Mapping[str, Any]) -> str:
    return _table(
        "pair | times | half of the pairs | at most",
        [
            [pair.what, f"{row['times']:.3f}", "{:.3f} to {:.3f}".format(*row["times_quartiles"]),
             f"{pair.wanted:g}"]
            for pair, row in ((pair, rows["pairs"][pair.name]) for pair in PAIRS)
        ],
    )  # fmt: skip


def _rate_rows(names: tuple[str, ...], cell: Callable[[Any], list[str]]) -> Any:
    def rows_of(rows: Mapping[str, Any]) -> list[list[str]]:
        by_name = {rate.name: rate for rate in RATES}
        return [[f"`{n}`: {by_name[n].what}", *cell(rows["rates"][n])] for n in names]

    return rows_of


def _rates(rows: Mapping[str, Any]) -> str:
    cells = _rate_rows(_RATES, lambda row: [f"{row['per_s']:,.0f}", f"{row['wanted']:,.0f}"])
    return _table("rate | per s of CPU | wanted", cells(rows))


def _tracks(rows: Mapping[str, Any]) -> str:
    def cell(row: Mapping[str, Any]) -> list[str]:
        others = (row["beside"].get(name) for name in ("a plain loop", "Stone Soup"))
        return [f"{row['per_s']:,.0f}", *(
            "" if per_s is None else f"{per_s:,.0f} ({row['per_s'] / per_s:,.0f} times)"
            for per_s in others
        )]  # fmt: skip

    return _table("updates per s of CPU | ours | plain loop | Stone Soup",
                  _rate_rows(_TRACKS, cell)(rows))  # fmt: skip


def _encounters(rows: Mapping[str, Any]) -> str:
    def cell(row: Mapping[str, Any]) -> list[str]:
        return [f"{1000 / row['per_s']:.2f} ms", f"{1000 / row['wanted']:.2g} ms"]

    return _table("work | CPU each | wanted", _rate_rows(_ENCOUNTERS, cell)(rows))


def _queues(rows: Mapping[str, Any]) -> str:
    first = rows["queues"][VARIANTS[0].name]["simulated_s_per_s"]
    return _table(
        "shared processor | simulated s per s of CPU | times",
        [
            [v.what, f"{per_s:,.0f}", f"{first / per_s:.1f}"]
            for v, per_s in ((v, rows["queues"][v.name]["simulated_s_per_s"]) for v in VARIANTS)
        ],
    )


def _calls(rows: Mapping[str, Any]) -> str:
    names = {"wall_us": "wall time of a call", "undisturbed_us": "best of its repetitions",
             "fixed_us": "fixed work between the calls"}  # fmt: skip
    row = rows["calls"]
    return _table(
        "ms | median | 99th percentile",
        [
            [what, f"{row[key]['p50'] / 1000:.2f}", f"{row[key]['p99'] / 1000:.2f}"]
            for key, what in names.items()
        ],
    )


TABLES: dict[str, Callable[[Mapping[str, Any]], str]] = {
    "measured": _when, "scenes": _scenes, "pairs": _pairs, "rates": _rates, "queues": _queues,
    "track updates": _tracks, "encounters": _encounters, "calls": _calls,
}  # fmt: skip


def filled(page: str, rows: Mapping[str, Any]) -> str:
    """Return the page with every table made of the rows."""
    for name, make in TABLES.items():
        block = re.compile(_BLOCK.format(name=name, body=".*?"), re.DOTALL)
        text = _BLOCK.format(name=name, body=make(rows))
        page, count = block.subn(lambda _, text=text: text, page)  # type: ignore[misc]
        if count != 1:
            raise ValueError(f"the page has {count} tables {name!r}: one is needed")
    return page


def main(arguments: list[str] | None = None) -> int:
    """Measure, and write rows and page."""
    parser = argparse.ArgumentParser(prog="python -m docs.make.performance")
    parser.add_argument("folder", type=Path, help="that of performance.md")
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--quick", action="store_true", help="only to try the command")
    parser.add_argument("--from-json", action="store_true")
    options = parser.parse_args(arguments)
    page, file = options.folder / PAGE, options.folder / ROWS
    if options.from_json:
        import json

        rows = json.loads(read_input_text(file))
    else:
        rows = measured(options.repeats, options.quick)
        write_json(file, rows)
        performance_growth.main([str(options.folder / "images")])
    write_file(page, filled(read_input_text(page), rows).encode("utf-8"))
    say(f"{page} and {file} written: commit {rows['commit']}, {rows['took_s']} s")
    return 0


if __name__ == "__main__":
    with exit_plainly_on_signal():
        sys.exit(main())
