"""Running a scene from Python, in memory or into a folder."""

import os
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from dsa_des.errors import UsageError
from dsa_des.files.output_folder import OutputFolder
from dsa_des.files.toml_files import to_toml
from dsa_des.library.scenes import as_scene
from dsa_des.record.drawing import collect_drawn_figures
from dsa_des.record.recording import Recorder
from dsa_des.record.run_folder import Run, read_run
from dsa_des.record.sinks import MemorySink, ObserverSink
from dsa_des.record.table_metadata import metadata_of_run
from dsa_des.running.recorded_run import record_run, run_json_content, summarise_run
from dsa_des.running.reports import Report, draw_all_reports, load_reports, notes_of_scene
from dsa_des.running.simulation import Simulation
from dsa_des.scene.scene import Scene


def run(
    scene: Scene | str | os.PathLike[str] | Mapping[str, Any],
    *,
    out: str | os.PathLike[str] | None = None,
    simulate_everything: bool = False,
    progress: Callable[[float], None] | None = None,
) -> Run:
    """Run a scene to its end.

    Parameters
    ----------
    scene : Scene, or what `dsa_des.load_scene` takes
    out : path, optional
        Folder that the run is written into, as ``dsa-des run --out`` does; without, the run stays
        in memory.
    simulate_everything : bool
        Simulate also the effects that the scene does not call for, where they can be neutral.
    progress : callable, optional
        Called with the simulated time in s now and then.

    Returns
    -------
    Run
        Its tables are attributes: ``run.detections`` is a ``pyarrow.Table``. What the command line
        notes on standard error is in ``run.info["notes"]``.

    Raises
    ------
    SceneError
        With every problem of the scene.
    BlockFailure
        If a block raised an exception.
    UsageError, OutputError
        If the results cannot go into the folder.
    """
    loaded = as_scene(scene)
    if out is None:
        return _run_in_memory(loaded, simulate_everything, progress)
    target = OutputFolder.from_option(os.fspath(out), Path("runs"), loaded.path.stem)
    record_run(
        loaded,
        target,
        simulate_everything=simulate_everything,
        say_notes=False,
        progress=progress,
    )
    return read_run(target.path)


def _run_in_memory(
    scene: Scene, simulate_everything: bool, progress: Callable[[float], None] | None
) -> Run:
    tables = MemorySink()
    recorder = Recorder([tables])
    simulation = Simulation(scene, recorder=recorder, simulate_everything=simulate_everything)
    noted = notes_of_scene(simulation)
    reports = load_reports()
    notes: list[str] = []
    observers = ObserverSink(
        (observer for report in reports for observer in report.observers(simulation)), notes
    )
    recorder.sinks.append(observers)
    started = time.perf_counter()
    outcome = simulation.run(progress)
    summary = summarise_run(observers, outcome, None, notes)
    text = to_toml(scene.resolved())
    info = run_json_content(
        simulation, recorder, outcome, summary, text, time.perf_counter() - started
    )
    if noted or notes:
        info["notes"] = [*noted, *notes]
    said = metadata_of_run(
        simulation.recorded_message_types(), text, scene.seed, simulation.ticks_per_s
    )
    arrow = said.tables_with_metadata(tables.tables())
    return Run(
        None,
        info,
        arrow,
        text,
        lambda: _figures_of_run_in_memory(reports, simulation, arrow, summary),
    )


def _figures_of_run_in_memory(
    reports: list[Report], simulation: Simulation, tables: dict[str, Any], summary: dict[str, Any]
) -> dict[str, Any]:
    """Return report figures, by name, of a run in memory; its tables go to a temporary folder."""
    import pyarrow.parquet as pq

    with TemporaryDirectory(prefix="dsa_des-") as path:
        folder = Path(path)
        for name, table in tables.items():
            pq.write_table(table, folder / f"{name}.parquet")
        with collect_drawn_figures() as result:
            notes = draw_all_reports(reports, simulation, folder, summary)
    if notes and not result:
        raise UsageError("; ".join(notes))
    return dict(sorted(result.items()))
