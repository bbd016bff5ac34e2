"""``dsa-des run``, ``check`` and ``explain``: one scene run, checked, and its effects listed."""

import gc
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any, TypedDict, Unpack

from dsa_des.block.shadowed_packages import Foreign, Imports, import_policy
from dsa_des.commands.grouping import check_window_independence
from dsa_des.files.output_folder import OutputFolder
from dsa_des.running.effects import Planned
from dsa_des.running.pacing import Pacer, parse_factor
from dsa_des.running.recorded_run import record_run
from dsa_des.running.reports import (
    load_reports,
    notes_of_loading,
    notes_of_scene,
    print_notes,
    warn_of_long_run,
)
from dsa_des.running.simulation import Simulation
from dsa_des.scene.data_files import scene_from_data_file
from dsa_des.scene.examples import find_input_file
from dsa_des.scene.scene import Scene, load_scene, scene_from_tables
from dsa_des.scene.scene_file import read_scene_tables
from dsa_des.terminal import terminal
from dsa_des.terminal.tables import print_table
from dsa_des.terminal.terminal import say, say_json
from dsa_des.text.safe_text import shell_line, shorten


class SceneOptions(TypedDict):
    """What `scene_options` adds to a command."""

    scene: str
    sets: tuple[str, ...]
    swaps: tuple[str, ...]
    seed: int | None
    duration: str | None


def load_scene_printing_notes(
    scene: str,
    sets: Iterable[str],
    swaps: Iterable[str],
    seed: int | None,
    duration: str | None,
    noted: bool = False,
) -> Scene:
    """Load and check a scene; print notes on standard error unless `noted` defers that."""
    path = find_input_file(scene, "scene")
    data = scene_from_data_file(path)
    if data is None:
        loaded = load_scene(path, sets=sets, swaps=swaps, seed=seed, duration_s=duration)
    else:
        file = read_scene_tables(data.tables, path.name)
        loaded = scene_from_tables(file, sets, swaps, seed, duration)
        loaded.about = data.about
    if not noted:
        print_notes(notes_of_loading(loaded))
    return loaded


def text_of_check_command(
    scene: str,
    sets: Iterable[str],
    swaps: Iterable[str],
    seed: int | None,
    duration: str | None,
) -> str:
    """Return the shell line ``dsa-des check ...`` that shows the notes on a scene."""
    words = ["dsa-des", "check", scene]
    for option, values in (("--set", sets), ("--swap", swaps)):
        for value in values:
            words += [option, value]
    words += [] if seed is None else ["--seed", str(seed)]
    words += [] if duration is None else ["--duration", duration]
    return shell_line(words)


def run_scene(
    out: str | None,
    quiet: bool,
    as_json: bool,
    simulate_everything: bool,
    realtime: str | None,
    no_figures: bool,
    **options: Unpack[SceneOptions],
) -> None:
    """Run a scene into a folder, then print its summary."""
    pacer = None if realtime is None else Pacer(parse_factor(realtime))
    loaded = load_scene_printing_notes(**options, noted=True)
    target = OutputFolder.from_option(out, Path("runs"), loaded.path.stem)
    summary = record_run(
        loaded,
        target,
        simulate_everything=simulate_everything,
        silent=quiet or as_json,
        notes_command=None if quiet else text_of_check_command(**options),
        pacer=pacer,
        draw=not no_figures,
    )
    if as_json:
        say_json(summary)
    elif not quiet:
        console = terminal.console()
        for change in loaded.changes:
            say(change.sentence())
        for report in load_reports():
            report.show(console, summary)
        if pacer is not None:
            console.print(pacer.sentence(), soft_wrap=True)


@contextmanager
def pause_garbage_collection() -> Iterator[None]:
    """Pause the search for cyclic garbage: of a million targets it takes a quarter of a check."""
    was_on = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_on:
            gc.enable()


def check_scene_file(no_import: bool, **options: Unpack[SceneOptions]) -> None:
    """Load, check and set up a scene; print its blocks, clocks, changes and outages.

    Blocks of others also run a few scans, in two groupings. Every foreign module is named, with its
    file, before it is imported: one that ends the process (``os._exit``) has the last line. With
    `no_import` none is, and what depends on it stays unchecked.
    """

    def announce(foreign: Foreign) -> None:
        verb = "does not import" if no_import else "imports"
        say(f"{foreign.key} = {foreign.name} {verb} the module {foreign.module}: {foreign.file}")

    with (
        pause_garbage_collection(),
        import_policy(Imports(allowed=not no_import, announce=announce)) as policy,
    ):
        loaded = load_scene_printing_notes(**options, noted=True)
        scene = options["scene"]
        for line in loaded.about:
            say(line)
        if no_import and policy.seen:
            say(
                f"{scene}: nothing wrong as far as it was checked. {len(loaded.blocks)} blocks; "
                "parameters, wires and clocks of the types above, and what needs the whole scene, "
                "were not checked."
            )
            return
        simulation = Simulation(loaded)
        check_window_independence(loaded, partial(load_scene_printing_notes, **options, noted=True))
    warn_of_long_run(simulation)
    print_notes(notes_of_scene(simulation))
    clocks = [node for node in simulation.nodes.values() if node.clock is not None]
    say(
        f"{scene}: ok. {len(loaded.blocks)} blocks, {len(loaded.wires)} wires, "
        f"{float(simulation.duration_s):g} s at {loaded.ticks_per_s:,} ticks per second."
    )
    for node in clocks:
        assert node.clock is not None
        spec = node.clock.spec
        say(
            f"  {node.name}: {float(spec.rate_hz):g} Hz from {float(spec.offset_s):g} s, "
            f"a scan every {float(node.clock.period):,.10g} ticks"
        )
    for change in loaded.changes:
        say(f"  {change.sentence()}")
    for outage in loaded.outages:
        say(f"  {outage.sentence()}")


_WIDE = 300


def print_effects_of_scene(
    measure: bool, simulate_everything: bool, **options: Unpack[SceneOptions]
) -> None:
    """Print a table of every block's effects; with `measure`, run the scene to time them."""
    loaded = load_scene_printing_notes(**options)
    simulation = Simulation(loaded, simulate_everything=simulate_everything)
    shares = measure_effect_time_shares(loaded, simulate_everything) if measure else None
    console = terminal.console(_WIDE)  # no terminal: every sentence on one line
    # What the scene calls for stands first: most of what there is, it does not call for.
    planned, rows = _planned_effects_and_rows(simulation, 0, shares)
    if not rows:
        console.print("No block of this scene declares effects.")
        return
    headings = ("block", "largest influence", "share of run time", "effect")
    acting = sum(item.built for item in planned)
    title = f"{shorten(loaded.title)}: {acting} effects simulated, {len(planned) - acting} not"
    print_table(console, title, headings, rows, group=0)
    for number, stretch in enumerate(loaded.stretches, start=1):
        known, rows = rows, _planned_effects_and_rows(simulation, number, shares)[1]
        title = f"From {float(stretch.from_s):g} s on, otherwise than before"
        if new := [row for row in rows if row not in known]:
            print_table(console, title, headings, new, group=0)
        else:
            console.print(f"{title}: nothing")
    if outside := [item for item in planned if not item.effect.neutral and not item.built]:
        console.print()
        console.print(_table_of_omitted_effects(outside))


def _planned_effects_and_rows(
    simulation: Simulation, stretch: int, shares: Mapping[tuple[str, str], float] | None
) -> tuple[list[Planned], list[tuple[str, str, str, str]]]:
    """Return the effects in force between two timed changes of the scene (part number `stretch`),
    built ones first, and a table row of four texts for each.
    """
    planned = [*simulation.plans[stretch], *simulation.timing_plan_of(stretch)]
    planned.sort(key=lambda item: not item.built)
    rows = []
    for item in planned:
        share = None if shares is None else shares.get((item.block, item.effect.name))
        timed = "" if share is None else f"{share:.1%}"
        rows.append((shorten(item.block), _effect_bounds_text(item), timed, item.sentence()))
    for name, component in simulation.stretches[stretch].items():
        rows += [(shorten(name), "", "", sentence) for sentence in component.skipped_work_notes()]
    return planned, rows


def _table_of_omitted_effects(items: list[Planned]) -> Any:
    """Return a table of the effects that --simulate-everything leaves out, and why."""
    from rich.table import Table

    table = Table(
        box=None,
        padding=(0, 2, 0, 0),
        title="not built by --simulate-everything, so not covered by its proof",
        title_justify="left",
        title_style="",
        show_header=False,
    )
    reasons: dict[tuple[str, str], list[str]] = {}
    for item in items:
        why = item.effect.outside_the_proof or "it has no neutral form"
        reasons.setdefault((item.effect.name, why), []).append(item.block)
    for (name, why), blocks in reasons.items():
        table.add_row(f"{', '.join(shorten(block) for block in blocks)}", f"{name}: {why}")
    return table


def _effect_bounds_text(item: Planned) -> str:
    return ", ".join(f"{q} {bound:.2g}" for q, bound in sorted(item.verdict.bound.items()))


class _Timed:
    """A built effect that adds up the time spent in it, in calls of it and of its methods."""

    def __init__(self, built: Any) -> None:
        self.built = built
        self.spent_s = 0.0

    def __call__(self, *args: Any, **kwargs: Any) -> Any:
        return self._time_call(self.built, *args, **kwargs)

    def __getattr__(self, name: str) -> Any:
        value = getattr(self.built, name)
        return partial(self._time_call, value) if callable(value) else value

    def _time_call(self, call: Callable[..., Any], *args: Any, **kwargs: Any) -> Any:
        started = time.perf_counter()
        try:
            return call(*args, **kwargs)
        finally:
            self.spent_s += time.perf_counter() - started


def measure_effect_time_shares(
    scene: Scene, simulate_everything: bool = False
) -> dict[tuple[str, str], float]:
    """Run a scene; return each built effect's share of run time (0 to 1), by (block, effect).

    An effect that is a choice rather than a calculation, such as the name of a method, has none.
    """
    timed: dict[tuple[str, str], _Timed] = {}

    def wrap(item: Planned, built: Any) -> Any:
        if not callable(built):
            return built
        timed[item.block, item.effect.name] = _Timed(built)
        return timed[item.block, item.effect.name]

    simulation = Simulation(scene, simulate_everything=simulate_everything, wrap_effect=wrap)
    started = time.perf_counter()
    simulation.run()
    whole = time.perf_counter() - started
    return {key: effect.spent_s / whole for key, effect in timed.items()}
