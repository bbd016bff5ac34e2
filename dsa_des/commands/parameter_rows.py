"""The parameters of a model as rows of a table: type, bounds, unit, default, meaning."""

import types
import typing
from fractions import Fraction
from typing import Any

from pydantic import BaseModel
from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined

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
            (f"  {prefix}{name}", kind + (f" {bounds}" if bounds else ""), _unit(name, kind),
             default, info.description or "")
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


def _unit(name: str, kind: str) -> str:
    if kind == "whole number" and name.endswith("_m"):
        return ""  # a count: the m of m out of n
    parts = name.split("_")
    for length in (2, 1):
        suffix = "_".join(parts[-length:])
        if len(parts) > length and suffix in _UNITS:
            return _UNITS[suffix]
    return ""
