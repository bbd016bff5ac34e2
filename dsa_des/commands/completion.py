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
    """Return shipped scenes that begin with the typed text; files are left to the shell."""
    return _complete_shipped("scene", incomplete)


def studies(ctx: click.Context, incomplete: str) -> list[CompletionItem]:
    """Return further commands, else shipped studies, that begin with the text; no file names."""
    further = [CompletionItem(name) for name in ("report", "show") if name.startswith(incomplete)]
    return further or _complete_shipped("study", incomplete)


def examples(ctx: click.Context, incomplete: str) -> list[CompletionItem]:
    """Return shipped scenes and studies that begin with the text; files are the shell's."""
    return _complete_shipped("scene", incomplete) + _complete_shipped("study", incomplete)


def cases(ctx: click.Context, incomplete: str) -> list[CompletionItem]:
    """Return the shipped cases that begin with the typed text; file names are left to the shell."""
    return _complete_shipped("case", incomplete)


def types(ctx: click.Context, incomplete: str) -> list[CompletionItem]:
    """Return block types, their kinds and scene tables that begin with the typed text."""
    names = entry_points_of()
    return _completion_items(
        {*names, *(name.partition(".")[0] for name in names), *scene_tables()}, incomplete
    )


def keys_of_type(ctx: click.Context, incomplete: str) -> list[CompletionItem]:
    """Return keys that begin with the text, of the block type named earlier on the line."""
    try:
        return _completion_items(
            _parameter_keys(find_component(str(ctx.params.get("name")))), incomplete
        )
    except UnknownType:
        return []


def keys(ctx: click.Context, incomplete: str) -> list[CompletionItem]:
    """Return keys with ``=``, that begin with the text, of the scene earlier on the line."""
    scene = _read_typed_scene(ctx)
    if scene is None:
        return []
    names = {"seed", "duration_s"}
    for name, block in scene.blocks.items():
        names |= {f"blocks.{name}.{key}" for key in _parameter_keys(block.cls)}
    return [CompletionItem(f"{key}=") for key in sorted(names) if key.startswith(incomplete)]


def swaps(ctx: click.Context, incomplete: str) -> list[CompletionItem]:
    """Return ``BLOCK=TYPE`` completions: the earlier scene's blocks, then types of that kind."""
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
    """Return the scene that is named earlier on the command line, or None if it cannot be read."""
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
