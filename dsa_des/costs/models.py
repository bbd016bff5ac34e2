"""The models that a scene is made of, and their errors beside each one's reference."""

import json
import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from dsa_des.block.ladder import Ladder, Unavailable
from dsa_des.costs.climb import RungCost, inapplicable_reason, measure_rungs
from dsa_des.costs.replay import run_with_recorded_wakes
from dsa_des.costs.variants import Choice, Variants
from dsa_des.results.folder import StudyFolder
from dsa_des.results.models import (
    ERRORS,
    EffectRecord,
    ErrorRecord,
    MeasuredErrors,
    ModelRecord,
    SceneRecord,
)
from dsa_des.results.rows import StoredRows
from dsa_des.running.simulation import Simulation
from dsa_des.scene.scene import Scene


def scene_record(where: str, scene: Scene) -> SceneRecord:
    """Return a record of a scene's models, effects (on or off, and why), and skipped work."""
    simulation = Simulation(scene)
    models, spared = [], []
    for name, component in simulation.components.items():
        block = scene.blocks[name]
        about = (type(component).__doc__ or "").strip().partition("\n")[0]
        rungs = [
            _rung_text_of_block(scene, name, ladder)
            for ladder in block.cls.ladders_for(block.parameters)
        ]
        models.append(
            ModelRecord(
                block=name, type=block.type_name, about=about, rungs=list(filter(None, rungs))
            )
        )
        spared += [(name, sentence) for sentence in component.skipped_work_notes()]
    effects = [
        EffectRecord(
            block=item.block, effect=item.effect.name, simulated=item.built, because=item.because,
            bound={k: float(v) for k, v in item.verdict.bound.items() if math.isfinite(v)},
        )
        for item in [*simulation.plan, *simulation.timing_plan]
    ]  # fmt: skip
    return SceneRecord(where=where, models=models, effects=effects, spared=spared)


def _rung_text_of_block(scene: Scene, name: str, ladder: Ladder) -> str:
    """Return text on which rung a block uses, by type and parameters; empty if none fits."""
    block = scene.blocks[name]
    table = scene.resolved()["blocks"][name]
    best = ""
    for rung in ladder.rungs:
        try:
            changes = rung.parameters_to_set(table)
        except Unavailable:
            continue
        same = rung.type_name in ("", block.type_name) and all(
            getattr(scene.sections.get(section), key, None) == value
            for section, keys in rung.sections.items()
            for key, value in keys.items()
        )
        if same and all(table.get(key) == value for key, value in changes.items()):
            reference = " (the reference)" if rung.name == ladder.reference else ""
            best = f"{ladder.name}: {rung.name}, {rung.what}{reference}"
            if changes or rung.type_name or rung.sections:
                return best
    return best


def measure_and_store_errors(
    folder: StudyFolder, report: Callable[[str], None] = lambda text: None
) -> None:
    """Run a study's first scene with own models and references; write errors to its folder.

    `report` is told which ladder is begun. It reads the scene that the folder names, and imports
    its blocks: not for folders of strangers.
    """
    record = folder.record
    first = StoredRows(folder).first
    swaps, sets = record.swaps_and_sets(first)
    variants = Variants(
        Path(record.scene), sets=[f"{key}={value}" for key, value in sets],
        swaps=[f"{block}={name}" for block, name in swaps], seed=int(first["seed"]),
    )  # fmt: skip
    rows, notes = model_errors_in_scene(variants, report)
    errors = MeasuredErrors(command=record.command(first), rows=rows, notes=notes)
    folder.write_file(ERRORS, (json.dumps(errors.model_dump(), indent=1) + "\n").encode())


def model_errors_in_scene(
    variants: Variants, report: Callable[[str], None]
) -> tuple[list[ErrorRecord], list[str]]:
    """Run a scene with own models and with each reference; return own errors, and notes.

    Beside them notes: of which ladders nothing could be measured, and why.
    """
    rows: list[ErrorRecord] = []
    notes: list[str] = []
    blocks = variants.scene.blocks
    ladders = {name: block.cls.ladders_for(block.parameters) for name, block in blocks.items()}
    many = sum(map(len, ladders.values()))
    if many:
        report(f"errors of models: the first run ({many} ladders follow)")
    own = run_with_recorded_wakes(variants.scene, [name for name, mine in ladders.items() if mine])
    for name, mine in ladders.items():
        for ladder in mine:
            report(f"errors of models: {name}, {ladder.name}")
            why = inapplicable_reason(variants, name, ladder)
            if why:
                notes.append(f"{name}, {ladder.name}: changes nothing here, {why}")
                continue
            rung = _rung_name_in_scene(variants, name, ladder)
            if rung is None:
                notes.append(f"{name}, {ladder.name}: the scene uses none of its rungs")
                continue
            wanted = {rung, ladder.reference}
            short = replace(ladder, rungs=tuple(r for r in ladder.rungs if r.name in wanted))
            try:
                costs = measure_rungs(variants, name, short, repeats=0, own=own[name])
            except Unavailable as error:
                notes.append(f"{name}, {ladder.name}: no reference in this scene: {error}")
                continue
            (its,) = [cost for cost in costs if cost.rung == rung]
            if not its.errors:
                why = its.unavailable or its.error_note or "nothing to compare"
                # They stand below the words "not measured", and may begin with them.
                notes.append(f"{name}, {ladder.name}: {why.removeprefix('not measured: ')}")
            rows += _error_rows(its)
    return rows, notes


def _rung_name_in_scene(variants: Variants, name: str, ladder: Ladder) -> str | None:
    """Return the name of the rung that the scene's block uses; None if it uses none."""
    own = variants.scene.blocks[name]
    for rung in ladder.rungs:
        try:
            block = variants.with_rungs([Choice(name, ladder, rung)]).blocks[name]
        except (Unavailable, ValueError):
            continue
        if block.cls is own.cls and block.parameters == own.parameters:
            return rung.name
    return None


def _error_rows(cost: RungCost) -> list[ErrorRecord]:
    own = cost.rung == cost.reference
    return [
        ErrorRecord(
            block=cost.block, ladder=cost.ladder.name, rung=cost.rung, quantity=quantity.name,
            unit=quantity.unit, mean=spread.mean, p95=spread.p95, largest=spread.maximum,
            target_scans=spread.count, against=cost.error_note if own else cost.reference,
        )
        for quantity in cost.ladder.quantities
        if (spread := cost.errors.get(quantity.name)) is not None
    ]  # fmt: skip
