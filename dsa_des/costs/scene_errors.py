"""How wrong the models are that a scene uses, each against the best there is of its kind."""

from dataclasses import replace
from typing import Any

from dsa_des.block.ladder import Ladder, Unavailable
from dsa_des.costs.study import RungCost, applies, climb
from dsa_des.costs.variants import Choice, Variants


def scene_errors(variants: Variants) -> tuple[list[dict[str, Any]], list[str]]:
    """Run a scene with its own models and with each one's reference, and return their errors.

    Parameters
    ----------
    variants : Variants

    Returns
    -------
    rows : list of dict
        One per block, ladder and quantity: the rung that the scene uses, the error's mean, 95th
        percentile and largest value over target-scans, and what it is against.
    notes : list of str
        Ladders of which nothing could be measured, and why.
    """
    rows: list[dict[str, Any]] = []
    notes: list[str] = []
    for name, block in variants.scene.blocks.items():
        for ladder in block.cls.ladders_for(block.parameters):
            why = applies(variants, name, ladder)
            if why:
                notes.append(f"{name}, {ladder.name}: changes nothing here, {why}")
                continue
            rung = _of_scene(variants, name, ladder)
            if rung is None:
                notes.append(f"{name}, {ladder.name}: the scene uses none of its rungs")
                continue
            wanted = {rung, ladder.reference}
            short = replace(ladder, rungs=tuple(r for r in ladder.rungs if r.name in wanted))
            try:
                costs = climb(variants, name, short, repeats=1)
            except Unavailable as error:
                notes.append(f"{name}, {ladder.name}: no reference in this scene: {error}")
                continue
            (mine,) = [cost for cost in costs if cost.rung == rung]
            if not mine.errors:
                why = mine.unavailable or mine.error_note or "nothing to compare"
                notes.append(f"{name}, {ladder.name}: not measured, {why}")
            rows += _rows(mine)
    return rows, notes


def _of_scene(variants: Variants, name: str, ladder: Ladder) -> str | None:
    """Return the name of the rung that the scene's block is."""
    own = variants.scene.blocks[name]
    for rung in ladder.rungs:
        try:
            block = variants.with_rungs([Choice(name, ladder, rung)]).blocks[name]
        except (Unavailable, ValueError):
            continue
        if block.cls is own.cls and block.parameters == own.parameters:
            return rung.name
    return None


def _rows(cost: RungCost) -> list[dict[str, Any]]:
    own = cost.rung == cost.reference
    return [
        {
            "block": cost.block,
            "ladder": cost.ladder.name,
            "rung": cost.rung,
            "quantity": quantity.name,
            "unit": quantity.unit,
            "mean": spread.mean,
            "p95": spread.p95,
            "largest": spread.maximum,
            "target_scans": spread.count,
            "against": cost.error_note if own else cost.reference,
        }
        for quantity in cost.ladder.quantities
        if (spread := cost.errors.get(quantity.name)) is not None
    ]
