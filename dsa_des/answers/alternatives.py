"""The models that could stand in a study's scene in place of its own.

They are the rungs of its blocks' ladders, and what a user lists. Each is an index of one more axis
of the study, `COLUMN`, whose first value is the scene as it is: so every one meets the same seeds,
draws and encounters, and is run as any cell of a study.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from dsa_des.block.ladder import Ladder, Rung, Unavailable
from dsa_des.errors import BlockFailure, Problem, SceneError, UsageError, did_you_mean
from dsa_des.record.recording import Recorder
from dsa_des.replicas.changed_scene import replica_scene
from dsa_des.results.labels import short_text
from dsa_des.running.simulation import Simulation
from dsa_des.scene.keys import Key, parse_key_path
from dsa_des.scene.overrides import SWAP, parse_assignment, parse_toml_or_text
from dsa_des.scene.scene import Scene
from dsa_des.studies.axes import Axis, parse_axis
from dsa_des.studies.metric import check_tables_recorded
from dsa_des.studies.study import Study
from dsa_des.studies.study_checks import cells_covering_values

COLUMN, AS_IT_IS = "model", "as it is"
#: Lets the engine choose models by itself; here a model must be what it is called.
_CHOOSES_BY_ITSELF = "accuracy"
#: The value of a cleared key that leaves the choice to the engine, which without that table is
#: the exact model.
_AUTO = "auto"


@dataclass(frozen=True)
class Alternative:
    """One model in place of the scene's own, and the changes that put it there."""

    name: str
    sets: tuple[tuple[str, Any], ...] = ()
    swaps: tuple[tuple[str, str], ...] = ()


@dataclass
class Alternatives:
    """What a study is compared with."""

    #: Those that can run and differ from the scene as it is, and from each other.
    these: list[Alternative]
    #: Names of those that the scene has already.
    own: list[str]
    #: Those that cannot run in it, with the reason.
    unavailable: list[tuple[str, str]]
    #: Ladders that change nothing, and what is otherwise than in the study itself.
    notes: list[str]
    #: The scenes with each of `these`, every default written out.
    scenes: dict[str, list[dict[str, Any]]] = field(default_factory=dict)


def same_replicas_study_and_notes(study: Study) -> tuple[Study, list[str]]:
    """Return a copy of the study that runs the same replicas with every model (without
    ``[accuracy]``, allocate and stop_when), and a note on each setting left out.
    """
    notes = []
    base = study.base.copy()
    chosen = base.data.pop(_CHOOSES_BY_ITSELF, None) is not None
    sets = tuple(one for one in study.sets if one[0].partition(".")[0] != _CHOOSES_BY_ITSELF)
    if chosen or sets != study.sets:
        notes.append("[accuracy] is left out: every model is what it is called")
    if study.allocate:
        notes.append("allocate is left out: the same runs are flown with every model, all of them")
    if study.stop_when is not None:
        notes.append(f"stop_when is left out: all {study.replicas:,} replicas are run")
    if COLUMN in {axis.column for axis in study.axes}:
        raise UsageError(f"--answer: the study has an axis {COLUMN}, the name of what is varied")
    plain = replace(
        study, base=base, sets=sets, allocate=(), figures=(), requirements=(), baseline=None
    )
    return plain, notes


def add_model_axis(study: Study, alternatives: Sequence[Alternative]) -> Study:
    """Return the study with one more axis: the scene as it is, and each alternative."""
    every = [Alternative(AS_IT_IS), *alternatives]
    axis = Axis(
        COLUMN,
        tuple(one.name for one in every),
        tuple(one.sets for one in every),
        tuple(one.swaps for one in every),
    )
    return replace(study, axes=(*study.axes, axis), baseline=(COLUMN, AS_IT_IS))


def find_models_to_compare(
    study: Study, block: str | None, listed: Sequence[str], answers: Sequence[str]
) -> Alternatives:
    """Return the models to compare: each rung of all blocks' accuracy ladders, or of `block`'s
    only, and those of the ``--vary`` texts `listed`.

    `listed` are texts ``KEY=VALUE`` or ``KEY=[VALUE, ...]``, as ``--set`` and axes have them.
    """
    found = Alternatives([], [], [], [])
    cells = _cells_covering_axis_values(study)
    scenes = {cell: study.scene(cell) for cell in cells}
    known = {name for scene in scenes.values() for name in scene.blocks}
    if block is not None and block not in known:
        raise UsageError(
            f"--block {block}: the scene has no such block{did_you_mean(block, sorted(known))}"
        )
    fixed = _keys_varied_by_study(study)
    for name, ladder, at in _ladders_and_tables_with_effect(study, scenes, block, found):
        for rung in ladder.rungs:
            label = f"{name} {ladder.name}: {rung.name}"
            try:
                alternative = _rung_as_alternative(study, label, name, ladder, rung, at)
                _refuse_varied_keys(study, alternative, fixed)
            except Unavailable as error:
                found.unavailable.append((label, str(error)))
                continue
            _classify_and_add_alternative(study, alternative, cells, answers, found)
    for text in listed:
        before = len(found.unavailable)
        some = _parse_vary_option(study, text, scenes[cells[0]], fixed)
        for alternative in some:
            _classify_and_add_alternative(study, alternative, cells, answers, found)
        wrong = found.unavailable[before:]
        if len(wrong) == len(some):
            raise UsageError(f"--vary {text}: {wrong[0][1]}")
    return found


def _cells_covering_axis_values(study: Study) -> list[int]:
    """Return cell numbers that cover every value of every axis (of a sampled axis, the first)."""
    sampled = [k for k, axis in enumerate(study.axes) if axis.column in study.over]
    return [
        cell
        for cell in cells_covering_values(study)
        if not any(study.axis_value_indices(cell)[position] for position in sampled)
    ]


def _ladders_and_tables_with_effect(
    study: Study, scenes: Mapping[int, Scene], block: str | None, found: Alternatives
) -> list[tuple[str, Ladder, list[dict[str, Any]]]]:
    """Return (block name, ladder, the block's parameter table in each scene) for every ladder that
    makes a difference in some scene, and add a note to `found` on each other one.
    """
    declared: dict[tuple[str, str], Ladder] = {}
    why: dict[tuple[str, str], str] = {}
    tables: dict[tuple[str, str], list[dict[str, Any]]] = {}
    for cell, scene in scenes.items():
        components = Simulation(replica_scene(scene, study.replica(0, cell))).components
        written = scene.resolved()["blocks"]
        for name, one in scene.blocks.items():
            if name not in components:  # it is not enabled
                continue
            for ladder in one.cls.ladders_for(one.parameters):
                if block not in (None, name):
                    continue
                key = name, ladder.name
                declared.setdefault(key, ladder)
                tables.setdefault(key, []).append(written[name])
                said = "" if ladder.applies is None else ladder.applies(components[name])
                why[key] = said if why.get(key, said) else ""
    if block is not None and not declared:
        raise UsageError(f"--block {block}: declares no ladder; --vary {SWAP}{block}=TYPE names "
                         "other types")  # fmt: skip
    found.notes += [f"{name}, {ladder}: changes nothing here, {said}"
                    for (name, ladder), said in why.items() if said]  # fmt: skip
    return [(key[0], ladder, tables[key]) for key, ladder in declared.items() if not why[key]]


def _rung_as_alternative(
    study: Study, label: str, block: str, ladder: Ladder, rung: Rung, tables: list[dict[str, Any]]
) -> Alternative:
    """Return a rung as an `Alternative` that sets its parameters in the block; raise Unavailable if
    the scenes would need different settings.
    """
    for key in ladder.clears:
        written = study.base.data["blocks"].get(block, {}).get(key)
        if any(table.get(key) not in (None, _AUTO) for table in tables):
            raise Unavailable(f"the scene says {block}.{key} = {short_text(tables[0].get(key))}; "
                              f"--vary blocks.{block}.{key}=... varies it")  # fmt: skip
        if written == _AUTO:
            del study.base.data["blocks"][block][key]
    changes = [rung.parameters_to_set(table) for table in tables]
    if any(one != changes[0] for one in changes):
        raise Unavailable("it is set otherwise at other values of the study's axes")
    sets = [(f"blocks.{block}.{key}", value) for key, value in changes[0].items()]
    numbers = {key: value for key, value in changes[0].items() if type(value) in (int, float)}
    if numbers and all(table["type"] == rung.type_name for table in tables):
        # The scene has this model with other numbers.
        label += f" ({', '.join(f'{key} = {short_text(value)}' for key, value in numbers.items())})"
    sets += [(f"{table}.{key}", value) for table, keys in rung.sections.items()
             for key, value in keys.items()]  # fmt: skip
    return Alternative(label, tuple(sets), ((block, rung.type_name),) * bool(rung.type_name))


def _parse_vary_option(
    study: Study, text: str, scene: Scene, fixed: Mapping[Key, str]
) -> list[Alternative]:
    """Return one alternative per value of a ``--vary``; UsageError if invalid or varied already."""
    parsed = parse_assignment(text, "--vary")
    if isinstance(parsed, Problem):
        raise SceneError([parsed])
    key, value = parsed[0], parse_toml_or_text(parsed[1])
    try:
        axis = parse_axis(key, value if isinstance(value, list | dict) else [value], scene)
    except ValueError as error:
        raise UsageError(f"--vary {text}: {error}") from error
    if axis.files:
        raise UsageError(f"--vary {text}: other encounters give another answer; vary a model")
    some = [
        Alternative(f"{axis.column.removeprefix(SWAP)} = {label}", sets, swaps)
        for label, sets, swaps in zip(axis.labels, axis.sets, axis.swaps, strict=True)
    ]
    try:
        for one in some:
            _refuse_varied_keys(study, one, fixed)
    except Unavailable as error:
        raise UsageError(f"--vary {text}: {error}") from error
    return some


def _keys_varied_by_study(study: Study) -> dict[Key, str]:
    """Return the keys that the study itself varies, and what varies them."""
    tables = study.base.data
    fixed: dict[Key, str] = {}
    for axis in study.axes:
        for sets, swaps in zip(axis.sets, axis.swaps, strict=True):
            fixed |= {
                parse_key_path(tables, key): f"the study's axis {axis.column}" for key, _ in sets
            }
            fixed |= {("blocks", block, "type"): f"the study's axis {axis.column}"
                      for block, _ in swaps}  # fmt: skip
    drawn = {
        parse_key_path(tables, draw.key): f"the study's draw {draw.key}" for draw in study.draws
    }
    return fixed | drawn


def _refuse_varied_keys(study: Study, alternative: Alternative, fixed: Mapping[Key, str]) -> None:
    """Raise Unavailable if a model would change a scene key that the study itself varies."""
    keys: list[Key] = [parse_key_path(study.base.data, key) for key, _ in alternative.sets]
    keys += [("blocks", block, "type") for block, _ in alternative.swaps]
    for key in keys:
        if key in fixed:
            raise Unavailable(f"{fixed[key]} sets it")


def _classify_and_add_alternative(
    study: Study, alternative: Alternative, cells: Sequence[int], answers: Sequence[str],
    found: Alternatives,
) -> None:  # fmt: skip
    """Build a model's scenes and add it to `found`: as unavailable, as equal to the scene's own, as
    a new model, or as a note that it equals an earlier one.
    """
    two = add_model_axis(study, [alternative])
    owns, others = [], []
    for cell in cells:
        try:
            own, other = two.scene(2 * cell), two.scene(2 * cell + 1)
            owns.append(own.resolved())
            others.append(other.resolved())
            if owns[-1] == others[-1]:
                continue
            _check_runnable(two, other, 2 * cell + 1, answers)
        except SceneError as error:
            found.unavailable.append(
                (alternative.name, "; ".join(map(_short_problem_text, error.problems)))
            )
            return
        except BlockFailure as error:
            found.unavailable.append((alternative.name, f"{error.block}: {error.reason}"))
            return
        except (ValueError, Unavailable) as error:
            found.unavailable.append((alternative.name, str(error)))
            return
    twin = next((name for name, scenes in found.scenes.items() if scenes == others), None)
    if owns == others:
        found.own.append(alternative.name)
    elif twin is None:
        found.these.append(alternative)
        found.scenes[alternative.name] = others
    elif twin != alternative.name:
        found.notes.append(f"{alternative.name} is {twin}")


def _check_runnable(study: Study, scene: Scene, cell: int, answers: Sequence[str]) -> None:
    """Raise an error unless a scene can run and its metrics give the answers."""
    metrics = [spec.build(scene) for spec in study.metrics]
    wanted = {table for metric in metrics for table in metric.tables}
    recorder = Recorder([], wanted=dict.fromkeys(wanted, ()))
    blocks = Simulation(replica_scene(scene, study.replica(0, cell)), recorder=recorder).components
    for metric in metrics:
        check_tables_recorded(metric, blocks)
        metric.check(blocks)
    given = {result.name for metric in metrics for result in metric.results()}
    for name in answers:
        if name not in given:
            raise ValueError(f"no metric gives {name} with it{did_you_mean(name, sorted(given))}")


def _short_problem_text(problem: Problem) -> str:
    return f"{problem.key}: {problem.message}" if problem.key else str(problem.message)
