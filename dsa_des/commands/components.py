"""``dsa-des components``: what blocks there are, and everything about one of them."""

import inspect
import types
import typing
from fractions import Fraction
from typing import Any

from pydantic import BaseModel
from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined
from rich.table import Table
from rich.text import Text

from dsa_des.block.component import Component
from dsa_des.block.entry_points import registered
from dsa_des.block.ladder import Ladder
from dsa_des.block.registry import UnknownType, find
from dsa_des.errors import UsageError
from dsa_des.terminal import terminal
from dsa_des.text.safe_text import printable

_UNITS = {
    "hz": "Hz", "s": "s", "ms": "ms", "m": "m", "km": "km", "deg": "deg", "rad": "rad",
    "db": "dB", "dbsm": "dBsm", "m2": "m²", "mps": "m/s", "w": "W", "ppm": "ppm",
    "deg_s": "deg/s", "mm_h": "mm/h", "pixels": "pixels",
}  # fmt: skip


def show_components(name: str | None) -> None:
    """Print the list of block types, or the description of one."""
    console = terminal.console(120)
    if name is None:
        _list(console)
        return
    try:
        cls = find(name)
    except UnknownType as error:
        raise UsageError(f"{name}: {error}") from error
    _describe(console, name, cls)


def _list(console: Any) -> None:
    table = Table(box=None, pad_edge=False)
    for heading in ("type", "takes", "sends", "what it is"):
        table.add_column(heading, no_wrap=heading == "type")
    for name in registered():
        try:
            cls = find(name)
        except UnknownType as error:  # somebody's broken plug-in must not hide the others
            table.add_row(name, "", "", f"cannot be loaded: {error}")
            continue
        table.add_row(name, _ports(cls.inputs), _ports(cls.outputs), _summary(cls))
    console.print(table)
    console.print()
    console.print("dsa-des components TYPE describes one; module:Class works as a type too.")


def _ports(ports: typing.Mapping[str, Any]) -> str:
    return ", ".join(sorted(ports)) or "-"


def _summary(cls: type[Component]) -> str:
    return (cls.__doc__ or "").strip().split("\n\n")[0].replace("\n", " ")


def _describe(console: Any, name: str, cls: type[Component]) -> None:
    console.print(Text.assemble((printable(name), "bold"), f"  {printable(cls.path())}"))
    console.print(Text(inspect.cleandoc(cls.__doc__ or "")))
    console.print()
    console.print(f"look-ahead windows: {'yes' if cls.windowed else 'no'}", highlight=False)
    sides: list[tuple[str, typing.Mapping[str, Any]]] = [
        ("inputs", cls.inputs),
        ("outputs", cls.outputs),
    ]
    for title, ports in sides:
        console.print()
        console.print(title, style="bold")
        if not ports:
            console.print("  none")
        for port, declared in sorted(ports.items()):
            mode = f", {declared.mode}" if title == "inputs" else ""
            many = ", many writers" if getattr(declared, "many", False) else ""
            optional = "" if getattr(declared, "required", True) else ", optional"
            line = f"  {port} ({declared.message.__name__}{mode}{many}{optional}): {declared.doc}"
            console.print(line, highlight=False)
    console.print()
    console.print("parameters", style="bold")
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
    for heading in ("  name", "type", "unit", "default", "meaning"):
        table.add_column(heading)
    for row in parameter_rows(cls.Parameters):
        table.add_row(*row)
    console.print(table, highlight=False)
    _describe_hooks(console, cls)
    for ladder in cls.ladders:
        _describe_ladder(console, ladder)


def _describe_hooks(console: Any, cls: type[Component]) -> None:
    """Print what effects may act on, how they are called there, and which effects do."""
    hooks = cls.all_hooks()
    if not hooks:
        return
    console.print()
    console.print("hooks, what effects may act on", style="bold")
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
    for heading in ("  hook", "what it calls", "effects"):
        table.add_column(heading)
    for hook, how in sorted(hooks.items()):
        names = ", ".join(effect.name for effect in cls.effects if effect.acts_on == hook)
        table.add_row(f"  {hook}", how, names or "-")
    console.print(table, highlight=False)


def _describe_ladder(console: Any, ladder: Ladder) -> None:
    units = ", ".join(f"{quantity.name} ({quantity.unit})" for quantity in ladder.quantities)
    console.print()
    console.print(f"ladder {ladder.name}, crude to exact; rungs differ in {units}", style="bold",
                  highlight=False)  # fmt: skip
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
    for heading in ("  rung", "type", "what it is"):
        table.add_column(heading)
    for rung in ladder.rungs:
        reference = " (reference)" if rung.name == ladder.reference else ""
        table.add_row(f"  {rung.name}{reference}", rung.type_name or "as it is", rung.what)
    console.print(table, highlight=False)


def parameter_rows(
    model: type[BaseModel], prefix: str = ""
) -> list[tuple[str, str, str, str, str]]:
    """Return name, type with bounds, unit, default and meaning of every parameter."""
    rows = []
    for name, info in model.model_fields.items():
        nested = _nested(info.annotation)
        kind = "table" if nested else _type_name(info.annotation)
        if nested and typing.get_origin(info.annotation) is list:
            kind = "list of tables"
        default = _default(info)
        if nested and default not in ("required", "-", "[]", "{}"):
            default = "see below"
        bounds = _bounds(info)
        rows.append(
            (f"  {prefix}{name}", kind + (f" {bounds}" if bounds else ""), _unit(name), default,
             info.description or "")
        )  # fmt: skip
        for inner in nested:
            rows += parameter_rows(inner, f"{prefix}{name}.")
    return rows


def _nested(annotation: Any) -> list[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    found: list[type[BaseModel]] = []
    for argument in typing.get_args(annotation):
        found += [model for model in _nested(argument) if model not in found]
    return found


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
    if origin is tuple:
        return f"[{', '.join(_type_name(a) for a in arguments)}]"
    if origin is not None:
        return f"{origin.__name__} of {', '.join(_type_name(a) for a in arguments)}"
    names = {float: "number", int: "whole number", str: "text", bool: "true or false"}
    return names.get(annotation, getattr(annotation, "__name__", str(annotation)).lower())


def _bounds(info: FieldInfo) -> str:
    signs = {"gt": ">", "ge": ">=", "lt": "<", "le": "<="}
    found = [
        f"{sign} {getattr(item, attribute):g}"
        for item in info.metadata
        for attribute, sign in signs.items()
        if isinstance(getattr(item, attribute, None), int | float)
    ]
    return ", ".join(found)


def _default(info: FieldInfo) -> str:
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


def _unit(name: str) -> str:
    parts = name.split("_")
    for length in (2, 1):
        suffix = "_".join(parts[-length:])
        if len(parts) > length and suffix in _UNITS:
            return _UNITS[suffix]
    return ""
