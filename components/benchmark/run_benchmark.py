"""``dsa-des benchmark``: run every case in a process of its own, print and write the rows."""

import json
import subprocess
import sys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from components.benchmark.pairs import PAIRS, Pair
from components.benchmark.rates import RATES, Rate
from components.benchmark.scenes import BenchmarkCase, select_cases
from dsa_des.errors import OutputError, UsageError
from dsa_des.files.output_file import check_file_writable
from dsa_des.files.output_names import user_path
from dsa_des.record.run_folder import write_json
from dsa_des.terminal import terminal

# The thesis's run time for its scene, 3 s for 21,600 target-scans (errata 24).
_THESIS_PER_S = 7200.0
_LEGEND = (
    "M/s: million target-scans per s of CPU, building and running; x plain: times the plain loop; "
    "ms/s: CPU per simulated s; MB: peak memory; Parquet: CPU that writing it adds"
)


def run_benchmark(
    scenes: tuple[str, ...],
    quick: bool,
    repeats: int | None,
    json_file: str | None,
    compare: str | None,
    embed: bool,
) -> None:
    """Measure the named benchmark scenes, else all; print the tables and write rows where asked."""
    if embed and (scenes or compare):
        raise UsageError("--embed measures one thing of its own: leave out scenes and --compare")
    pairs = [pair for pair in PAIRS if not scenes or pair.name in scenes]
    rates = [rate for rate in RATES if not scenes or rate.name in scenes]
    others = {pair.name for pair in pairs} | {rate.name for rate in rates}
    names = [name for name in scenes if name not in others]
    cases = [] if scenes and not names else select_cases(names)
    before = {} if compare is None else _read_results(Path(compare))
    target = None if json_file is None else user_path(json_file, "--json")
    if target is not None:
        check_file_writable(target, "--json")
    console = terminal.console()
    asked = _Asked(console, quick, repeats or (2 if quick else 5))
    rows = _measure_and_print_call_times(asked) if embed else []
    if cases and not embed:
        rows += _measure_cases(asked, cases, before)
    if pairs and not embed:
        rows += _measure_pairs(asked, pairs)
    if rates and not embed:
        rows += _measure_rates(asked, rates)
    if target is not None:
        try:
            write_json(target, rows)
        except OSError as error:
            raise OutputError(f"--json {target}: cannot be written: {error.strerror}") from error
        console.print(f"rows written to {target}")


def measure_in_new_process(kind: str, name: str, quick: bool, repeats: int) -> dict[str, Any]:
    """Return the result row of one benchmark, measured in a new Python process."""
    # -P: no file of the working directory is imported.
    command = [sys.executable, "-P", "-m", "components.benchmark.measure", kind, name]
    command += [f"--repeats={repeats}", *(["--quick"] if quick else [])]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise UsageError(f"{' '.join(command[4:])} failed:", *done.stderr.strip().splitlines())
    row: dict[str, Any] = json.loads(done.stdout)
    return row


@dataclass(frozen=True)
class _Asked:
    """Options of a benchmark run, and the console to which it prints."""

    console: Any
    quick: bool
    repeats: int

    def measure_named(self, kind: str, things: Sequence[Any]) -> list[dict[str, Any]]:
        """Measure the named cases, printing each name first; return their rows."""
        rows = []
        for thing in things:
            self.console.print(f"{thing.name}: {thing.what} ...", style="dim")
            rows.append(measure_in_new_process(kind, thing.name, self.quick, self.repeats))
        return rows

    def print_table(
        self, headings: Sequence[str], lines: Iterable[Sequence[str]], apart: int = 1
    ) -> None:
        """Print a table with the first column, of text, flush left and all others flush right."""
        from rich.table import Table

        table = Table(box=None, padding=(0, apart, 0, 0))
        for number, heading in enumerate(headings):
            table.add_column(heading, justify="right" if number else "left", no_wrap=apart == 1)
        for line in lines:
            table.add_row(*line)
        self.console.print(table)


def _measure_cases(
    asked: _Asked, cases: list[BenchmarkCase], before: dict[str, Any]
) -> list[dict[str, Any]]:
    rows = asked.measure_named("scenes", cases)
    headings = ["scene", "M/s", "x plain", "wanted", "run s", "build s", "ms/s", "MB", "Parquet"]
    lines = []
    for case, row in zip(cases, rows, strict=True):
        lines.append([
            case.name,
            f"{row['target_scans_per_s'] / 1e6:.2f}",
            f"{row['ratio_to_yardstick']:.1f}",
            f"{case.wanted:g}",
            f"{row['cpu_s']:.3f}",
            f"{row['build_s']:.2f}",
            f"{row['cpu_ms_per_simulated_s']:.2f}",
            f"{row['peak_memory_mb']:.0f}",
            f"{row['parquet_adds']:+.0%}",
        ])  # fmt: skip
        if before:  # ratios to the yardstick survive a change of machine
            ratio = "ratio_to_yardstick"
            old = before.get(case.name)
            lines[-1].append("" if old is None else f"{row[ratio] / old[ratio]:.2f} x")
    asked.print_table([*headings, *(["since"] if before else [])], lines)
    asked.console.print(_LEGEND, style="dim", soft_wrap=True)
    for row in rows:
        if row["scene"] == "thesis":
            times = row["target_scans_per_s"] / _THESIS_PER_S
            asked.console.print(
                f"thesis scene: {times:.0f} times the thesis's own 7,200 target-scans/s"
            )
    return rows


def _measure_pairs(asked: _Asked, pairs: list[Pair]) -> list[dict[str, Any]]:
    rows = asked.measure_named("pairs", pairs)
    asked.print_table(
        ("what costs little", "times", "half of them", "at most"),
        [
            (pair.name, f"{row['times']:.3f}", "{:.3f}-{:.3f}".format(*row["times_quartiles"]),
             f"{pair.wanted:g}")
            for pair, row in zip(pairs, rows, strict=True)
        ],
    )  # fmt: skip
    asked.console.print("times: CPU of building and running, by that without it", style="dim")
    return rows


def _measure_rates(asked: _Asked, rates: list[Rate]) -> list[dict[str, Any]]:
    rows = asked.measure_named("rates", rates)
    asked.print_table(
        ("what is done often", "per s", "at least"),
        [
            (rate.name, f"{row['per_s']:,.0f}", f"{rate.wanted:,.0f}")
            for rate, row in zip(rates, rows, strict=True)
        ],
    )
    asked.console.print("per s of CPU, on one core", style="dim")
    for row in rows:
        for name, per_s in row["beside"].items():
            asked.console.print(
                f"{row['scene']}: {row['per_s'] / per_s:,.0f} times the {per_s:,.0f}/s of {name} "
                "on the same detections", soft_wrap=True,
            )  # fmt: skip
        if shares := row["shares"]:
            said = ", ".join(f"{name} {share:.0%}" for name, share in shares.items())
            rest = 1.0 - sum(shares.values())
            asked.console.print(
                f"{row['scene']}: {said}, making and measuring runs {rest:.0%}", soft_wrap=True
            )
    return rows


def _measure_and_print_call_times(asked: _Asked) -> list[dict[str, Any]]:
    row = measure_in_new_process("calls", "embed", asked.quick, asked.repeats)
    asked.console.print(f"simulate: {row['what']}; {row['calls']} calls", soft_wrap=True)
    names = {
        "wall_us": "wall time",
        "cpu_us": "processor time",
        "undisturbed_us": "wall time, best of each call's repetitions",
        "fixed_us": "fixed work: the machine's own spread",
    }
    lines = []
    for key, name in names.items():
        p50, p99, most = (f"{row[key][end]:.0f}" for end in ("p50", "p99", "max"))
        first = f"{row['first_us']:.0f}" if key == "wall_us" else ""
        wanted = "" if key in ("cpu_us", "fixed_us") else f"{row['wanted_p99_us']:.0f}"
        lines.append((name, p50, p99, wanted, most, first))
    asked.print_table(("us per call", "p50", "p99", "wanted", "max", "first"), lines, apart=2)
    wanted_ms = row["wanted_p99_us"] / 1000.0
    share = row["share_within_wanted"]
    asked.console.print(f"{share:.1%} of the calls within {wanted_ms:g} ms of wall time")
    return [row]


def _read_results(path: Path) -> dict[str, dict[str, Any]]:
    try:
        rows = json.loads(path.read_text(encoding="utf-8"))
        return {row["scene"]: row for row in rows}
    except OSError as error:
        raise UsageError(f"--compare {path}: {error.strerror}") from error
    except (ValueError, TypeError, KeyError) as error:
        raise UsageError(f"--compare {path}: not the rows of a benchmark ({error})") from error
