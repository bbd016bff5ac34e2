"""``dsa-des run``: run a scene, record it, sum it up and draw it."""

from pathlib import Path

from dsa_des.commands.loading import load
from dsa_des.files.output_folder import OutputFolder
from dsa_des.running.pacing import Pacer, parse_factor
from dsa_des.running.recorded_run import record_run
from dsa_des.running.reports import load_reports
from dsa_des.terminal import terminal
from dsa_des.terminal.terminal import say_json


def run_scene(
    scene: str,
    sets: tuple[str, ...],
    swaps: tuple[str, ...],
    seed: int | None,
    duration: str | None,
    out: str | None,
    quiet: bool,
    as_json: bool,
    simulate_everything: bool,
    realtime: str | None,
    no_figures: bool,
) -> None:
    """Run a scene into a folder, then print its summary."""
    pacer = None if realtime is None else Pacer(parse_factor(realtime))
    loaded = load(scene, sets, swaps, seed, duration, quiet)
    target = OutputFolder.chosen(out, Path("runs"), loaded.path.stem)
    summary = record_run(
        loaded,
        target,
        simulate_everything=simulate_everything,
        silent=quiet or as_json,
        warn=not quiet,
        pacer=pacer,
        draw=not no_figures,
    )
    if as_json:
        say_json(summary)
    elif not quiet:
        console = terminal.console()
        for report in load_reports():
            report.show(console, summary)
        if pacer is not None:
            console.print(pacer.sentence(), soft_wrap=True)
