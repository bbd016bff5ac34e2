"""A run into a folder: recorded, summed up and drawn; there as a whole or not at all."""

import hashlib
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

from dsa_des.errors import OutputError
from dsa_des.files.output_file import write_file
from dsa_des.files.output_folder import OutputFolder
from dsa_des.files.toml_files import to_toml
from dsa_des.record.failure_counts import failure_sentences
from dsa_des.record.recording import Recorder
from dsa_des.record.run_folder import write_run_json
from dsa_des.record.sinks import ObserverSink, call_or_note
from dsa_des.record.table_metadata import metadata_of_run
from dsa_des.record.version import __version__
from dsa_des.running.pacing import Pacer
from dsa_des.running.reports import draw_all_reports, load_reports, notes_of_scene, warn_of_long_run
from dsa_des.running.simulation import Outcome, Simulation
from dsa_des.scene.scene import Scene
from dsa_des.terminal import terminal
from dsa_des.terminal.terminal import say
from dsa_des.text.safe_text import shorten

_VERSIONS_OF = ("numpy", "scipy", "simpy", "pyarrow")


def record_run(
    loaded: Scene,
    target: Path | OutputFolder,
    *,
    simulate_everything: bool = False,
    silent: bool = True,
    notes_command: str | None = None,
    pacer: Pacer | None = None,
    say_notes: bool = True,
    progress: Callable[[float], None] | None = None,
    draw: bool = True,
    prepare: Callable[[Simulation], None] | None = None,
    recorded_as: Scene | None = None,
) -> dict[str, Any]:
    """Run a checked scene into the folder `target` and return its summary.

    With `notes_command`, the command that shows what there is to note of the scene, one line on
    standard error says how many notes there are; ``run.json`` lists them. `progress` is called with
    the simulated time in s after each window, instead of a bar. `prepare` is called with the
    simulation before it runs: to listen to it, or to hand its blocks what no scene holds;
    `recorded_as` is then the scene that gives the same tables without. Raised are `UsageError` if
    the folder holds something other than a run, and `OutputError` if the results cannot be written.
    """
    if isinstance(target, Path):
        target = OutputFolder(target)
    target.check()
    recorder = Recorder([])
    simulation = Simulation(loaded, recorder=recorder, simulate_everything=simulate_everything)
    if prepare is not None:
        prepare(simulation)
    if say_notes:
        warn_of_long_run(simulation)
    noted = notes_of_scene(simulation)
    if noted and notes_command is not None:
        say(f"{len(noted)} note{'s' * (len(noted) > 1)}: {notes_command}", err=True)
    reports = load_reports()
    notes: list[str] = []
    observers = ObserverSink(
        (observer for report in reports for observer in report.observers(simulation)), notes
    )
    with target.write_then_rename() as folder:
        # Arrow takes longer to import than most scenes to check: not before all is well.
        from dsa_des.record.arrow import ParquetSink

        scene_text = to_toml((recorded_as or loaded).resolved())
        messages = simulation.recorded_message_types()
        said = metadata_of_run(messages, scene_text, loaded.seed, simulation.ticks_per_s)
        tables = ParquetSink(folder, said)
        recorder.sinks += [tables, observers]
        started = time.perf_counter()
        try:
            with _show_progress_bar(simulation, silent=silent) as bar:
                outcome = simulation.run(progress or bar, pacer)
        finally:
            tables.close_after_failure()
        summary = summarise_run(observers, outcome, target.path, notes)
        if pacer is not None:
            summary["realtime"] = pacer.report()
        write_file(folder / "scene.toml", scene_text.encode())
        wall_s = time.perf_counter() - started
        info = run_json_content(simulation, recorder, outcome, summary, scene_text, wall_s)
        if pacer is not None and pacer.stopped:
            info["duration_s"], info["stopped"] = pacer.time_s, True
        if noted or notes:
            info["notes"] = [*noted, *notes]
        write_run_json(folder, info)
    summary["out"] = str(target.path)
    # The run has its name: whatever happens while figures are drawn, it is not lost.
    try:
        if draw:
            notes += draw_all_reports(reports, simulation, target.path, summary)
        write_run_json(target.path, info)  # with the figures among its files
    except OSError as error:
        what = f"figures cannot be written: {error.strerror or error}"
        raise OutputError(f"{target.path}: {what}; the run itself is complete") from error
    for note in notes if say_notes else ():
        say(f"note: {note}; the run itself is complete in {target.path}", err=True)
    return summary


def summarise_run(
    observers: ObserverSink, outcome: Outcome, target: Path | None, notes: list[str]
) -> dict[str, Any]:
    """Return a run's summary: sections of observers, blocks; failures; simulated and CPU time."""
    return {
        **observers.result(),
        **(call_or_note("the summary of the blocks", notes, lambda: outcome.report) or {}),
        **({"undone": outcome.failure_counts} if failure_sentences(outcome.failure_counts) else {}),
        "simulated_s": outcome.duration_s,
        "cpu_s": outcome.cpu_s,
        "out": None if target is None else str(target),
    }


def run_json_content(
    simulation: Simulation,
    recorder: Recorder,
    outcome: Outcome,
    summary: dict[str, Any],
    scene_text: str,
    wall_s: float,
) -> dict[str, Any]:
    """Return the content of run.json; only ``timings`` may differ between two runs."""
    own = ("simulated_s", "cpu_s", "out", "realtime")
    sections = {key: value for key, value in summary.items() if key not in own}
    timings = {"cpu_s": outcome.cpu_s, "wall_s": wall_s}
    if "realtime" in summary:
        timings["realtime"] = summary["realtime"]
    return {
        "title": simulation.scene.title,
        "seed": simulation.scene.seed,
        "duration_s": outcome.duration_s,
        **({"ended_by": simulation.runs.ended_by[0]} if simulation.runs.early else {}),
        "ticks_per_s": simulation.ticks_per_s,
        "scene_sha256": hashlib.sha256(scene_text.encode()).hexdigest(),
        "versions": {
            "dsa_des": __version__,
            "python": sys.version.split()[0],
            **_library_versions(),
        },
        "look_ahead": outcome.windowed,
        "rows": recorder.rows,
        "summary": sections,
        "timings": timings,
    }


@cache
def _library_versions() -> dict[str, str]:
    """Return library → its installed version, read once per process."""
    return {name: version(name) for name in _VERSIONS_OF}


@contextmanager
def _show_progress_bar(
    simulation: Simulation, *, silent: bool
) -> Iterator[Callable[[float], None] | None]:
    """Show a progress bar if on a terminal; yield what moves it to a simulated time, s, or None."""
    if silent or not sys.stderr.isatty():
        yield None
        return
    with terminal.progress_bar("seconds") as bar:
        title = shorten(simulation.scene.title)
        task = bar.add_task(title, total=float(simulation.duration_s))
        yield lambda time_s: bar.update(task, completed=time_s)
