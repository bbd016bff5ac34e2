"""The parts of a scene, each validated: what is wrong with one is added to the problems of all."""

from collections.abc import Mapping
from fractions import Fraction
from typing import Any

from pydantic import ValidationError

from dsa_des.block.component import Parameters
from dsa_des.block.registry import NotImported, UnknownType, find
from dsa_des.block.sections import section_models
from dsa_des.block.source_file import absolute
from dsa_des.block.strangers import Left, strangers_code
from dsa_des.errors import Problem, did_you_mean
from dsa_des.scene.block import Block
from dsa_des.scene.checks import check_lookalikes
from dsa_des.scene.options import BlockOptions, split_options
from dsa_des.scene.overrides import drop_of_other_type
from dsa_des.scene.parameter_errors import explain
from dsa_des.scene.processor import ProcessorParameters
from dsa_des.scene.scene_file import Key, SceneFile, dotted
from dsa_des.time.clock import parse_rational

_MAX_SEED = 2**63


def read_text(scene_file: SceneFile, key: str, problems: list[Problem]) -> str:
    """Return a text of a scene, such as its title; empty where there is none."""
    value = scene_file.data.get(key, "")
    if not isinstance(value, str):
        problems.append(scene_file.problem((key,), "must be text", value))
        return ""
    return str(value)


def read_seed(scene_file: SceneFile, problems: list[Problem]) -> int:
    """Return the seed; 0 where there is none."""
    seed = scene_file.data.get("seed", 0)
    if isinstance(seed, bool) or not isinstance(seed, int) or not 0 <= seed < _MAX_SEED:
        message = f"must be a whole number from 0 to {_MAX_SEED - 1}"
        problems.append(scene_file.problem(("seed",), message, seed))
        return 0
    return seed


def read_duration(scene_file: SceneFile, problems: list[Problem]) -> Fraction | None:
    """Return the length of the run in s, or None where it is left to the sources."""
    if "duration_s" not in scene_file.data:
        return None
    value = scene_file.data["duration_s"]
    try:
        duration = parse_rational(value)
        if duration <= 0:
            raise ValueError("must be greater than 0")
    except ValueError as error:
        problems.append(scene_file.problem(("duration_s",), str(error), value))
        return None
    return duration


def read_sections(scene_file: SceneFile, problems: list[Problem]) -> dict[str, Parameters]:
    """Return the tables that belong to no block, also those with their defaults only."""
    sections: dict[str, Parameters] = {}
    for name, model in section_models().items():
        table = scene_file.data.get(name, {})
        if not isinstance(table, dict):
            problems.append(scene_file.problem((name,), "must be a table", table))
            continue
        try:
            sections[name] = model.model_validate(table)
        except ValidationError as error:
            problems += explain(scene_file, (name,), f"[{name}]", model, error)
    return sections


def read_blocks(
    scene_file: SceneFile, problems: list[Problem], notes: list[str]
) -> tuple[dict[str, Any], dict[str, Block]]:
    """Return the class of each block, None where it is not known, and the faultless blocks."""
    tables = scene_file.data.get("blocks", {})
    classes: dict[str, Any] = {}
    blocks: dict[str, Block] = {}
    if not isinstance(tables, dict) or not tables:
        problems.append(scene_file.problem(("blocks",), "a scene needs at least one block"))
        return classes, blocks
    for name in sorted(tables):
        key: Key = ("blocks", name)
        table = tables[name]
        classes[name] = None
        if not isinstance(table, dict):
            problems.append(scene_file.problem(key, "must be a table", table))
            continue
        type_name = table.get("type")
        if not isinstance(type_name, str):
            message = 'needs a type, for example type = "radar.swerling"'
            problems.append(scene_file.problem((*key, "type"), message))
            continue
        try:
            cls = find(type_name, dotted((*key, "type")), (scene_file.path.parent,))
        except NotImported:
            continue
        except UnknownType as error:
            problems.append(scene_file.problem((*key, "type"), str(error), str(type_name)))
            continue
        classes[name] = cls
        notes += drop_of_other_type(scene_file, name, cls)
        extra, given = split_options(table, cls.Parameters)
        given = _as_written(scene_file, key, given, cls.Parameters)
        try:
            with strangers_code(ValidationError):
                parameters = cls.Parameters.model_validate(given)
            options = BlockOptions.model_validate(extra)
        except ValidationError as error:
            problems += explain(scene_file, key, str(type_name), cls.Parameters, error)
            continue
        except Left as error:
            message = f"{cls.path()} cannot take its parameters: {error}"
            problems.append(scene_file.problem(key, message))
            continue
        check_lookalikes(scene_file, key, given, cls.Parameters, problems)
        blocks[name] = Block(name, str(absolute(type_name)), cls, parameters, options)
    return classes, blocks


def _as_written(
    scene_file: SceneFile, key: Key, given: dict[str, Any], model: Any
) -> dict[str, Any]:
    """Return a block's parameters with what its tables take from the file that wrote them first."""
    for (name, inner), outer in getattr(model, "as_written_with", {}).items():
        table, beside = given.get(name), scene_file.beside.get((*key, name))
        if isinstance(table, dict) and beside is not None and inner not in table:
            then = beside.get(outer, model.model_fields[outer].default)
            given = {**given, name: {**table, inner: then}}
    return given


def read_processors(
    scene_file: SceneFile, blocks: Mapping[str, Block], problems: list[Problem]
) -> dict[str, ProcessorParameters]:
    """Return the shared processors; blocks must name none besides."""
    tables = scene_file.data.get("processors", {})
    if not isinstance(tables, dict):
        problems.append(scene_file.problem(("processors",), "must hold one table per processor"))
        return {}
    found: dict[str, ProcessorParameters] = {}
    for name in sorted(tables):
        key: Key = ("processors", name)
        if not isinstance(tables[name], dict):
            problems.append(scene_file.problem(key, "must be a table", tables[name]))
            continue
        try:
            found[name] = ProcessorParameters.model_validate(tables[name])
        except ValidationError as error:
            problems += explain(scene_file, key, f"[{dotted(key)}]", ProcessorParameters, error)
    for name, block in blocks.items():
        wanted = block.options.processor
        if wanted is not None and wanted not in tables:
            message = f"the scene has no such processor{did_you_mean(wanted, tables)}"
            problems.append(scene_file.problem(("blocks", name, "processor"), message, str(wanted)))
    return found
