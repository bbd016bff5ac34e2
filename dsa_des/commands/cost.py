"""``dsa-des cost``: what each model of each block costs, gets wrong, and changes."""

import sys
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from dsa_des.block.entry_points import entry_points_of
from dsa_des.block.ladder import Ladder, Unavailable
from dsa_des.block.registry import UnknownType, find_component
from dsa_des.block.shadowed_packages import NotImportable, import_named_object
from dsa_des.costs.climb import (
    Comparison,
    RungCost,
    allowed_errors_by_unit,
    inapplicable_reason,
    measure_rungs,
)
from dsa_des.costs.cost_report import (
    draw_error_against_cost,
    print_chain_and_notes,
    print_ladder,
    write_rows_as_parquet,
)
from dsa_des.costs.replay import RungRun, run_with_recorded_wakes
from dsa_des.costs.variants import Variants
from dsa_des.errors import UsageError, did_you_mean
from dsa_des.files.output_folder import OutputFolder
from dsa_des.record.run_folder import write_run_json
from dsa_des.running.reports import load_reports, notes_of_loading, print_notes
from dsa_des.scene.examples import find_input_file
from dsa_des.terminal.terminal import say, say_json

#: Ladders of one block of a scene, those that change something in it.
Climbs = list[tuple[str, Ladder]]
_QUIET_S, _REPEATS = 10.0, 10


def measure_cost_of_accuracy(
    scene: str | None,
    sets: tuple[str, ...],
    swaps: tuple[str, ...],
    seed: int | None,
    duration: str | None,
    block: str | None,
    against: str | None,
    repeats: int | None,
    budgets: tuple[str, ...],
    whole_chain: bool,
    map_name: str | None,
    out: str | None,
    as_json: bool,
    listed: tuple[str, ...] = (),
    workers: int | None = None,
    resume: bool = False,
    no_figures: bool = False,
) -> None:
    """Climb the ladders of a scene's blocks, write tables and figures, and print the rows.

    After ctrl-C the ladders that are finished are kept; exit code 130.
    """
    if listed or workers is not None or resume:
        option = "--resume" if workers is None else f"--workers {workers}"
        option = f"--vary {listed[0]}" if listed else option
        raise UsageError(f"{option}: goes with --answer RESULT of a study")
    repeats = repeats or _REPEATS
    if map_name is not None:
        if whole_chain or block is not None:
            raise UsageError("--map draws no scene's blocks: leave out --block and --all")
        if scene is not None:
            raise UsageError(f"--map draws no scene: leave out {scene}")
        _draw_maps(map_name, out)
        return
    if scene is None:
        raise UsageError("SCENE is missing: only --map needs none")
    variants = Variants(
        find_input_file(scene, "scene"), sets=sets, swaps=swaps, seed=seed, duration_s=duration
    )
    variants.scene.dropped = variants.dropped
    print_notes(notes_of_loading(variants.scene))
    climbs, notes = ladders_to_run_and_notes(variants, block, against)
    limits = allowed_errors_by_unit(budgets, [ladder for _, ladder in climbs])
    target = OutputFolder.from_option(out, Path("runs"), f"{variants.scene.path.stem}-cost")
    compare = comparison_of_all_reports()
    costs: list[RungCost] = []
    chain: list[dict[str, Any]] = []
    stopped = False
    with target.write_then_rename() as folder:
        progress = CostProgress(silent=as_json)
        try:
            own = run_with_recorded_wakes(variants.scene, {name for name, _ in climbs})
            progress.print_if_due(describe_duration(climbs, own, repeats), always=True)
            for number, (name, ladder) in enumerate(climbs, 1):
                progress.print_if_due(
                    f"{name}: {ladder.name} ({number} of {len(climbs)} ladders) ..."
                )
                try:
                    rungs = measure_rungs(variants, name, ladder, against=against, repeats=repeats,
                                  budgets=limits, compare=compare, own=own[name])  # fmt: skip
                except Unavailable as error:
                    notes.append(f"{name}, {ladder.name}: no reference in this scene: {error}")
                    continue
                costs += rungs
                if not as_json:
                    print_ladder(rungs, compare)
        except KeyboardInterrupt:
            if not costs:
                raise
            stopped = True
        rows = [cost.row() for cost in costs]
        write_rows_as_parquet(folder / "cost.parquet", rows)
        if not no_figures:
            draw_error_against_cost(folder / "cost.png", variants.scene.title, costs)
        if whole_chain and not stopped:
            from dsa_des.costs.chain import draw_run_error_against_cost, run_rung_combinations

            progress.print_if_due("whole chain ...")
            chain, picked = run_rung_combinations(variants, costs, compare)
            notes.append(picked)
            write_rows_as_parquet(folder / "chain.parquet", chain)
            label = compare.difference.label
            if not no_figures:
                draw_run_error_against_cost(
                    folder / "chain.png", variants.scene.title, chain, label
                )
        content: dict[str, Any] = {"rows": rows, "notes": notes}
        if chain:
            content["chain"] = chain
        write_run_json(folder, {"title": variants.scene.title, "cost": content})
    if as_json:
        say_json(rows + chain)
    else:
        print_chain_and_notes(chain, notes, compare)
        names = sorted(path.name for path in target.path.iterdir())
        say()
        say(f"{target.path}: {', '.join(names)}")
    if stopped:
        done = len({(cost.block, cost.ladder.name) for cost in costs})
        say(f"stopped: interrupted; {done} of {len(climbs)} ladders are kept", err=True)
        sys.exit(130)


def describe_duration(climbs: Climbs, own: Mapping[str, RungRun], repeats: int) -> str:
    """Return how long climbing ladders takes if every rung costs as much as the scene's own."""
    if not climbs:
        return "no ladder to climb"
    others = sum(len(ladder.rungs) - 1 for _, ladder in climbs)
    run_s = next(iter(own.values())).run_cpu_s
    timing_s = sum(
        len(ladder.rungs) * own[name].expected_timing_s(repeats) for name, ladder in climbs
    )
    return (
        f"about {others * run_s + timing_s:.0f} s: {others} runs of {run_s:.2g} s and "
        f"{timing_s:.0f} s of timing, if each model costs as much as the scene's own; dearer ones "
        "take longer. Ctrl-C keeps what is finished; --block BLOCK or --duration S asks for less"
    )


class CostProgress:
    """Prints what is being measured: every step on a terminal, elsewhere one every ten seconds."""

    def __init__(self, silent: bool) -> None:
        self._silent, self._last_s = silent, time.monotonic()

    def print_if_due(self, text: str, always: bool = False) -> None:
        """Print what is measured now, unless too soon after the last text; `always` forces it."""
        now_s = time.monotonic()
        due = always or sys.stderr.isatty() or now_s - self._last_s > _QUIET_S
        if not self._silent and due:
            say(text, err=True)
            self._last_s = now_s


def ladders_to_run_and_notes(
    variants: Variants, block: str | None, against: str | None
) -> tuple[Climbs, list[str]]:
    """Return (block, ladder) pairs to run, and notes on ladders that change nothing here."""
    blocks = variants.scene.blocks
    if block is not None and block not in blocks:
        raise UsageError(
            f"--block {block}: the scene has no such block{did_you_mean(block, blocks)}"
        )
    names = list(blocks) if block is None else [block]
    declared = [
        (name, ladder)
        for name in names
        for ladder in blocks[name].cls.ladders_for(blocks[name].parameters)
    ]
    if not declared:
        who = "no block of this scene declares a ladder"
        if block is not None:
            who = f"{block}: {blocks[block].type_name} declares no ladder"
        raise UsageError(f"{who}; dsa-des components TYPE shows those of a type")
    if against is not None:
        rungs = {rung.name for _, ladder in declared for rung in ladder.rungs}
        if against not in rungs:
            raise UsageError(
                f"--against {against}: no ladder here has such a rung{did_you_mean(against, rungs)}"
            )
        declared = [
            (name, ladder)
            for name, ladder in declared
            if against in {rung.name for rung in ladder.rungs}
        ]
    climbs, notes = [], []
    for name, ladder in declared:
        why = inapplicable_reason(variants, name, ladder)
        if why:
            notes.append(f"{name}, {ladder.name}: not climbed, {why}")
        else:
            climbs.append((name, ladder))
    return climbs, notes


def comparison_of_all_reports() -> Comparison:
    """Return a comparison of two runs that uses all registered reports."""
    return Comparison(load_reports())


def _draw_maps(name: str, out: str | None) -> None:
    """Draw the error maps of the ladders of one type, or of all types that begin with ``NAME.``."""
    functions = _error_map_name_by_family()
    if name not in functions:
        raise UsageError(f"--map {name}: no ladder draws such a map{did_you_mean(name, functions)}")
    try:
        draw: Any = import_named_object(functions[name], "--map")
    except NotImportable as error:
        raise UsageError(f"--map {name}: {functions[name]} cannot be loaded: {error}") from error
    target = OutputFolder.from_option(out, Path("runs"), f"map-{name}")
    with target.write_then_rename() as folder:
        paths = [Path(path).name for path in draw(folder)]
        write_run_json(folder, {"map": name})
    say(f"{target.path}: {', '.join(paths)}")


def _error_map_name_by_family() -> dict[str, str]:
    """Return family of block types (``geometry`` for ``geometry.*``) → name of its error map."""
    functions: dict[str, str] = {}
    for type_name in entry_points_of():
        try:
            ladders = find_component(type_name).ladders
        except UnknownType:  # a broken plug-in
            continue
        for ladder in ladders:
            if ladder.map_function:
                functions.setdefault(type_name.partition(".")[0], ladder.map_function)
    return functions
