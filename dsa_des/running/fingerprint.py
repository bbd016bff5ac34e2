"""Short fingerprints of what a block sends and of what it remembers, for comparing two runs."""

import functools
import pickle
import types
import warnings
from collections import deque
from collections.abc import Mapping, Set
from dataclasses import fields, is_dataclass
from hashlib import blake2b
from typing import Any

import numpy as np

from dsa_des.block.component import Component, Context
from dsa_des.block.message import Message


def message_fingerprints(message: Message) -> dict[str, bytes]:
    """Return the fingerprint of every field of a message.

    What is neither numbers, text nor a container of them is looked at where it is a dataclass.
    """
    finger = _Fingers(deep=False)
    return {item.name: finger.of(getattr(message, item.name)) for item in fields(message)}


def state_fingerprints(component: Component) -> dict[str, bytes]:
    """Return the fingerprints of every attribute and effect of a block, with all that is within.

    What belongs to the run and not to the block (`Context`), and values of ``cached_property``,
    are left out.
    """
    finger = _Fingers(deep=True)
    found = {f"attribute {name}": finger.of(v) for name, v in _attributes(component).items()}
    effects = component.context.effects
    return found | {f"effect {name}": finger.of(effect) for name, effect in effects.items()}


def _attributes(thing: Any) -> dict[str, Any]:
    found = dict(getattr(thing, "__dict__", {}))
    for cls in type(thing).__mro__:
        slots = vars(cls).get("__slots__", ())
        for name in (slots,) if isinstance(slots, str) else slots:
            if hasattr(thing, name):
                found[name] = getattr(thing, name)
    return {
        name: value
        for name, value in found.items()
        if not isinstance(getattr(type(thing), name, None), functools.cached_property)
    }


class _Fingers:
    """Fingerprints of values; each object is looked at once.

    Parameters
    ----------
    deep : bool
        Whether to look into any object, not only into containers and dataclasses.
    """

    def __init__(self, *, deep: bool) -> None:
        self._deep = deep
        #: By identity; the object is kept, so that the identity stays its own.
        self._known: dict[int, tuple[Any, bytes]] = {}

    def of(self, value: Any) -> bytes:
        """Return the fingerprint of a value."""
        known = self._known.get(id(value))
        if known is not None:
            return known[1]
        self._known[id(value)] = value, b"within itself"
        print_ = blake2b(b"\0".join(self._parts(value)), digest_size=16).digest()
        self._known[id(value)] = value, print_
        return print_

    def _parts(self, value: Any) -> list[bytes]:
        kind = type(value).__qualname__.encode()
        if isinstance(value, np.ndarray) and value.dtype != object:
            return [kind, value.dtype.str.encode(), repr(value.shape).encode(), value.tobytes()]
        if isinstance(value, Mapping):
            items = sorted(self.of(key) + self.of(item) for key, item in value.items())
            return [kind, *items]
        if isinstance(value, Set):
            return [kind, *sorted(map(self.of, value))]
        if isinstance(value, list | tuple | deque | np.ndarray):
            return [kind, *map(self.of, value)]
        if value is None or isinstance(value, bool | int | float | complex | str | np.generic):
            return [kind, repr(value).encode(errors="surrogatepass")]
        if isinstance(value, bytes | bytearray):
            return [kind, bytes(value)]
        if isinstance(value, Context | types.ModuleType | type):
            return [kind]
        if self._deep:
            return [kind, *self._within(value)]
        if is_dataclass(value):
            return [kind, *(self.of(getattr(value, item.name)) for item in fields(value))]
        return [kind]

    def _within(self, value: Any) -> list[bytes]:
        """Return what an object holds: a function's closure, a generator's state, attributes."""
        if isinstance(value, types.MethodType):
            return [value.__func__.__qualname__.encode(), self.of(value.__self__)]
        if isinstance(value, functools.partial):
            return [self.of(value.func), self.of(value.args), self.of(value.keywords)]
        if isinstance(value, types.FunctionType):
            return [value.__qualname__.encode(), *map(self._cell, value.__closure__ or ())]
        attributes = _attributes(value)
        if _knows_its_state(type(value)) or not attributes:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                try:
                    return [pickle.dumps(value)]
                except Exception:  # cannot be written: no state that can be seen
                    pass
        return [name.encode() + self.of(item) for name, item in sorted(attributes.items())]

    def _cell(self, cell: types.CellType) -> bytes:
        try:
            return self.of(cell.cell_contents)
        except ValueError:  # empty
            return b""


def _knows_its_state(cls: type) -> bool:
    """Return whether a class says itself how its state is written, as random generators do."""
    return cls.__reduce__ is not object.__reduce__ or cls.__reduce_ex__ is not object.__reduce_ex__
