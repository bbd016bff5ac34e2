"""Changes of a scene's tables, from the command line, from Python and from studies.

A change is a dotted key and its value, or ``swap.BLOCK`` and a type: that puts another type into a
block, keeps its name, its wires and the parameters the new type knows, and lists those it dropped.
"""

import re
from collections.abc import Iterable, Mapping
from copy import deepcopy
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

from dsa_des.block.component import Component, SourcedText, to_scene_number
from dsa_des.block.entry_points import COMPONENTS
from dsa_des.block.registry import (
    NotImported,
    UnknownType,
    class_name_in_scene,
    find_component,
    with_source_folder,
)
from dsa_des.errors import Problem, SceneError, did_you_mean
from dsa_des.files.toml_files import DEEPEST, NotToml, TomlError, parse_toml
from dsa_des.scene.block_table import BlockOptions
from dsa_des.scene.keys import (
    Key,
    dotted_key,
    explain_no_item,
    is_new_item,
    step_into_key,
    unquote_key,
)
from dsa_des.scene.scene_file import COMMAND_LINE, SceneFile, read_scene_tables

#: A dotted key and its value, or ``swap.BLOCK`` and a type.
Change = tuple[str, Any]
SWAP = "swap."
#: Where messages say that a change in Python was written.
IN_SET, IN_SWAP = "scene.set", "scene.swap"


def parse_assignment(text: str, option: str) -> tuple[str, str] | Problem:
    """Return (key, value) of a text ``key=value``; a Problem if ``=`` or either side is missing."""
    key, equals, value = text.partition("=")
    if not equals or not key.strip() or not value.strip():
        form = "BLOCK=TYPE" if option == "--swap" else "KEY=VALUE"
        return Problem(COMMAND_LINE, option, f"must have the form {form}", text)
    return key.strip(), value.strip()


def parse_toml_or_text(text: str) -> Any:
    """Return a value as TOML would read it; what is not TOML is text."""
    try:
        value = parse_toml(f"value = {text}")
    except NotToml:
        return _tag_texts_with_working_folder(text)
    # What follows a line's end would be further keys.
    return _tag_texts_with_working_folder(value["value"] if set(value) == {"value"} else text)


def read_sets(assignments: Iterable[str]) -> tuple[list[tuple[str, Any]], list[Problem]]:
    """Return (key, value) of every ``--set``, and a problem for each malformed or repeated one."""
    values: dict[str, Any] = {}
    problems: list[Problem] = []
    for assignment in assignments:
        parsed = parse_assignment(assignment, "--set")
        if isinstance(parsed, Problem):
            problems.append(parsed)
            continue
        text, written = parsed
        try:
            value = parse_toml_or_text(written)
        except TomlError as error:
            problems.append(Problem(COMMAND_LINE, text, str(error)))
            continue
        if text in values:
            problems.append(Problem(COMMAND_LINE, text, "--set gives it twice", written))
        values[text] = value
    return list(values.items()), problems


def read_changes(
    sets: Iterable[str], swaps: Iterable[str], seed: int | None, duration_s: object
) -> tuple[list[Change], list[Problem]]:
    """Return changes by ``--swap``, ``--set``, ``--seed``, ``--duration`` in turn, and problems."""
    changes: list[Change] = []
    problems: list[Problem] = []
    for swap in swaps:
        parsed = parse_assignment(swap, "--swap")
        if isinstance(parsed, Problem):
            problems.append(parsed)
        else:
            changes.append((SWAP + parsed[0], with_source_folder(parsed[1], Path.cwd())))
    values, wrong = read_sets(sets)
    for key, value in values:
        if key.startswith(SWAP):
            wrong.append(Problem(COMMAND_LINE, key, "types are changed with --swap", value))
        else:
            changes.append((key, value))
    own = (("seed", seed), ("duration_s", duration_s))
    changes += [(key, given) for key, given in own if given is not None]
    return changes, problems + wrong


def read_python_changes(values: Mapping[Any, Any], source: str) -> list[Change]:
    """Return a program's changes by `Scene.set` or `Scene.swap`; SceneError with all problems."""
    changes: list[Change] = []
    problems: list[Problem] = []
    for key, value in values.items():
        if not isinstance(key, str):
            problems.append(Problem(source, "", "a key must be text", key))
        elif source == IN_SET and key.startswith(SWAP):
            problems.append(Problem(source, key, "types are changed with scene.swap"))
        elif source == IN_SWAP and not isinstance(value, str | type):
            message = "must be a registered name, module:Class, or a class"
            problems.append(Problem(source, key, message, value))
        else:
            try:
                name = key if source == IN_SET else SWAP + key
                changes.append((name, to_scene_value(value)))
            except TypeError as error:
                problems.append(Problem(source, key, str(error)))
    if problems:
        raise SceneError(problems)
    return changes


def apply_changes(
    scene: SceneFile,
    changes: Iterable[Change],
    source: str = COMMAND_LINE,
    swap_source: str = COMMAND_LINE,
    option: str = "--swap",
) -> list[str]:
    """Apply changes to a scene's tables in place; return the keys of parameters swaps dropped.

    Messages say that values are from `source` and types from `swap_source`, there named `option`.
    """
    dropped: list[str] = []
    for key, value in changes:
        if key.startswith(SWAP):
            name = key.removeprefix(SWAP)
            dropped += swap_type(scene, name, value, swap_source, option)
        else:
            scene.problems += set_value(scene, key, deepcopy(value), source)
    return dropped


def apply_sets(study: SceneFile, assignments: Iterable[str]) -> None:
    """Apply all ``--set`` to a study's tables in place; refuse keys of blocks (below ``set``)."""
    values, problems = read_sets(assignments)
    study.problems += problems
    for text, value in values:
        if text.startswith("blocks."):
            message = f"is a key of the study's scene: set.{text}"
            study.problems.append(Problem(COMMAND_LINE, text, message))
        else:
            study.problems += set_value(study, text, value, COMMAND_LINE)


def set_value(scene: SceneFile, text: str, value: Any, source: str) -> list[Problem]:
    """Set the value at a dotted key of the scene's tables, and return the problems, if any.

    Items of lists go by number or name: ``blocks.traffic.intruders[0].east_m``, or
    ``blocks.traffic.intruders.head_on.east_m``.
    """
    try:
        value = _resolve_extends(value, source)
    except SceneError as error:
        return [replace(one, key=f"{text}.{one.key}") for one in error.problems]
    container: Any = scene.data
    key: list[str | int] = []
    rest = unquote_key(text)
    while True:
        index, part, rest = step_into_key(container, rest)
        if index is None and not rest and is_new_item(container, part, value):
            index, value = len(container), {"name": part, **value}
            container.append(value)
        if index is None:
            return [Problem(source, text, explain_no_item(container, part))]
        if key == ["blocks"] and index not in container:
            hint = did_you_mean(str(index), container)
            return [Problem(source, text, f"the scene has no block {part!r}{hint}")]
        key.append(index)
        if len(key) > DEEPEST:
            message = f"tables are nested too deeply: at most {DEEPEST} inside each other"
            return [Problem(source, text, message)]
        if not rest:
            container[index] = value
            break
        if isinstance(container, dict) and index not in container:
            container[index] = {}
            scene.sources[tuple(key)] = source
        elif (
            key[0] == "wires"
            and len(key) == 2
            and (table := _arrow_wire_as_table(container[index]))
        ):
            container[index] = table
        elif not isinstance(container[index], dict | list):
            return [Problem(source, text, f"{dotted_key(tuple(key))} is no table")]
        container = container[index]
    for source_key in [known for known in scene.sources if known[: len(key)] == tuple(key)]:
        del scene.sources[source_key]
    scene.sources[tuple(key)] = source
    scene.of_other_type.pop(tuple(key[:3]), None)
    return []


def _resolve_extends(value: Any, source: str) -> Any:
    """Return a value in which tables with ``extends`` are merged with what they extend."""
    if isinstance(value, list):
        return [_resolve_extends(item, source) for item in value]
    if not isinstance(value, dict):
        return value
    if "extends" in value:
        return read_scene_tables(value, source).data
    return {key: _resolve_extends(item, source) for key, item in value.items()}


def swap_type(
    scene: SceneFile, name: str, type_name: str, source: str, option: str = "--swap"
) -> list[str]:
    """Change a block's type in the tables; return the keys dropped as the new type lacks them."""
    if not isinstance(type_name, SourcedText):
        type_name = with_source_folder(type_name, Path.cwd())
    blocks = scene.data.get("blocks", {})
    if not isinstance(blocks, dict) or not isinstance(blocks.get(name), dict):
        hint = did_you_mean(name, blocks if isinstance(blocks, dict) else ())
        message = f"the scene has no such block{hint}"
        scene.problems.append(Problem(source, option or name, message, name))
        return []
    try:
        cls = find_component(type_name, dotted_key(_type_key(name)), (scene.path.parent,))
    except NotImported:  # what it would drop is not known: nothing is dropped
        blocks[name]["type"] = type_name
        scene.sources[_type_key(name)] = source
        return []
    except UnknownType as error:
        key = f"{option} {name}".strip()
        scene.problems.append(Problem(source, key, str(error), str(type_name)))
        return []
    block = blocks[name]
    dropped = sorted(key for key in block if key not in _allowed_block_keys(cls))
    for parameter in dropped:
        del block[parameter]
    block["type"] = type_name
    scene.sources[_type_key(name)] = source
    return [f"blocks.{name}.{parameter}" for parameter in dropped]


def drop_parameters_of_other_type(scene: SceneFile, name: str, cls: type[Component]) -> list[str]:
    """Drop parameters inherited from a table of another type that the own type `cls` lacks.

    Return a note on each parameter that was dropped, or is kept and means another thing.
    """
    block = scene.data["blocks"][name]
    notes = []
    for key, old in sorted(scene.of_other_type.items()):
        parameter = key[-1]
        mine = key[:2] == ("blocks", name) and parameter in block
        if mine and parameter not in _allowed_block_keys(cls):
            del block[parameter]
            notes.append(
                f"{dotted_key(key)} of {scene.source_file_of(key)} was dropped: it is a parameter "
                f"of "
                f"{old}, and {scene.source_file_of(_type_key(name))} makes {name} a {block['type']}"
            )
        elif mine and (meanings := _differing_descriptions(scene, old, cls, str(parameter))):
            notes.append(
                f"{dotted_key(key)} of {scene.source_file_of(key)} is kept, though it means "
                "another thing: "
                f"{meanings[0]!r} of {old}, {meanings[1]!r} of {block['type']}, which "
                f"{scene.source_file_of(_type_key(name))} makes {name}"
            )
    return notes


def _differing_descriptions(
    scene: SceneFile, old: str, cls: type[Component], parameter: str
) -> tuple[str, str] | None:
    """Return two types' descriptions of a parameter if they begin differently; else None."""
    if ":" in old:  # nothing foreign is imported for a note
        return None
    try:
        fields = find_component(old, "", (scene.path.parent,)).Parameters.model_fields
    except UnknownType:
        return None
    if parameter not in fields or parameter not in cls.Parameters.model_fields:
        return None
    descriptions = [of[parameter].description or "" for of in (fields, cls.Parameters.model_fields)]
    begin = [re.split(r"[,;:(]", text)[0].strip().rstrip(".") for text in descriptions]
    return None if begin[0] == begin[1] or not all(begin) else (begin[0], begin[1])


def _allowed_block_keys(cls: type[Component]) -> set[str]:
    return {"type", *BlockOptions.model_fields, *cls.Parameters.model_fields}


def _type_key(name: str) -> Key:
    return ("blocks", name, "type")


def _arrow_wire_as_table(entry: Any) -> dict[str, str] | None:
    """Return a wire written as ``a -> b`` as a table, for its options; None for anything else."""
    ends = [end.strip() for end in entry.split("->")] if isinstance(entry, str) else []
    return {"from": ends[0], "to": ends[1]} if len(ends) == 2 else None


def to_scene_value(value: Any, group: str = COMPONENTS) -> Any:
    """Return a Python value in the form that a scene file in the working directory would hold.

    NumPy's numbers and arrays are among them, and classes by their names, in the entry points of
    `group` where they are registered. Anything else is a TypeError.
    """
    if isinstance(value, bool | int | float):
        return value
    if isinstance(value, type):
        return class_name_in_scene(value, group)
    if isinstance(value, Path):
        return with_source_folder(str(value), Path.cwd())
    if isinstance(value, str):
        return value if hasattr(value, "folder") else with_source_folder(value, Path.cwd())
    if isinstance(value, Fraction):
        return to_scene_number(value)
    if isinstance(value, Mapping):
        for key in value:
            if not isinstance(key, str):
                raise TypeError(f"has the key {key!r}: keys are texts")
        return {str(key): to_scene_value(item, group) for key, item in value.items()}
    if isinstance(value, list | tuple | range):
        return [to_scene_value(item, group) for item in value]
    if hasattr(value, "tolist") and not isinstance(plain := value.tolist(), type(value)):
        return to_scene_value(plain, group)
    raise TypeError(
        f"is of the type {type(value).__name__}: a scene holds texts, numbers, truth values, "
        "lists and tables"
    )


def _tag_texts_with_working_folder(value: Any) -> Any:
    if isinstance(value, str):
        return with_source_folder(value, Path.cwd())
    if isinstance(value, list):
        return [_tag_texts_with_working_folder(item) for item in value]
    if isinstance(value, dict):
        return {key: _tag_texts_with_working_folder(item) for key, item in value.items()}
    return value
