"""Running a case in a process of its own, forked from one that has imported everything.

A case of a few milliseconds then takes no second of imports, and one that hangs or eats memory is
ended without harm to the others.
"""

import contextlib
import json
import os
import re
import resource
import shutil
import signal
import sys
import tempfile
import time
import traceback
from pathlib import Path

from fuzz_cases import Case

#: Longest time a case may take, s of processor time; ten times that on the wall.
LIMIT_S = 20.0
_MEMORY_BYTES = 6 * 2**30
# All control characters but tab and line feed: C0, DEL and C1.
_CONTROL = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f]")
_LONGEST_MESSAGE = 30_000


def judge(case: Case, limit_s: float = LIMIT_S) -> tuple[int | None, list[str]]:
    """Run a case; return its exit code, and what is wrong with how it ended: nothing, mostly."""
    home = Path(tempfile.mkdtemp(prefix="fuzz-"))
    try:
        work = home / "work"
        work.mkdir()
        case.put(work)
        before = {path.name for path in work.iterdir()}
        code = _run(case, home, limit_s)
        out = (home / "out").read_text(errors="surrogateescape")
        error = (home / "err").read_text(errors="surrogateescape")
        left = {path.name for path in work.iterdir()} - before - {"__pycache__", "runs", "studies"}
        return code, _faults(case, code, out, error, left)
    finally:
        shutil.rmtree(home, ignore_errors=True)


def _faults(case: Case, code: int | None, out: str, error: str, left: set[str]) -> list[str]:
    found = []
    if code is None:
        # A long run is no fault where it was said to be one.
        return [] if re.search(r"^note: .* scans$", error, re.MULTILINE) else ["hang"]
    if "Traceback (most recent call last)" in error + out:
        found.append("traceback: " + error.strip().splitlines()[-1][:150])
    if "Warning: " in error:
        line = next(line for line in error.splitlines() if "Warning: " in line)
        found.append(f"warning: {line[:150]}")
    if code not in (0, 1, 2):
        found.append(f"exit code {code}")
    if code == 1:
        found.append(f"exit code 1: {error.strip()[:250]}")
    if code == 2 and "rror:" not in error:
        found.append(f"exit code 2 without a message: {error[:100]!r}")
    if code == 2 and left:
        found.append(f"left {sorted(left)}")
    if raw := _CONTROL.search(out + error):
        found.append(f"control character {raw[0]!r}")
    if len(error) > _LONGEST_MESSAGE:
        found.append(f"a message of {len(error)} characters")
    if code == 0 and "--json" in case.argv:
        try:
            json.loads(out, parse_constant=_refuse_constant)
        except ValueError as problem:
            found.append(f"JSON: {problem}")
    return found


def _refuse_constant(name: str) -> None:
    raise ValueError(f"{name} is no JSON")


def _run(case: Case, home: Path, limit_s: float) -> int | None:
    """Return the exit code, or None when the case took too long."""
    child = os.fork()
    if child == 0:
        _be_the_case(case, home, limit_s)
    deadline = time.monotonic() + 10.0 * limit_s
    pause = 0.002
    while True:
        done, status = os.waitpid(child, os.WNOHANG)
        if done:
            break
        if time.monotonic() > deadline:
            os.killpg(child, signal.SIGKILL)
            os.waitpid(child, 0)
            return None
        time.sleep(pause)
        pause = min(0.05, 1.5 * pause)
    if os.WIFSIGNALED(status):
        return None if os.WTERMSIG(status) in (signal.SIGXCPU, signal.SIGKILL) else 128
    return os.WEXITSTATUS(status)


def _be_the_case(case: Case, home: Path, limit_s: float) -> None:
    """Become the process of the case; never return."""
    code = 1
    try:
        os.setpgid(0, 0)
        os.chdir(home / "work")
        os.environ["HOME"] = str(home)
        for number, name in ((0, os.devnull), (1, home / "out"), (2, home / "err")):
            flags = os.O_RDONLY if number == 0 else os.O_WRONLY | os.O_CREAT | os.O_TRUNC
            os.dup2(os.open(name, flags, 0o600), number)
        sys.stdin, sys.stdout, sys.stderr = (
            open(number, mode, encoding="utf-8", errors="surrogateescape", closefd=False)  # noqa: SIM115
            for number, mode in ((0, "r"), (1, "w"), (2, "w"))
        )
        seconds = int(limit_s)
        resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds + 1))
        resource.setrlimit(resource.RLIMIT_AS, (_MEMORY_BYTES, _MEMORY_BYTES))
        code = _call(case.argv)
    except SystemExit as leaving:
        code = leaving.code if isinstance(leaving.code, int) else 1
    except BaseException:
        traceback.print_exc()
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)


def _call(argv: list[str]) -> int:
    import warnings

    warnings.resetwarnings()
    warnings.simplefilter("default")
    warnings.simplefilter("ignore", DeprecationWarning)
    if argv[0] == "simulate":
        _simulate(argv[1:])
    elif argv[0] == "compare-silhouettes":
        from components.thesis.silhouette_comparison import main as compare

        return compare(argv[1:])
    else:
        from dsa_des.cli import main

        main(args=argv, prog_name="dsa-des")
    return 0


def _simulate(argv: list[str]) -> None:
    """Run a scene with all that a run does but its folder and its figures."""
    import click

    from dsa_des.commands.group import plain_errors, scene_options

    @click.command()
    @scene_options()
    @plain_errors
    def command(scene: str, sets: tuple[str, ...], swaps: tuple[str, ...], **options: str) -> None:
        from dsa_des.commands.scene import load_scene_printing_notes
        from dsa_des.files.toml_files import to_toml
        from dsa_des.record.recording import Recorder
        from dsa_des.record.sinks import MemorySink, ObserverSink
        from dsa_des.running.reports import load_reports, warn_of_long_run
        from dsa_des.running.simulation import Simulation
        from dsa_des.text.plain_json import json_text

        loaded = load_scene_printing_notes(scene, sets, swaps, options["seed"], options["duration"])  # type: ignore[arg-type]
        recorder = Recorder([MemorySink()])
        simulation = Simulation(loaded, recorder=recorder)
        warn_of_long_run(simulation)
        observers = ObserverSink(
            o for report in load_reports() for o in report.observers(simulation)
        )
        recorder.sinks.append(observers)
        outcome = simulation.run()
        click.echo(len(json_text({**observers.result(), **outcome.report})))
        click.echo(len(to_toml(loaded.resolved())))

    command(args=argv, prog_name="simulate")


def import_everything() -> None:
    """Import what cases need, once, before any is forked."""
    import importlib

    for module in ("scene", "graph", "study"):
        importlib.import_module(f"dsa_des.commands.{module}")
    for module in (
        "dsa_des.record.arrow", "dsa_des.results.tables", "dsa_des.results.figures", "rich.console",
        "rich.table", "rich.progress", "matplotlib.figure", "matplotlib.backends.backend_agg",
        "scipy.special", "scipy.stats", "components.display.plan", "trimesh",
        "components.thesis.silhouette_comparison", "components.optical.mesh",
        "components.encounters.convert_command", "components.encounters.show_command",
        "components.encounters.risk_table", "components.encounters.generate_command",
        "components.encounters.split_command", "components.export.export_formats", "scipy.io",
        "components.view.run_picture", "pyarrow.parquet", "pyarrow.csv",
    ):  # fmt: skip
        with contextlib.suppress(ImportError):
            importlib.import_module(module)
    from fuzz_scenes import known_keys

    known_keys()
