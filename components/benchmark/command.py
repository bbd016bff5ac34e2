"""``dsa-des benchmark``: run every case in a process of its own, print and write the rows."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

from components.benchmark.cases import BenchmarkCase, chosen
from components.benchmark.pairs import PAIRS, Pair
from components.benchmark.rates import RATES, Rate
from dsa_des.errors import OutputError, UsageError
from dsa_des.files.output_file import check_file
from dsa_des.files.output_names import named
from dsa_des.record.run_folder import write_json
from dsa_des.terminal import terminal

# The thesis's run time for its scene, 3 s for 21,600 target-scans (errata 24).
_THESIS_PER_S = 7200.0


def run_benchmark(
    scenes: tuple[str, ...],
    quick: bool,
    repeats: int | None,
    json_file: str | None,
    compare: str | None,
    embed: bool,
) -> None:
    """Measure the cases; without names, all of them."""
    if embed and (scenes or compare):
        raise UsageError("--embed measures one thing of its own: leave out scenes and --compare")
    pairs = [] if embed else [pair for pair in PAIRS if not scenes or pair.name in scenes]
    rates = [] if embed else [rate for rate in RATES if not scenes or rate.name in scenes]
    others = {pair.name for pair in pairs} | {rate.name for rate in rates}
    names = [name for name in scenes if name not in others]
    cases = [] if embed or (scenes and not names) else chosen(names)
    before = {} if compare is None else _read(Path(compare))
    target = None if json_file is None else named(json_file, "--json")
    if target is not None:
        check_file(target, "--json")
    console = terminal.console()
    rows: list[dict[str, Any]] = []
    if embed:
        rows.append(_measured_calls(quick, repeats or (2 if quick else 5)))
        what, calls = rows[0]["what"], rows[0]["calls"]
        console.print(f"simulate: {what}; {calls} calls", soft_wrap=True)
        console.print(_calls_table(rows[0]))
        share = rows[0]["share_within_wanted"]
        wanted_ms = rows[0]["wanted_p99_us"] / 1000.0
        console.print(f"{share:.1%} of the calls within {wanted_ms:g} ms of wall time")
    else:
        if cases:
            rows += _measured_cases(console, cases, quick, repeats, before)
        if pairs:
            rows += _measured_pairs(console, pairs, quick, repeats)
        if rates:
            rows += _measured_rates(console, rates, quick, repeats)
    if target is not None:
        try:
            write_json(target, rows)
        except OSError as error:
            raise OutputError(f"--json {target}: cannot be written: {error.strerror}") from error
        console.print(f"rows written to {target}")


_LEGEND = (
    "M/s: million target-scans per s of CPU, building and running; x plain: times the plain loop; "
    "ms/s: CPU per simulated s; MB: peak memory; Parquet: CPU that writing it adds"
)


def _measured_cases(
    console: Any,
    cases: list[BenchmarkCase],
    quick: bool,
    repeats: int | None,
    before: dict[str, Any],
) -> list[dict[str, Any]]:
    rows = []
    for case in cases:
        console.print(f"{case.name}: {case.what} ...", style="dim")
        rows.append(_measured(case, quick, repeats or (2 if quick else 5)))
    console.print(_table(cases, rows, before))
    console.print(_LEGEND, style="dim", soft_wrap=True)
    thesis = [row for row in rows if row["scene"] == "thesis"]
    for row in thesis:
        times = row["target_scans_per_s"] / _THESIS_PER_S
        console.print(f"thesis scene: {times:.0f} times the thesis's own 7,200 target-scans/s")
    return rows


def _measured_pairs(
    console: Any, pairs: list[Pair], quick: bool, repeats: int | None
) -> list[dict[str, Any]]:
    from rich.table import Table

    table = Table(box=None, padding=(0, 1, 0, 0))
    for heading in ("what costs little", "times", "half of them", "at most"):
        justify: Any = "left" if heading == "what costs little" else "right"
        table.add_column(heading, justify=justify, no_wrap=True)
    rows = []
    for pair in pairs:
        console.print(f"{pair.name}: {pair.what} ...", style="dim")
        options = [f"--repeats={repeats or (2 if quick else 5)}", *(["--quick"] if quick else [])]
        row = fresh("pairs", [pair.name, *options])
        low, high = row["times_quartiles"]
        table.add_row(pair.name, f"{row['times']:.3f}", f"{low:.3f}-{high:.3f}", f"{pair.wanted:g}")
        rows.append(row)
    console.print(table)
    console.print("times: CPU of building and running, by that without it", style="dim")
    return rows


def _measured_rates(
    console: Any, rates: list[Rate], quick: bool, repeats: int | None
) -> list[dict[str, Any]]:
    from rich.table import Table

    table = Table(box=None, padding=(0, 1, 0, 0))
    for heading in ("what is done often", "per s", "at least"):
        justify: Any = "left" if heading == "what is done often" else "right"
        table.add_column(heading, justify=justify, no_wrap=True)
    rows = []
    for rate in rates:
        console.print(f"{rate.name}: {rate.what} ...", style="dim")
        options = [f"--repeats={repeats or (2 if quick else 5)}", *(["--quick"] if quick else [])]
        row = fresh("rates", [rate.name, *options])
        table.add_row(rate.name, f"{row['per_s']:,.0f}", f"{rate.wanted:,.0f}")
        rows.append(row)
    console.print(table)
    console.print("per s of CPU, on one core", style="dim")
    for row in rows:
        for name, per_s in row["beside"].items():
            console.print(
                f"{row['scene']}: {row['per_s'] / per_s:,.0f} times the {per_s:,.0f}/s of {name} "
                "on the same detections", soft_wrap=True,
            )  # fmt: skip
    return rows


def _measured(case: BenchmarkCase, quick: bool, repeats: int) -> dict[str, Any]:
    """Measure times and memory in a fresh process."""
    options = [f"--repeats={repeats}", *(["--quick"] if quick else [])]
    return fresh("measure", [case.name, *options])


def _measured_calls(quick: bool, repeats: int) -> dict[str, Any]:
    """Measure calls of the embedding interface in a fresh process."""
    return fresh("embedded", [f"--repeats={repeats}", f"--calls={300 if quick else 1800}"])


def fresh(module: str, arguments: list[str]) -> dict[str, Any]:
    """Return what a measuring module prints in a process of its own."""
    # -P: no file of the working directory is imported.
    command = [sys.executable, "-P", "-m", f"components.benchmark.{module}", *arguments]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise UsageError(f"{' '.join(arguments)} failed:", *done.stderr.strip().splitlines())
    row: dict[str, Any] = json.loads(done.stdout)
    return row


def _calls_table(row: dict[str, Any]) -> Any:
    from rich.table import Table

    table = Table(box=None, padding=(0, 2, 0, 0))
    for heading in ("us per call", "p50", "p99", "wanted", "max", "first"):
        table.add_column(heading, justify="left" if heading == "us per call" else "right")
    names = {
        "wall_us": "wall time",
        "cpu_us": "processor time",
        "undisturbed_us": "wall time, best of each call's repetitions",
        "fixed_us": "fixed work: the machine's own spread",
    }
    for key, name in names.items():
        p50, p99, most = (f"{row[key][end]:.0f}" for end in ("p50", "p99", "max"))
        first = f"{row['first_us']:.0f}" if key == "wall_us" else ""
        wanted = "" if key in ("cpu_us", "fixed_us") else f"{row['wanted_p99_us']:.0f}"
        table.add_row(name, p50, p99, wanted, most, first)
    return table


def _read(path: Path) -> dict[str, dict[str, Any]]:
    try:
        rows = json.loads(path.read_text(encoding="utf-8"))
        return {row["scene"]: row for row in rows}
    except OSError as error:
        raise UsageError(f"--compare {path}: {error.strerror}") from error
    except (ValueError, TypeError, KeyError) as error:
        raise UsageError(f"--compare {path}: not the rows of a benchmark ({error})") from error


def _table(cases: list[BenchmarkCase], rows: list[dict[str, Any]], before: dict[str, Any]) -> Any:
    from rich.table import Table

    table = Table(box=None, padding=(0, 1, 0, 0))
    headings = ["scene", "M/s", "x plain", "wanted", "run s", "build s", "ms/s", "MB", "Parquet"]
    for heading in [*headings, *(["since"] if before else [])]:
        justify: Any = "left" if heading == "scene" else "right"
        table.add_column(heading, justify=justify, no_wrap=True)
    for case, row in zip(cases, rows, strict=True):
        cells = [
            case.name,
            f"{row['target_scans_per_s'] / 1e6:.2f}",
            f"{row['ratio_to_yardstick']:.1f}",
            f"{case.wanted:g}",
            f"{row['cpu_s']:.3f}",
            f"{row['build_s']:.2f}",
            f"{row['cpu_ms_per_simulated_s']:.2f}",
            f"{row['peak_memory_mb']:.0f}",
            f"{row['parquet_adds']:+.0%}",
        ]
        if before:
            old = before.get(case.name)
            cells.append("" if old is None else _change(row, old))
        table.add_row(*cells)
    return table


def _change(row: dict[str, Any], old: dict[str, Any]) -> str:
    """Compare ratios to the yardstick, which survive a change of machine."""
    return f"{row['ratio_to_yardstick'] / old['ratio_to_yardstick']:.2f} x"
