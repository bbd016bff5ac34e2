"""Every key of scenes and metrics, read from the models of the blocks and of the engine."""

import typing
from collections.abc import Iterator
from typing import Any

from pydantic import BaseModel

from dsa_des.block.entry_points import entry_points_of
from dsa_des.block.registry import find_component
from dsa_des.commands.parameters import scene_tables
from dsa_des.studies.metric import METRICS, find_metric


def keys_of(model: type[BaseModel], prefix: str) -> Iterator[str]:
    """Give the dotted keys of a model; tables of several kinds go by their kind."""
    for name, info in model.model_fields.items():
        inner = list(_models(info.annotation))
        if not inner:
            yield f"{prefix}{name}"
        for nested in inner:
            kind = nested.model_fields.get("kind")
            kinds = typing.get_args(kind.annotation) if kind is not None else ()
            under = f"{prefix}{name}." + (f"{kinds[0]}." if kinds else "")
            yield from keys_of(nested, under)


def _models(annotation: Any) -> Iterator[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for argument in typing.get_args(annotation):
        yield from _models(argument)


def every_key() -> set[str]:
    """Return ``TYPE.key`` of blocks, ``[TABLE].key`` of all else, ``[metric NAME].key``."""
    found: set[str] = set()
    for kind in entry_points_of():
        found |= set(keys_of(find_component(kind).Parameters, f"{kind}."))
    for table, (_, rows) in scene_tables().items():
        found |= {f"[{table}].{row[0]}" for row in rows()}
    for name in entry_points_of(METRICS):
        found |= set(keys_of(find_metric(name).Parameters, f"[metric {name}]."))
    return found


if __name__ == "__main__":
    for key in sorted(every_key()):
        print(key)
