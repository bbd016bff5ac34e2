"""What a shell may complete a word of the command line to: scenes, studies, keys, block types."""

from collections.abc import Iterable
from typing import Any

import click
from click.shell_completion import CompletionItem

from dsa_des.block.component import Component
from dsa_des.block.entry_points import entry_points_of
from dsa_des.block.registry import UnknownType, find_component
from dsa_des.commands.parameters import parameter_rows, scene_tables
from dsa_des.errors import SceneError
from dsa_des.scene.block_table import BlockOptions
from dsa_des.scene.examples import examples as shipped
from dsa_des.scene.examples import find_input_file
from dsa_des.scene.scene import Scene, load_scene


def scenes(ctx: click.Context, incomplete: str) -> list[CompletionItem]:
    """Return shipped scenes, and leave files to the shell."""
    return _complete_shipped("scene", incomplete)


def studies(ctx: click.Context, incomplete: str) -> list[CompletionItem]:
    """Return shipped studies, and leave files to the shell; the further commands at first."""
    further = [CompletionItem(name) for name in ("report", "show") if name.startswith(incomplete)]
    return further or _complete_shipped("study", incomplete)


def examples(ctx: click.Context, incomplete: str) -> list[CompletionItem]:
    """Return shipped scenes and studies, and leave files to the shell."""
    return _complete_shipped("scene", incomplete) + _complete_shipped("study", incomplete)


def cases(ctx: click.Context, incomplete: str) -> list[CompletionItem]:
    """Return shipped cases, and leave files to the shell."""
    return _complete_shipped("case", incomplete)


def types(ctx: click.Context, incomplete: str) -> list[CompletionItem]:
    """Return block types, their kinds and the tables of scenes."""
    names = entry_points_of()
    return _completion_items(
        {*names, *(name.partition(".")[0] for name in names), *scene_tables()}, incomplete
    )


def keys_of_type(ctx: click.Context, incomplete: str) -> list[CompletionItem]:
    """Return the keys of the block type that was named before."""
    try:
        return _completion_items(
            _parameter_keys(find_component(str(ctx.params.get("name")))), incomplete
        )
    except UnknownType:
        return []


def keys(ctx: click.Context, incomplete: str) -> list[CompletionItem]:
    """Return the keys that the scene named before has, as far as ``blocks.NAME.`` is typed."""
    scene = _read_typed_scene(ctx)
    if scene is None:
        return []
    names = {"seed", "duration_s"}
    for name, block in scene.blocks.items():
        names |= {f"blocks.{name}.{key}" for key in _parameter_keys(block.cls)}
    return [CompletionItem(f"{key}=") for key in sorted(names) if key.startswith(incomplete)]


def swaps(ctx: click.Context, incomplete: str) -> list[CompletionItem]:
    """Return the blocks of the scene named before, or the types of one's kind."""
    scene = _read_typed_scene(ctx)
    name, equals, begin = incomplete.partition("=")
    if not equals:
        return (
            _completion_items((f"{block}=" for block in scene.blocks), name)
            if scene is not None
            else []
        )
    kind = "" if scene is None else scene.blocks[name].type_name if name in scene.blocks else ""
    of_kind = [one for one in entry_points_of() if one.partition(".")[0] == kind.partition(".")[0]]
    return _completion_items(
        (f"{name}={one}" for one in of_kind or entry_points_of()), f"{name}={begin}"
    )


def _parameter_keys(cls: type[Component]) -> list[str]:
    return [
        row[0].strip() for model in (cls.Parameters, BlockOptions) for row in parameter_rows(model)
    ]


def _read_typed_scene(ctx: click.Context) -> Scene | None:
    """Return the scene that the words before name, if it can be read."""
    name: Any = ctx.params.get("scene") or next(iter(ctx.params.get("paths") or ()), None)
    if name is None and ctx.args:
        name = ctx.args[0]
    try:
        return None if name is None else load_scene(find_input_file(str(name), "scene"))
    except SceneError:
        return None


def _complete_shipped(kind: str, incomplete: str) -> list[CompletionItem]:
    items = _completion_items((one.name for one in shipped() if one.kind == kind), incomplete)
    return items or [CompletionItem(incomplete, type="file")]


def _completion_items(names: Iterable[str], incomplete: str) -> list[CompletionItem]:
    return [CompletionItem(name) for name in sorted(names) if name.startswith(incomplete)]
