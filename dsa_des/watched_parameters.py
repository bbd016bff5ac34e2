"""Parameters of a block that all replicas share though their clocks differ.

The engine gives each replica its own scan instants, and a block may then serve all of them: unless
it reads a clock's parameters itself. Whether it does is watched, not assumed.
"""

from collections.abc import Collection
from functools import lru_cache
from typing import Any

from dsa_des.component import Parameters


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
