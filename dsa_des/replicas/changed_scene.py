"""The scene of one replica: that of all, with what the replica changes in it.

The scene is validated once; a replica validates again only the tables in which it changes
something.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import lru_cache
from typing import Any

from pydantic import BaseModel, ValidationError

from dsa_des.errors import Problem, SceneError, did_you_mean
from dsa_des.scene.block_table import Block, BlockOptions
from dsa_des.scene.changes import Stretch, common_ticks_per_s
from dsa_des.scene.checks import checked_ticks_per_s, read_clocks
from dsa_des.scene.keys import explain_no_item, item_index, unquote_key
from dsa_des.scene.parameter_errors import explain_validation_error
from dsa_des.scene.scene import Scene
from dsa_des.scene.scene_file import SceneFile
from dsa_des.scene.wiring import add_block_latencies
from dsa_des.time.clock import parse_rational


@dataclass(frozen=True)
class Replica:
    """One run: a seed, and what it changes in the scene, by dotted key.

    For example ``{"blocks.radar.offset_s": Fraction(1, 20)}``; blocks, wires and types stay as they
    are.
    """

    seed: int
    changes: Mapping[str, Any] = field(default_factory=dict)


def replica_scene(scene: Scene, replica: Replica) -> Scene:
    """Return the scene with the seed and the changes of one replica.

    A `SceneError` says which change names nothing in the scene, or is not allowed.
    """
    if not replica.changes:
        return replace(scene, seed=replica.seed)
    paths = {key: key_path(key) for key in replica.changes}
    try:
        blocks, sections, duration = _change_all_at_once(scene, replica.changes, paths)
    except (ValidationError, ValueError, LookupError, TypeError):
        blocks, sections, duration = _change_one_by_one(scene, replica.changes, paths)
    wires = scene.wires
    if any(blocks[name].options is not block.options for name, block in scene.blocks.items()):
        wires = add_block_latencies(wires, {name: block.options for name, block in blocks.items()})
    ticks_per_s = scene.ticks_per_s
    if wires is not scene.wires or duration is not scene.duration_s or _times_differ(scene, blocks):
        file = SceneFile(scene.path, {})
        clocks = read_clocks(file, blocks)
        ticks_per_s = checked_ticks_per_s(file, blocks, clocks, wires, duration)
        file.raise_if_problems()
    made = replace(
        scene,
        seed=replica.seed,
        blocks=blocks,
        sections=sections,
        wires=wires,
        duration_s=duration,
        ticks_per_s=ticks_per_s,
        stretches=[_replica_stretch(stretch, replica) for stretch in scene.stretches],
    )
    if made.stretches:
        file = SceneFile(scene.path, {})
        made.ticks_per_s = common_ticks_per_s(file, made)
        file.raise_if_problems()
    return made


def _replica_stretch(stretch: Stretch, replica: Replica) -> Stretch:
    """Return a stretch with a replica's changes, except to keys that the timed changes set."""
    fixed = [key_path(key) for key in stretch.keys]
    mine = {
        key: value
        for key, value in replica.changes.items()
        if not any(key_path(key)[: len(path)] == path for path in fixed)
    }
    return replace(stretch, scene=replica_scene(stretch.scene, Replica(replica.seed, mine)))


_Changed = tuple[dict[str, Block], dict[str, Any], Fraction | None]


def _change_all_at_once(
    scene: Scene, changes: Mapping[str, Any], paths: Mapping[str, Any]
) -> _Changed:
    """Return (blocks, sections, duration) with all changes made at once, tables validated once.

    Raises whatever is wrong with any change.
    """
    blocks, sections, duration = dict(scene.blocks), dict(scene.sections), scene.duration_s
    of_block: dict[str, dict[tuple[str | int, ...], Any]] = {}
    for key, value in changes.items():
        path = paths[key]
        if path[0] == "blocks" and len(path) > 2 and path[1] in blocks:
            of_block.setdefault(path[1], {})[path[2:]] = value
        elif path[0] in sections and len(path) > 1:
            sections[path[0]] = _replace_value(sections[path[0]], path[1:], value)
        elif path == ("duration_s",):
            duration = parse_rational(value)
        else:
            raise LookupError(key)
    for name, mine in of_block.items():
        block = blocks[name]
        of_engine = BlockOptions.model_fields.keys() - block.cls.Parameters.model_fields.keys()
        for path in [path for path in mine if path[0] in of_engine]:
            block = replace(block, options=_replace_value(block.options, path, mine.pop(path)))
        if mine:
            block = replace(block, parameters=_replace_values(block.parameters, mine))
        blocks[name] = block
    return blocks, sections, duration


#: Keys of a scene that are no changes of its replicas, and why not.
_THE_SAME = {
    "seed": "cannot be drawn: every replica has a seed of its own, of the study's",
    "wires": "cannot be drawn: wires are the same in all replicas, and can be an axis",
}


def _change_one_by_one(
    scene: Scene, changes: Mapping[str, Any], paths: Mapping[str, Any]
) -> _Changed:
    """Return (blocks, sections, duration) after changes one by one; `SceneError` names faults."""
    problems: list[Problem] = []
    blocks, sections, duration = dict(scene.blocks), dict(scene.sections), scene.duration_s
    for key, value in changes.items():
        path = paths[key]
        try:
            if path[0] == "blocks" and len(path) > 2 and path[1] in blocks:
                name = str(path[1])
                blocks[name] = _change_block(blocks[name], path[2:], value)
            elif path[0] in sections and len(path) > 1:
                sections[str(path[0])] = _replace_value(sections[str(path[0])], path[1:], value)
            elif path == ("duration_s",):
                duration = parse_rational(value)
            else:
                known = [f"blocks.{name}" for name in blocks] + [*sections, "duration_s"]
                hint = did_you_mean(".".join(map(str, path[:2])), known)
                why = _THE_SAME.get(str(path[0]), f"is no key of this scene{hint}")
                problems.append(_change_problem(scene, key, why, value))
        except ValidationError as error:
            file = SceneFile(scene.path, {})
            for problem in explain_validation_error(file, (), key, BlockOptions, error):
                problems.append(_change_problem(scene, key, problem.message, value))
        except (ValueError, LookupError, TypeError) as error:
            problems.append(_change_problem(scene, key, str(error), value))
    if problems:
        raise SceneError(problems) from None
    return blocks, sections, duration


def _times_differ(scene: Scene, blocks: Mapping[str, Block]) -> bool:
    """Return whether a clock or other exact time of any block differs from the scene's."""
    for name, block in scene.blocks.items():
        one, other = block.parameters, blocks[name].parameters
        if one is other:
            continue
        if block.cls.clock_of(one) != block.cls.clock_of(other):
            return True
        for what, value in other:
            if isinstance(value, Fraction) and value != getattr(one, what):
                return True
    return False


@lru_cache(maxsize=4096)
def key_path(key: str) -> tuple[str | int, ...]:
    """Return ``("blocks", "traffic", "intruders", 0)`` for ``blocks.traffic.intruders[0]``."""
    parts = unquote_key(key).replace("[", ".").replace("]", "").split(".")
    return tuple(
        int(part)
        if part.isascii() and part.isdecimal() and len(part) < 10 and str(int(part)) == part
        else part
        for part in parts
    )


def _change_problem(scene: Scene, key: str, message: str, value: Any) -> Problem:
    return Problem(
        str(scene.path), key, message, float(value) if isinstance(value, Fraction) else value
    )


def _change_block(block: Block, path: tuple[str | int, ...], value: Any) -> Block:
    name = path[0]
    if name in BlockOptions.model_fields and name not in block.cls.Parameters.model_fields:
        return replace(block, options=_replace_value(block.options, path, value))
    return replace(block, parameters=_replace_value(block.parameters, path, value))


def _replace_value(old: Any, path: tuple[str | int, ...], value: Any) -> Any:
    """Return `old` with the value at `path` replaced; every model on the way is validated again."""
    if not path:
        return value
    first, rest = path[0], path[1:]
    if isinstance(old, BaseModel):
        model = type(old)
        if first not in model.model_fields:
            hint = did_you_mean(str(first), model.model_fields)
            raise ValueError(f"there is no parameter {first!r}{hint}")
        given = {name: getattr(old, name) for name in old.model_fields_set}
        given[str(first)] = _replace_value(getattr(old, str(first)), rest, value)
        return model.model_validate(given)
    if isinstance(old, list | tuple):
        items = list(old)
        index, rest = item_index_and_path_rest(items, path)
        items[index] = _replace_value(items[index], rest, value)
        return items
    if isinstance(old, dict):
        return {**old, first: _replace_value(old.get(first), rest, value)}
    raise ValueError(f"{first!r}: there is no table around it")


def _replace_values(old: Any, changes: Mapping[tuple[str | int, ...], Any]) -> Any:
    """Return `old` with the values at many paths replaced; every model is validated once."""
    if () in changes and len(changes) > 1:
        raise ValueError  # a table and something in it: one after the other
    if len(changes) == 1:
        ((path, value),) = changes.items()
        return _replace_value(old, path, value)
    parts: dict[Any, dict[tuple[str | int, ...], Any]] = {}
    for path, value in changes.items():
        first, rest = path[0], path[1:]
        if isinstance(old, list | tuple):
            first, rest = item_index_and_path_rest(list(old), path)
        parts.setdefault(first, {})[rest] = value
    if isinstance(old, BaseModel):
        model = type(old)
        if not parts.keys() <= model.model_fields.keys():
            raise LookupError
        given = {name: getattr(old, name) for name in old.model_fields_set}
        for name, mine in parts.items():
            given[str(name)] = _replace_values(getattr(old, str(name)), mine)
        return model.model_validate(given)
    if isinstance(old, list | tuple):
        items = list(old)
        for index, mine in parts.items():
            items[index] = _replace_values(items[index], mine)
        return items
    if isinstance(old, dict):
        return {**old, **{n: _replace_values(old.get(n), mine) for n, mine in parts.items()}}
    raise ValueError


def item_index_and_path_rest(
    items: list[Any], path: tuple[str | int, ...]
) -> tuple[int, tuple[str | int, ...]]:
    """Return the item's index that a path's start names (number or name), and the path's rest.

    Names may hold the dots at which the path was split.
    """
    for length in range(len(path), 0, -1):
        index = item_index(items, ".".join(map(str, path[:length])))
        if index is not None:
            return index, path[length:]
    raise ValueError(explain_no_item(items, str(path[0])))
