"""Parameters of models, and the keys of scene files beside them, as rows of tables."""

import types
import typing
from collections.abc import Callable, Mapping
from dataclasses import is_dataclass
from fractions import Fraction
from functools import partial
from typing import Any

from pydantic import BaseModel
from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined

from dsa_des.block.parameters import nested_models
from dsa_des.block.registry import section_models
from dsa_des.scene.block_table import BlockOptions, ProcessorParameters
from dsa_des.scene.changes import changeable_keys
from dsa_des.stretches.outage import Outage

_UNITS = {
    "hz": "Hz", "s": "s", "ms": "ms", "m": "m", "km": "km", "deg": "deg", "rad": "rad",
    "db": "dB", "dbsm": "dBsm", "m2": "m²", "mps": "m/s", "w": "W", "ppm": "ppm",
    "deg_s": "deg/s", "mm_h": "mm/h", "m_s": "m/s", "m2_s3": "m²/s³", "g_m3": "g/m³",
    "pixels": "pixels", "c": "°C",
}  # fmt: skip


def parameter_rows(
    model: type[BaseModel], prefix: str = ""
) -> list[tuple[str, str, str, str, str]]:
    """Return name, type with bounds, unit, default and meaning of every parameter."""
    rows, changing = [], changeable_keys(model)
    for name, info in model.model_fields.items():
        nested = nested_models(info.annotation)
        kind = "table" if nested else _type_name(info.annotation)
        if nested and typing.get_origin(info.annotation) is list:
            kind = "list of tables"
        default = _default_text(info)
        if nested and default not in ("required", "-", "[]", "{}"):
            default = "see below"
        bounds = _bounds_text(info)
        # A field whose name ends like a unit says that it has none.
        said = info.json_schema_extra if isinstance(info.json_schema_extra, dict) else {}
        unit = str(said.get("unit", _unit_from_name(name, kind)))
        meaning = info.description or ""
        meaning += " May change while a run lasts." if name in changing else ""
        kind += f" {bounds}" if bounds else ""
        rows.append((f"  {prefix}{name}", kind, unit, default, meaning))
        for inner in nested:
            rows += parameter_rows(inner, f"{prefix}{name}.")
    return rows


def _type_name(annotation: Any) -> str:
    if annotation is Fraction:
        return "number or fraction"
    origin, arguments = typing.get_origin(annotation), typing.get_args(annotation)
    if origin is typing.Annotated:
        return _type_name(arguments[0])
    if origin in (typing.Union, types.UnionType):
        return " or ".join(_type_name(a) for a in arguments if a is not type(None))
    if origin is typing.Literal:
        return " | ".join(str(value) for value in arguments)
    if origin is tuple and arguments[-1] is Ellipsis:
        return f"list of {_type_name(arguments[0])}"
    if origin is tuple:
        return f"[{', '.join(_type_name(a) for a in arguments)}]"
    if origin is not None:
        return f"{origin.__name__} of {', '.join(_type_name(a) for a in arguments)}"
    if is_dataclass(annotation):  # what was read from a file that a scene names
        return "path"
    names = {float: "number", int: "whole number", str: "text", bool: "true or false"}
    return names.get(annotation, getattr(annotation, "__name__", str(annotation)).lower())


def _bounds_text(info: FieldInfo) -> str:
    signs = {"gt": ">", "ge": ">=", "lt": "<", "le": "<="}
    bounds = [
        f"{sign} {getattr(item, attribute):g}"
        for item in info.metadata
        for attribute, sign in signs.items()
        if isinstance(getattr(item, attribute, None), int | float)
    ]
    return ", ".join(bounds)


def _default_text(info: FieldInfo) -> str:
    # What tells tables of a list apart has to be given.
    tag = typing.get_origin(info.annotation) is typing.Literal
    if tag and len(typing.get_args(info.annotation)) == 1:
        return "required"
    if info.default is PydanticUndefined:
        return "required" if info.is_required() else "-"
    value = info.default
    if value is None:
        return "-"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, tuple):
        return str(list(value))
    return str(value)


def _unit_from_name(name: str, kind: str) -> str:
    if kind == "whole number" and name.endswith("_m"):
        return ""  # a count: the m of m out of n
    if kind == "true or false":
        return ""
    parts = name.split("_")
    for length in (2, 1):
        suffix = "_".join(parts[-length:])
        if len(parts) > length and suffix in _UNITS:
            return _UNITS[suffix]
    return ""


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
    ("outages", "list of tables", "", "[]", "Blocks that fail at random, and are repaired."),
    (
        "changes",
        "list of tables",
        "",
        "[]",
        "What is otherwise from an instant on, or for a while.",
    ),
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


CHANGES: tuple[Row, ...] = (
    ("at_s", "number or fraction >= 0", "s", "-", "From when on, for good: until the next change "
     "of the same key. Either this or the next two."),
    ("from_s", "number or fraction >= 0", "s", "-", "From when on, for a while."),
    ("to_s", "number or fraction >= 0", "s", "-", "First instant at which all is as before again."),
    ("set", "table", "", "required", "Dotted keys and their values then. Keys that may change are "
     "marked so."),
)  # fmt: skip


def scene_tables() -> Mapping[str, tuple[str, Callable[[], list[Row]]]]:
    """Return name → (description, function returning its rows) of every table of a scene."""
    known: dict[str, tuple[str, Callable[[], list[Row]]]] = {
        "scene": ("Keys at the top of a scene file.", lambda: list(SCENE)),
        "extends": ("Keys that any table of a scene may have.", lambda: list(ANYWHERE)),
        "blocks": (
            "Keys of [blocks.NAME] that every type has, beside `type` and its own parameters.",
            lambda: _unindented_parameter_rows(BlockOptions),
        ),
        "wires": ("Keys of an item of `wires`.", lambda: list(WIRES)),
        "outages": ("Keys of an item of `outages`.", lambda: _unindented_parameter_rows(Outage)),
        "changes": ("Keys of an item of `changes`.", lambda: list(CHANGES)),
        "processors": (
            "Keys of [processors.NAME].",
            lambda: _unindented_parameter_rows(ProcessorParameters),
        ),
    }
    for name, model in section_models().items():
        doc = (model.__doc__ or "").strip().split("\n\n")[0].replace("\n", " ")
        known[name] = (f"Keys of [{name}]: {doc}", partial(_unindented_parameter_rows, model))
    return known


def _unindented_parameter_rows(model: type[BaseModel]) -> list[Row]:
    return [
        (name.strip(), kind, unit, default, meaning)
        for name, kind, unit, default, meaning in parameter_rows(model)
    ]
