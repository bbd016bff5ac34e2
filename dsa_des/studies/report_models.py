"""The part of a study's report about its scene: models with their errors, effects, and why."""

from collections.abc import Callable, Iterable, Sequence
from typing import Any

from dsa_des.studies.explained import EffectRecord, Explained, SceneRecord
from dsa_des.studies.labels import short
from dsa_des.studies.measured_errors import MeasuredErrors

#: Makes an HTML table of headings and rows of texts.
Table = Callable[[Sequence[str], Iterable[Sequence[Any]]], str]
#: Makes text fit for a page.
Text = Callable[[Any], str]


def models_part(found: Explained | None, errors: MeasuredErrors | None, table: Table,
                text: Text, again: str) -> str:  # fmt: skip
    """Return the models, their errors and the effects of a study as HTML.

    Parameters
    ----------
    found : Explained or None
        What the folder says of its scene.
    errors : MeasuredErrors or None
        What it says of its models' errors.
    table, text : callable
    again : str
        The command that tells what the folder does not.
    """
    if found is None:
        return (
            "<h2>Models and effects</h2><p>This folder is of a version that kept neither. Which "
            "model each block uses, with its proven error, and which effects are left out and "
            f"why:</p><pre>{text(again)}</pre>"
        )
    parts = ["<h2>Models and their errors</h2>"]
    for number, scene in enumerate(found.scenes):
        if scene.models:
            parts.append(_where(scene, number, text) + _models(scene, table))
    parts.append(_proven(found, table))
    parts.append(_measured(errors, table, text))
    parts.append("<h2>Effects</h2>")
    for number, scene in enumerate(found.scenes):
        if scene.effects or scene.spared:
            parts.append(_where(scene, number, text) + _effects(scene, table))
    return "\n".join(filter(None, parts))


def _where(scene: SceneRecord, number: int, text: Text) -> str:
    if not scene.where:
        return ""
    said = "In the first cell" if number == 0 else "Otherwise"
    return f"<p>{said}, <code>{text(scene.where)}</code>:</p>"


def _models(scene: SceneRecord, table: Table) -> str:
    rows = [(m.block, m.type, m.about, "; ".join(m.rungs)) for m in scene.models]
    return table(("block", "model", "what it is", "its place among models of its kind"), rows)


def _proven(found: Explained, table: Table) -> str:
    """Return the proven bounds: of what was left out within a tolerance, and of what might be."""
    rows = [
        (e.block, e.effect, ", ".join(f"{q} {short(b)}" for q, b in sorted(e.bound.items())),
         "simulated" if e.simulated else "left out")
        for scene in found.scenes for e in scene.effects if e.bound
    ]  # fmt: skip
    if not rows:
        return (
            "<p class='note'>No model was chosen and no effect left out within an allowed error "
            "([accuracy]), so there is no bound to prove.</p>"
        )
    return "<h3>Proven: largest influence</h3>" + table(
        ("block", "effect", "largest influence", ""), rows
    )


def _measured(errors: MeasuredErrors | None, table: Table, text: Text) -> str:
    if errors is None:
        return (
            "<p class='note'>Errors of the models were not measured (a study of 100 runs or more "
            "does it by itself): <code>dsa-des study report FOLDER --measure</code>.</p>"
        )
    rows = [
        (e.block, f"{e.ladder}: {e.rung}", f"{e.quantity}, {e.unit}", short(e.mean), short(e.p95),
         short(e.largest), e.target_scans, _against(e.against))
        for e in errors.rows
    ]  # fmt: skip
    heads = ("block", "model", "error of", "mean", "95 %", "largest", "target-scans", "against")
    notes = "".join(f"<li>{text(note)}</li>" for note in errors.notes)
    return (
        "<h3>Measured over the first run</h3>"
        + table(heads, rows)
        + (f"<p class='note'>Not measured:</p><ul class='note'>{notes}</ul>" if notes else "")
    )


def _against(said: str) -> str:
    """Return what an error is against: another model, or for a reference something far better."""
    return f"its own error, {said}" if said.startswith("measured") else said


def _effects(scene: SceneRecord, table: Table) -> str:
    built = [e for e in scene.effects if e.simulated]
    left = [e for e in scene.effects if not e.simulated]

    def rows(some: list[EffectRecord]) -> list[tuple[str, str, str]]:
        together: dict[tuple[str, str], list[str]] = {}
        for e in some:
            together.setdefault((e.effect, e.because), []).append(e.block)
        return [(", ".join(blocks), effect, why) for (effect, why), blocks in together.items()]

    parts = []
    if built:
        parts.append("<h3>Simulated</h3>" + table(("where", "effect", "because"), rows(built)))
    if left:
        parts.append(
            "<h3>Left out, and why</h3>" + table(("where", "effect", "because"), rows(left))
        )
    if scene.spared:
        parts.append(
            "<h3>Work that is spared</h3>" + table(("block", "what, and why"), scene.spared)
        )
    return "\n".join(parts)
