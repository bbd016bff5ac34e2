"""Changes from the command line: ``--set key=value`` and ``--swap block=type``.

They are two verbs: `--set` changes one value; `--swap` puts another type into a block, keeps its
name, its wires and the parameters the new type knows, and lists those it dropped.
"""

import re
from pathlib import Path
from typing import Any

from dsa_des.block.class_text import sourced
from dsa_des.block.registry import NotImported, UnknownType, find
from dsa_des.errors import Problem, did_you_mean
from dsa_des.files.toml_input import DEEPEST, NotToml, TomlError, parse_toml
from dsa_des.scene.options import BlockOptions
from dsa_des.scene.scene_file import COMMAND_LINE, Key, SceneFile, dotted

#: An item of a list, ``[3]`` or ``3``, and what follows it.
_INDEX = re.compile(r"[0-9]{1,9}")
_ITEM = re.compile(r"\[?([^.\[\]]*)\]?\.?(.*)")


def parse_assignment(text: str, option: str) -> tuple[str, str] | Problem:
    """Split ``key=value``; a Problem when there is no ``=`` or an empty side."""
    key, equals, value = text.partition("=")
    if not equals or not key.strip() or not value.strip():
        form = "BLOCK=TYPE" if option == "--swap" else "KEY=VALUE"
        return Problem(COMMAND_LINE, option, f"must have the form {form}", text)
    return key.strip(), value.strip()


def parse_value(text: str) -> Any:
    """Return a value as TOML would read it; what is not TOML is text.

    Raises
    ------
    TomlError
        If it is nested too deeply or holds a whole number of too many digits.
    """
    try:
        value = parse_toml(f"value = {text}")
    except NotToml:
        return _sourced(text)
    # What follows a line's end would be further keys.
    return _sourced(value["value"] if set(value) == {"value"} else text)


def apply_set(scene: SceneFile, assignment: str) -> list[Problem]:
    """Apply one ``--set`` to the scene's tables and return what is wrong with it."""
    parsed = parse_assignment(assignment, "--set")
    if isinstance(parsed, Problem):
        return [parsed]
    text, written = parsed
    try:
        value = parse_value(written)
    except TomlError as error:
        return [Problem(COMMAND_LINE, text, str(error))]
    return set_value(scene, text, value, COMMAND_LINE)


def set_value(scene: SceneFile, text: str, value: Any, source: str) -> list[Problem]:
    """Put a value at a dotted key of the scene's tables and return what is wrong with that.

    Parameters
    ----------
    scene : SceneFile
    text : str
        The dotted key, for example ``blocks.traffic.intruders[0].east_m``.
    value : object
        As TOML would give it.
    source : str
        Where it was written, for messages.
    """
    container: Any = scene.data
    key: list[str | int] = []
    rest = text.replace('"', "")
    while True:
        step, part, rest = _step(container, rest)
        if isinstance(step, str) and isinstance(container, list):
            message = f"there is no item {part!r}: the list has {len(container)} (from 0)"
            return [Problem(source, text, message)]
        if key == ["blocks"] and step not in container:
            hint = did_you_mean(str(step), container)
            return [Problem(source, text, f"the scene has no block {part!r}{hint}")]
        key.append(step)
        if len(key) > DEEPEST:
            message = f"tables are nested too deeply: at most {DEEPEST} inside each other"
            return [Problem(source, text, message)]
        if not rest:
            container[step] = value
            break
        if isinstance(container, dict) and step not in container:
            container[step] = {}
            scene.sources[tuple(key)] = source
        elif key[0] == "wires" and len(key) == 2 and (table := _wire_table(container[step])):
            container[step] = table
        elif not isinstance(container[step], dict | list):
            return [Problem(source, text, f"{dotted(tuple(key))} is no table")]
        container = container[step]
    for source_key in [known for known in scene.sources if known[: len(key)] == tuple(key)]:
        del scene.sources[source_key]
    scene.sources[tuple(key)] = source
    return []


def apply_swap(scene: SceneFile, assignment: str) -> tuple[list[Problem], list[str]]:
    """Apply one ``--swap``; return what is wrong with it and the dropped parameters' keys."""
    parsed = parse_assignment(assignment, "--swap")
    if isinstance(parsed, Problem):
        return [parsed], []
    return swap_type(scene, *parsed, COMMAND_LINE)


def swap_type(
    scene: SceneFile, name: str, type_name: str, source: str
) -> tuple[list[Problem], list[str]]:
    """Put another type into a block of the scene's tables.

    Parameters
    ----------
    scene : SceneFile
    name, type_name : str
        The block and its new type.
    source : str
        Where it was written, for messages.

    Returns
    -------
    list of Problem
        What is wrong with it, with the key ``--swap``.
    list of str
        Dotted keys of parameters that the new type lacks.
    """
    blocks = scene.data.get("blocks", {})
    if not isinstance(blocks, dict) or not isinstance(blocks.get(name), dict):
        hint = did_you_mean(name, blocks if isinstance(blocks, dict) else ())
        return [Problem(source, "--swap", f"the scene has no block{hint}", name)], []
    try:
        cls = find(type_name, dotted(_type_key(name)))
    except NotImported:  # what it would drop is not known: nothing is dropped
        blocks[name]["type"] = _sourced(type_name)
        scene.sources[_type_key(name)] = source
        return [], []
    except UnknownType as error:
        return [Problem(source, f"--swap {name}", str(error), str(type_name))], []
    block = blocks[name]
    known = {"type", *BlockOptions.model_fields, *cls.Parameters.model_fields}
    dropped = sorted(key for key in block if key not in known)
    for parameter in dropped:
        del block[parameter]
    block["type"] = _sourced(type_name)
    scene.sources[_type_key(name)] = source
    return [], [f"blocks.{name}.{parameter}" for parameter in dropped]


def _type_key(name: str) -> Key:
    return ("blocks", name, "type")


def _wire_table(entry: Any) -> dict[str, str] | None:
    """Return the table of a wire written as ``"a -> b"``, so that its options can be set."""
    ends = [end.strip() for end in entry.split("->")] if isinstance(entry, str) else []
    return {"from": ends[0], "to": ends[1]} if len(ends) == 2 else None


def _step(container: Any, rest: str) -> tuple[str | int, str, str]:
    """Return the next step into a container, as it was written, and what is left of the key.

    A key that is already there is found whole, dots and brackets included: a study has axes of
    names such as ``wires[4].drop_probability``.
    """
    if isinstance(container, list):
        part, tail = _ITEM.match(rest).groups()  # type: ignore[union-attr]
        inside = _INDEX.fullmatch(part) is not None and int(part) < len(container)
        return int(part) if inside else part, part, tail
    there = [
        name for name in container if rest == name or rest.startswith((f"{name}.", f"{name}["))
    ]
    part = max(there, key=len, default=rest.partition(".")[0])
    return part, part, rest[len(part) :].removeprefix(".")


def _sourced(value: Any) -> Any:
    if isinstance(value, str):
        return sourced(value, Path.cwd())
    if isinstance(value, list):
        return [_sourced(item) for item in value]
    if isinstance(value, dict):
        return {key: _sourced(item) for key, item in value.items()}
    return value
