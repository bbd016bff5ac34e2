"""Scenes of many replicas whose drawn values are checked as columns: no scene for each of them.

What a value is checked by is known: its field's type and bounds, and validators of the tables
around it. Where no validator reads any of the fields that are drawn, which is watched, a value is
allowed or not by itself; and where a field has nothing but bounds, so are all values between two
that are allowed. So three replicas are made and checked, with the lowest and the highest of every
column and with those closest to 0, and stand for all. What cannot be checked like that, and all of
them where one of the three is refused, is checked replica by replica.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import lru_cache
from inspect import signature
from types import UnionType
from typing import Any, Union, get_args, get_origin, overload

from annotated_types import Ge, Gt, Le, Lt
from pydantic import AfterValidator, BaseModel, BeforeValidator, PlainSerializer

from dsa_des.block.component import ClockedParameters, Component, Parameters
from dsa_des.errors import SceneError
from dsa_des.replicas.changed_scene import (
    Replica,
    item_index_and_path_rest,
    key_path,
    replica_scene,
)
from dsa_des.scene.block_table import BlockOptions
from dsa_des.scene.scene import Scene
from dsa_des.time.clock import NANOSECONDS, parse_rational

#: Of fewer replicas each is checked by itself: to learn what validators read costs more.
_FEWEST = 12
_BOUNDS = (Ge, Gt, Le, Lt)
Path = tuple[str | int, ...]


@dataclass(frozen=True)
class DrawnColumn:
    """The values of one drawn key in all replicas, of the type that its field holds.

    The path is where it stands in the block's parameters: names of fields, and numbers of items.
    """

    block: str
    path: Path
    values: Sequence[Any]


class ReplicaScenes(Sequence[Scene]):
    """Scenes of replicas that differ in seeds and drawn values only; each is made when read.

    What columns hold counts instead of what `scene`, a checked one of them, says there.
    """

    def __init__(self, scene: Scene, seeds: Sequence[int], columns: Sequence[DrawnColumn]) -> None:
        self._scene, self._drawn = scene, columns
        self.seeds = seeds

    def __len__(self) -> int:
        return len(self.seeds)

    @overload
    def __getitem__(self, index: int) -> Scene: ...

    @overload
    def __getitem__(self, index: slice) -> "ReplicaScenes": ...

    def __getitem__(self, index: int | slice) -> "Scene | ReplicaScenes":
        if isinstance(index, slice):
            columns = [replace(column, values=column.values[index]) for column in self._drawn]
            return ReplicaScenes(self._scene, self.seeds[index], columns)
        blocks = dict(self._scene.blocks)
        for name in {column.block for column in self._drawn}:
            parameters = self._parameters_of(name, index)
            blocks[name] = replace(blocks[name], parameters=parameters)
        return replace(self._scene, seed=self.seeds[index], blocks=blocks)

    def parameters_of(self, block: str) -> list[Any]:
        """Return a list of a block's parameters in each replica."""
        if not any(column.block == block for column in self._drawn):
            return [self._scene.blocks[block].parameters] * len(self)
        return [self._parameters_of(block, number) for number in range(len(self))]

    def differing_parameters(self, block: str) -> set[str]:
        """Return the names of a block's parameters that differ between replicas."""
        return {
            str(column.path[0])
            for column in self._drawn
            if column.block == block and any(v != column.values[0] for v in column.values)
        }

    def _parameters_of(self, block: str, number: int) -> Any:
        changes = {c.path: c.values[number] for c in self._drawn if c.block == block}
        return _replace_checked_values(self._scene.blocks[block].parameters, changes)


def _replace_checked_values(old: Any, changes: Mapping[Path, Any]) -> Any:
    """Return a copy of a table with values at some paths replaced, without validation."""
    parts: dict[Any, dict[Path, Any]] = {}
    for path, value in changes.items():
        parts.setdefault(path[0], {})[path[1:]] = value
    if not isinstance(old, BaseModel):
        items = list(old)
        for index, mine in parts.items():
            items[index] = mine[()] if () in mine else _replace_checked_values(items[index], mine)
        return type(old)(items)
    fields = {name: old.__dict__[name] for name in _fields_of(type(old))}
    for name, mine in parts.items():
        fields[name] = mine[()] if () in mine else _replace_checked_values(fields[name], mine)
    return _make_model(type(old), fields, set(old.model_fields_set))


@lru_cache(maxsize=256)
def _fields_of(model: type[BaseModel]) -> tuple[str, ...]:
    return tuple(model.model_fields)


def _make_model(model: type[BaseModel], fields: dict[str, Any], given: set[str]) -> BaseModel:
    new = model.__new__(model)
    object.__setattr__(new, "__dict__", fields)
    object.__setattr__(new, "__pydantic_fields_set__", given)
    object.__setattr__(new, "__pydantic_extra__", None)
    object.__setattr__(new, "__pydantic_private__", None)
    return new


def scenes_from_drawn_columns(scene: Scene, replicas: Sequence[Replica]) -> ReplicaScenes | None:
    """Return the scenes of replicas that differ only in seeds and drawn values, each drawn key
    validated as one column; None where that is not possible.

    Then every one has to be made and checked by itself (`replica_scene`), which also says what is
    wrong.
    """
    if len(replicas) < _FEWEST or scene.stretches:
        return None
    keys = replicas[0].changes.keys()
    if any(replica.changes.keys() != keys for replica in replicas):
        return None
    try:
        columns = {
            key: _checked_column(scene, key, [r.changes[key] for r in replicas]) for key in keys
        }
        seeds = [replica.seed for replica in replicas]
        probes = [{key: pick(c.values) for key, c in columns.items()} for pick in _PROBES]
        made = [replica_scene(scene, Replica(seeds[0], probe)) for probe in probes]
        return ReplicaScenes(
            made[0], seeds, _check_drawn_fields_unread(made[0], list(columns.values()))
        )
    except (_NoColumn, SceneError):
        return None


def replica_scenes(scene: Scene, replicas: Sequence[Replica]) -> Sequence[Scene]:
    """Return the scenes of all replicas, in order.

    Raises
    ------
    SceneError
        As `replica_scene`, for the first replica with something wrong.
    """
    together = scenes_from_drawn_columns(scene, replicas)
    return [replica_scene(scene, replica) for replica in replicas] if together is None else together


#: Which replicas stand for all: those with the lowest and highest values, and those closest to 0.
_PROBES: tuple[Callable[[Sequence[Any]], Any], ...] = (
    min, max, lambda values: min(values, key=lambda value: (value == 0, abs(value))),
)  # fmt: skip


class _NoColumn(Exception):
    """These values cannot be checked as columns."""


def _checked_column(scene: Scene, key: str, values: Sequence[Any]) -> DrawnColumn:
    """Return a drawn key's values as its field holds them; `_NoColumn` if not possible."""
    path = key_path(key)
    if len(path) < 3 or path[0] != "blocks" or path[1] not in scene.blocks:
        raise _NoColumn
    block = scene.blocks[str(path[1])]
    if path[2] in BlockOptions.model_fields and path[2] not in type(block.parameters).model_fields:
        raise _NoColumn
    found, model, name = _locate_field(block.parameters, path[2:])
    return DrawnColumn(block.name, found, _validate_values(model, name, values))


def _locate_field(parameters: Any, path: Path) -> tuple[Path, type[BaseModel], str]:
    """Return a field's path with list items by number, its model, and its name."""
    found: list[str | int] = []
    old: Any = parameters
    while path:
        if isinstance(old, BaseModel):
            model, name = type(old), str(path[0])
            if name not in model.model_fields or not _can_check_columns(model):
                raise _NoColumn
            old, path = getattr(old, name), path[1:]
            found.append(name)
            if not path:
                return tuple(found), model, name
        elif type(old) in (list, tuple):
            try:
                index, path = item_index_and_path_rest(old, path)
            except ValueError:
                raise _NoColumn from None
            found.append(index)
            old = old[index]
        else:
            break
    raise _NoColumn


def _can_check_columns(model: type[BaseModel]) -> bool:
    """Return whether no validator of the model bars checking a field's values as a column."""
    known = model.__pydantic_decorators__
    alien = (
        model.__init__ is not BaseModel.__init__
        or "model_validate" in _declared_names(model)
        or model.__private_attributes__
        or model.model_config.get("extra") == "allow"
        or known.root_validators
        or known.validators
        or any(found.info.mode != "after" for found in known.model_validators.values())
        or any(
            len(signature(found.func).parameters) > 1 and not _is_common_validator(found.func)
            for found in known.field_validators.values()
        )
        or any(field.default_factory_takes_validated_data for field in model.model_fields.values())
    )
    return not alien and all(
        len(signature(check.func).parameters) == 1
        for field in model.model_fields.values()
        for check in field.metadata
        if isinstance(check, AfterValidator | BeforeValidator)
    )


def _declared_names(cls: type, known: type = BaseModel) -> set[str]:
    """Return all attribute names that a class and its bases define, up to the base `known`."""
    bases = cls.__mro__[: cls.__mro__.index(known)] if known in cls.__mro__ else cls.__mro__
    return {name for base in bases for name in vars(base)}


def _is_common_validator(function: Any) -> bool:
    """Return whether a function is the extreme-number validator of all `Parameters` classes."""
    return getattr(function, "__func__", None) is Parameters._computable.__func__  # type: ignore[attr-defined]


def _validate_values(model: type[BaseModel], name: str, values: Sequence[Any]) -> list[Any]:
    """Return type-checked values as the field holds them; `_NoColumn` if more than bounds apply."""
    field = model.model_fields[name]
    union = get_origin(field.annotation) in (Union, UnionType)
    options = get_args(field.annotation) if union else (field.annotation,)
    ((kind, *others),) = [set(options) - {type(None)}]
    validators = model.__pydantic_decorators__.field_validators.values()
    mine = [v for v in validators if name in v.info.fields or "*" in v.info.fields]
    if others or not all(_is_common_validator(found.func) for found in mine):
        raise _NoColumn
    exact = kind is Fraction
    for check in field.metadata:
        read = isinstance(check, BeforeValidator) and check.func is parse_rational
        if not (isinstance(check, _BOUNDS) or (exact and (read or type(check) is PlainSerializer))):
            raise _NoColumn
    if kind is float and all(type(v) is float for v in values):
        held: list[Any] = list(values)
    elif kind is float and all(type(v) in (int, float) for v in values):
        held = [float(v) for v in values]
    elif kind is int and all(type(v) is int for v in values):
        held = list(values)
    elif exact and all(type(v) is Fraction for v in values):
        held = [parse_rational(v) for v in values]
    else:
        raise _NoColumn
    if kind is float and not all(map(math.isfinite, held)):
        raise _NoColumn
    return held


def _check_drawn_fields_unread(
    scene: Scene, columns: Sequence[DrawnColumn]
) -> Sequence[DrawnColumn]:
    """Return the columns unchanged if no validator reads the drawn fields and clocks read at most
    their offset; raise `_NoColumn` otherwise.

    Ticks of a second and times that they can hold are then those of the replicas that were checked.
    """
    for name in {column.block for column in columns}:
        mine = [column for column in columns if column.block == name]
        block = scene.blocks[name]
        try:
            with _track_reads() as read:
                parameters = _validate_and_note_reads(
                    block.parameters, [column.path for column in mine]
                )
                if read:
                    raise _NoColumn
                block.cls.clock_of(parameters)
                own_clock = bool(read)
        except Exception as error:  # a stranger's validator, in a class derived from its own
            raise _NoColumn from error
        for column in mine if own_clock else ():
            if (
                "clock_of" in _declared_names(block.cls, Component)
                or "clock_spec" in _declared_names(type(block.parameters), ClockedParameters)
                or column.path == ("scan_rate_hz",)
                or any(NANOSECONDS % value.denominator for value in _clock_offsets(column))
            ):
                raise _NoColumn
    return columns


def _clock_offsets(column: DrawnColumn) -> Sequence[Fraction]:
    return column.values if column.path == ("offset_s",) else ()


def _validate_and_note_reads(old: Any, paths: Sequence[Path]) -> Any:
    """Validate a table again with classes that note each read of the fields at the given paths."""
    parts: dict[Any, list[Path]] = {}
    for path in paths:
        parts.setdefault(path[0], []).append(path[1:])
    if not isinstance(old, BaseModel):
        items = list(old)
        for index, mine in parts.items():
            items[index] = _validate_and_note_reads(items[index], mine)
        return items
    given = {name: getattr(old, name) for name in old.model_fields_set | parts.keys()}
    for name, mine in parts.items():
        if mine != [()]:
            given[name] = _validate_and_note_reads(given[name], mine)
    drawn = frozenset(name for name, mine in parts.items() if mine == [()])
    return _watched_type(type(old), drawn).model_validate(given)


#: Fields that were read while `_track_reads`, by watched types; None at other times.
_noted: list[set[str]] = []
# What does not show any field's value. All else of a model's own may show all of them.
_HARMLESS = frozenset({"__class__", "__pydantic_fields_set__"})
_ALL_FIELDS = frozenset(dir(BaseModel)) - _HARMLESS - {"model_fields", "model_fields_set"}


@contextmanager
def _track_reads() -> Iterator[set[str]]:
    """Yield a set to which the names of watched fields are added when read in the context."""
    _noted.append(set())
    try:
        yield _noted[-1]
    finally:
        _noted.pop()


@lru_cache(maxsize=256)
def _watched_type(model: type[BaseModel], fields: frozenset[str]) -> type[BaseModel]:
    """Return a subclass of a model that notes when one of the given fields is read.

    It is validated as the other one is; to look at all fields at once is to read them too.
    """

    def get(self: Any, name: str) -> Any:
        if _noted and (name in fields or name in _ALL_FIELDS):
            _noted[-1].add(name)
        return object.__getattribute__(self, name)

    space = {"__getattribute__": get, "__module__": model.__module__, "__doc__": model.__doc__}
    return type(model.__name__, (model,), space)
