"""Parameters that tell when a field is read that differs between replicas.

The engine gives each replica its own scan instants, and a block may then serve all of them: unless
it reads a clock's parameters itself. And what is drawn may be checked as a column, unless a
validator reads it together with other fields. Whether they do is watched, not assumed.
"""

from collections.abc import Collection, Iterator
from contextlib import contextmanager
from functools import lru_cache
from typing import Any

from pydantic import BaseModel

from dsa_des.block.component import Parameters


class _Watch:
    """What was read of the fields that differ between replicas."""

    def __init__(self, differing: Collection[str]) -> None:
        self.differing = frozenset(differing)
        self.read: set[str] = set()
        self.refusal: Exception | None = None


@lru_cache(maxsize=256)
def _watched_type(model: type[Parameters]) -> type[Parameters]:
    def get(self: Any, name: str) -> Any:
        fields = object.__getattribute__(self, "__dict__")
        if name in fields:
            watch = object.__getattribute__(self, "_watch")
            if name in watch.differing:
                watch.read.add(name)
                if watch.refusal is not None:
                    raise watch.refusal
        return object.__getattribute__(self, name)

    return type(model.__name__, (model,), {"__slots__": ("_watch",), "__getattribute__": get})


class WatchedParameters:
    """Makes parameters that tell when a field that differs between replicas is read.

    Parameters
    ----------
    parameters : Parameters
        Those of the first replica.
    differing : collection of str
        Fields with other values in other replicas.
    """

    def __init__(self, parameters: Parameters, differing: Collection[str]) -> None:
        self._watch = _Watch(differing)
        model = _watched_type(type(parameters))
        self.parameters: Any = model.__new__(model)
        for name in ("__dict__", "__pydantic_fields_set__", "__pydantic_extra__",
                     "__pydantic_private__"):  # fmt: skip
            object.__setattr__(self.parameters, name, getattr(parameters, name))
        object.__setattr__(self.parameters, "_watch", self._watch)

    @property
    def read(self) -> bool:
        """Whether one of them was read."""
        return bool(self._watch.read)

    def refuse(self, refusal: Exception) -> None:
        """Raise from now on when one of them is read."""
        self._watch.refusal = refusal


#: Fields that were read while `reading`, by watched types; None at other times.
_noted: list[set[str]] = []
# What does not show any field's value. All else of a model's own may show all of them.
_HARMLESS = frozenset({"__class__", "__pydantic_fields_set__"})
_ALL_FIELDS = frozenset(dir(BaseModel)) - _HARMLESS - {"model_fields", "model_fields_set"}


@contextmanager
def reading() -> Iterator[set[str]]:
    """Give the names that are read meanwhile of what `watched_type` makes."""
    _noted.append(set())
    try:
        yield _noted[-1]
    finally:
        _noted.pop()


@lru_cache(maxsize=256)
def watched_type(model: type[BaseModel], fields: frozenset[str]) -> type[BaseModel]:
    """Return a model like another one that notes when one of some fields is read.

    It is validated as the other one is; to look at all fields at once is to read them too.
    """

    def get(self: Any, name: str) -> Any:
        if _noted and (name in fields or name in _ALL_FIELDS):
            _noted[-1].add(name)
        return object.__getattribute__(self, name)

    space = {"__getattribute__": get, "__module__": model.__module__, "__doc__": model.__doc__}
    return type(model.__name__, (model,), space)
