"""The keys of a scene file beside its blocks' own parameters: units, defaults, meaning."""

from collections.abc import Callable, Mapping
from functools import partial

from pydantic import BaseModel

from dsa_des.block.registry import section_models
from dsa_des.commands.parameter_rows import parameter_rows
from dsa_des.scene.block_table import BlockOptions, ProcessorParameters

#: Name, type with bounds, unit, default, meaning.
Row = tuple[str, str, str, str, str]

SCENE: tuple[Row, ...] = (
    ("title", "text", "", "the file's name", "What the scene is, for tables and figures."),
    ("description", "text", "", "-", "More about it."),
    ("duration_s", "number or fraction > 0", "s", "the sources' own", "Length of the run."),
    ("seed", "whole number >= 0", "", "0", "Of all random draws."),
    ("blocks", "tables", "", "required", "One table for each block, by its name."),
    ("wires", "list", "", "[]", "Who sends to whom: texts or tables."),
    ("processors", "tables", "", "-", "Shared processors, by name."),
)
ANYWHERE: tuple[Row, ...] = (
    ("extends", "text or list of texts", "", "-",
     "TOML files whose keys come first, from the folder of the file that says it; where there is "
     "no such file, shipped ones by their names. Where a block "
     "has another type than the one it extends, parameters that this type lacks are dropped."),
    ("remove", "list of texts", "", "-",
     "Inherited keys that are taken away, dotted from this table: [\"calibrate\"]. Items of a list "
     "with a name go by it: [\"intruders.head_on\"]."),
)  # fmt: skip
WIRES: tuple[Row, ...] = (
    ("from", "text", "", "required",
     "Block, or block.output. A text \"a -> b -> c\" is short for tables."),
    ("to", "text", "", "required", "Block, or block.input."),
    ("delay_s", "number or fraction >= 0", "s", "0", "Time that a message is on the wire."),
    ("delay", "text", "", "-", "\"1 scan\": a delay in scans of the receiving block's clock."),
    ("jitter_s", "number or fraction >= 0", "s", "0", "Largest extra delay; each message draws."),
    ("drop_probability", "number >= 0, <= 1", "", "0", "Share of messages that are lost."),
    ("holds", "\"nothing\" or table", "", "-", "What the input holds before the first message; a "
     "feedback wire must say it."),
)  # fmt: skip


def scene_tables() -> Mapping[str, tuple[str, Callable[[], list[Row]]]]:
    """Return name → (what it is, its rows on demand) of all that a scene may hold."""
    known: dict[str, tuple[str, Callable[[], list[Row]]]] = {
        "scene": ("Keys at the top of a scene file.", lambda: list(SCENE)),
        "extends": ("Keys that any table of a scene may have.", lambda: list(ANYWHERE)),
        "blocks": (
            "Keys of [blocks.NAME] that every type has, beside `type` and its own parameters.",
            lambda: _rows(BlockOptions),
        ),
        "wires": ("Keys of an item of `wires`.", lambda: list(WIRES)),
        "processors": ("Keys of [processors.NAME].", lambda: _rows(ProcessorParameters)),
    }
    for name, model in section_models().items():
        doc = (model.__doc__ or "").strip().split("\n\n")[0].replace("\n", " ")
        known[name] = (f"Keys of [{name}]: {doc}", partial(_rows, model))
    return known


def _rows(model: type[BaseModel]) -> list[Row]:
    return [
        (name.strip(), kind, unit, default, meaning)
        for name, kind, unit, default, meaning in parameter_rows(model)
    ]
